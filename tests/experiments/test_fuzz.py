"""Nonsense, more than 500 pieces: each ends with exit code 0 or 2 and a message, soon, and leaves runs as they were.

The examples are the same every time. More of them: set EXAMPLES to a factor, as in
``EXAMPLES=20 python -m pytest tests/experiments/test_fuzz.py``.
"""

import contextlib
import hashlib
import io
import json
import os
import shutil
import tempfile
import time
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import tests.fake_learner  # noqa: F401
from experiments import compare, evaluate, play, plot, pretrain, run, split, sweep
from t2tl_jax.errors import UserError
from t2tl_jax.ltl import named_machines
from t2tl_jax.ltl.__main__ import main as show_task
from t2tl_jax.registry import named_config
from t2tl_jax.runs import config_files

FACTOR = float(os.environ.get("EXAMPLES", "1"))
SOON = 30.0
"""Seconds that one example may take; most take hundredths."""


def examples(count):
    kept = [HealthCheck.function_scoped_fixture, HealthCheck.too_slow, HealthCheck.data_too_large]
    return settings(max_examples=round(count * FACTOR), suppress_health_check=kept)


def said(command, *texts):
    """Exit code and what was printed to standard error, where a traceback would show."""
    errors, begin = io.StringIO(), time.monotonic()
    with contextlib.redirect_stderr(errors), contextlib.redirect_stdout(io.StringIO()):
        code = command(list(texts))
    assert time.monotonic() - begin < SOON, texts
    return code, errors.getvalue()


def is_polite(code, errors):
    """Done, or refused in words."""
    return code == 0 or (code == 2 and errors.strip() and "Traceback" not in errors)


PIECES = [
    "F",
    "G",
    "X",
    "U",
    "!",
    "&",
    "|",
    "(",
    ")",
    "->",
    "<->",
    "true",
    "false",
    "a",
    "b",
    "Red",
    " ",
    "é",
    "'",
    "\\",
]


@st.composite
def edited(draw, originals, pieces=PIECES):
    """A sound text of which some pieces are lost, doubled, moved or replaced."""
    text = list(draw(st.sampled_from(originals)))
    for _ in range(draw(st.integers(1, 6))):
        at = draw(st.integers(0, len(text)))
        new = draw(st.one_of(st.sampled_from(pieces), st.text(max_size=3)))
        kind = draw(st.sampled_from(["insert", "cut", "replace", "double"]))
        end = min(len(text), at + draw(st.integers(0, 8)))
        text[at:end] = {"insert": [new, *text[at:end]], "cut": [], "replace": [new], "double": text[at:end] * 2}[kind]
    return "".join(text)


FORMULAS = [
    "!Red U (Black & F White)",
    "F(a & (!b U (c | d)))",
    "(!a U b) & (!c U d) & F(e & X f)",
    "F(a -> b) | (a <-> X X b)",
    "phi_water",
    "phi_zone_prime",
    "(" * 30 + "F a" + ")" * 30,
]


def shown(text):
    """Compile and print a task as a user does."""
    return said(show_task, text, "--max-rows", "2000")


@pytest.mark.slow
@given(edited(FORMULAS) | st.text(max_size=40) | st.lists(st.sampled_from(PIECES), max_size=25).map(" ".join))
@examples(170)
def test_formulas(text):
    assert is_polite(*shown(text))


MACHINES = [str(named_machines(name)[0]) for name in ("rm_t1", "rm_t5", "rm_t10_published")]


@pytest.mark.slow
@given(edited(MACHINES, [*PIECES, "->", "\n", "state", ":", "1e999", "nan", "-", "# "]))
@examples(90)
def test_reward_machines(text):
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "machine.rm")
        file.write_bytes(text.encode(errors="replace"))
        assert is_polite(*shown(str(file)))


@pytest.mark.parametrize("text", [*FORMULAS, *MACHINES])
def test_what_is_edited_is_sound(text, tmp_path):
    """So that what is wrong with the others is the edit, and not how they are given."""
    file = tmp_path / "machine.rm"
    file.write_text(text, encoding="utf-8")
    assert shown(str(file) if text in MACHINES else text) == (0, "")


NONSENSE = st.sampled_from(
    [None, True, -1, 0, 1e308, float("nan"), float("inf"), 2 * 10**9, 2**63, "", "x", "../..", "/a.rm", [], {}, [[]]]
)


@st.composite
def changed(draw, content):
    """JSON with a few values replaced, lost or added somewhere."""
    content = json.loads(json.dumps(content))
    for _ in range(draw(st.integers(1, 3))):
        at = content
        while isinstance(at, dict) and at:
            key = draw(st.sampled_from(sorted(at)))
            if not isinstance(at[key], dict) or not at[key] or draw(st.integers(0, 3)) == 0:
                kind = draw(st.sampled_from(["replace", "replace", "lose", "add"]))
                if kind == "lose":
                    del at[key]
                else:
                    at[key if kind == "replace" else key + "_"] = draw(NONSENSE)
                break
            at = at[key]
    return content


CONFIGS = [json.loads(config_files.to_json(named_config(name))) for name in ("zone_ppo", "waterworld_dqn", "water_any")]


@given(st.sampled_from(CONFIGS).flatmap(changed))
@examples(80)
def test_configurations(content):
    try:
        config = config_files.from_json(json.dumps(content), "config.json")
    except UserError as error:
        assert str(error).strip()
    else:
        assert config_files.from_json(config_files.to_json(config), "again") == config


FAKE = json.loads(config_files.to_json(named_config("fake")))


@pytest.mark.slow
@given(changed(FAKE))
@examples(30)
def test_files_of_configurations(content):
    """Given to the command, which trains what is sound."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "mine.json")
        file.write_text(json.dumps(content))
        own = ["--frames", "100", "--seeds", "1", "--run.evaluation-episodes", "0", "--run.folder", f"{folder}/runs"]
        code, errors = said(run.main, "--config", str(file), *own)
        assert is_polite(code, errors), (content, errors)
        assert code == 0 or not any(Path(folder).rglob("metrics.csv")), content


FLAGS = ["frames", "task", "seeds", "learner.discount", "learner.rate", "episode-length", "random-starts", "labels"]
FLAGS += [
    "pool.size",
    "run.evaluation-episodes",
    "run.checkpoint-period",
    "selection.points",
    "learnr.rate",
    "until-solved",
]
VALUES = [
    "-1",
    "0",
    "nan",
    "inf",
    "1e400",
    "",
    "x",
    "0.5",
    "100",
    "None",
    "True",
    "1,1",
    "3,",
    "F(a)",
    "F Red",
    "--seeds",
    "😀",
]


@pytest.mark.slow
@given(st.lists(st.tuples(st.sampled_from(FLAGS), st.sampled_from(VALUES)), min_size=1, max_size=3))
@examples(60)
def test_overrides(pairs):
    flags = [text for flag, value in pairs for text in (f"--{flag}", value)]
    with tempfile.TemporaryDirectory() as folder:
        own = ["--config", "fake", "--frames", "100", "--run.evaluation-episodes", "0", "--run.folder", folder]
        code, errors = said(run.main, *own, *flags)
        assert is_polite(code, errors), (flags, errors)
        assert code == 0 or not any(Path(folder).rglob("metrics.csv")), flags  # refused before anything was written


GRIDS = ["learner.discount=", "learner.rate=", "method=", "frames=", "seeds=", "task=", "run.folder=", "=", ""]
SPACES = ["", "0..1", "1..0", "log:0..1", "log:1e-5..1e-3", "nan..1", "..", "gelu,relu", "1,1", "x"]
OTHERS = {
    "sweep": (sweep.main, ["--grid"], GRIDS, VALUES),
    "search": (sweep.main, ["--search", "1", "--space"], GRIDS, SPACES),
    "split": (split.main, ["--draws", "50", "--training", "z1", "--tests"], ["", "z1,", "reach_"], [*VALUES, "a,b"]),
    "pretrain": (pretrain.main, ["--task"], [""], [*VALUES, "Until_1_2_1_1", "rm_t1"]),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", OTHERS)
def test_other_commands(name):
    command, flags, fields, values = OTHERS[name]

    @given(st.sampled_from(fields), st.sampled_from(values))
    @examples(12)
    def one(field, value):
        with tempfile.TemporaryDirectory() as folder:
            own = ["--config", "fake", "--frames", "100", "--run.evaluation-episodes", "0", "--run.folder", folder]
            texts = [*([] if name == "split" else own), *flags, field + value]
            code, errors = said(command, *texts)
            assert is_polite(code, errors), (texts, code, errors)
            assert code == 0 or not any(Path(folder).rglob("metrics.csv")), texts

    one()


def digests(folder):
    return {
        str(file.relative_to(folder)): hashlib.sha256(file.read_bytes()).hexdigest()
        for file in sorted(folder.rglob("*"))
        if file.is_file() and file.name != ".lock"
    }


@st.composite
def damage(draw):
    """(which file, counted round, what becomes of it)."""
    share = draw(st.floats(0, 1))
    byte = draw(st.integers(0, 255))
    kind = draw(st.sampled_from(["cut", "flip", "empty", "lose", "folder", "text"]))
    return draw(st.integers(0, 200)), kind, share, byte


def spoil(folder, number, kind, share, byte):
    files = [file for file in sorted(folder.rglob("*")) if file.is_file() and file.name != ".lock"]
    file = files[number % len(files)]
    content = file.read_bytes()
    at = int(share * len(content))
    if kind in ("lose", "folder"):
        file.unlink()
        if kind == "folder":
            file.mkdir()
        return
    flipped = content[:at] + bytes([byte]) + content[at + 1 :]
    file.write_bytes({"cut": content[:at], "flip": flipped, "empty": b"", "text": b'{"a": [1, 2'}[kind])


COMMANDS = {
    "resume": lambda folder: said(run.main, "--resume", str(folder), "--frames", "300"),
    "evaluate": lambda folder: said(evaluate.main, str(folder), "--episodes", "4"),
    "compare": lambda folder: said(compare.main, str(folder), "--fairness", "True"),
    "plot": lambda folder: said(plot.main, str(folder), "--output", str(folder.parent / "curve.png")),
    "play": lambda folder: typed(str(folder)),
}


def typed(*texts):
    """Play what stands on the standard input."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.stdin", io.StringIO("F Red\nF(\n"))
        return said(play.main, *texts)


@pytest.mark.slow
@pytest.mark.parametrize("command", ["resume", "evaluate", "compare"])
def test_configurations_of_run_folders(finished_run, command):
    stored = json.loads((finished_run / "config.json").read_text())

    @given(changed(stored))
    @examples(30)
    def one(content):
        with tempfile.TemporaryDirectory() as base:
            folder = Path(shutil.copytree(finished_run, Path(base, "run")))
            (folder / "config.json").write_text(json.dumps(content))
            before = digests(folder)
            code, errors = COMMANDS[command](folder)
            assert is_polite(code, errors), (content, code, errors)
            assert code == 0 or digests(folder) == before, content

    one()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "count"), [("resume", 25), ("evaluate", 5), ("compare", 30), ("plot", 15), ("play", 8)]
)
def test_run_folders(finished_run, command, count):
    """More of what is soon over; an evaluation compiles (`test_damaged_runs.py` has its program)."""

    @given(damage())
    @examples(count)
    def one(how):
        with tempfile.TemporaryDirectory() as base:
            folder = Path(shutil.copytree(finished_run, Path(base, "run")))
            spoil(folder, *how)
            before = digests(folder)
            code, errors = COMMANDS[command](folder)
            assert is_polite(code, errors), (how, code, errors)
            assert code == 0 or digests(folder) == before, how

    one()


JSON_FILES = ("status.json", "versions.json", "evaluation.json")


@pytest.fixture(scope="module")
def evaluated_run(finished_run, tmp_path_factory):
    """The same with an evaluation, not to be changed either."""
    folder = Path(shutil.copytree(finished_run, tmp_path_factory.mktemp("evaluated") / "run"))
    assert said(evaluate.main, str(folder), "--episodes", "4")[0] == 0
    return folder


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "count"), [("compare", 60), ("plot", 10), ("resume", 10), ("evaluate", 2), ("play", 2)]
)
def test_what_the_files_of_a_run_say(evaluated_run, command, count):
    """Well-formed JSON with other values, or without some."""
    contents = {name: json.loads((evaluated_run / name).read_text()) for name in JSON_FILES}

    @given(st.sampled_from(JSON_FILES).flatmap(lambda name: st.tuples(st.just(name), changed(contents[name]))))
    @examples(count)
    def one(how):
        name, content = how
        with tempfile.TemporaryDirectory() as base:
            folder = Path(shutil.copytree(evaluated_run, Path(base, "run")))
            (folder / name).write_text(json.dumps(content))
            before = digests(folder)
            code, errors = COMMANDS[command](folder)
            assert is_polite(code, errors), (how, code, errors)
            assert code == 0 or digests(folder) == before, how

    one()


@st.composite
def header(draw, names):
    """The names of columns with some of them changed, lost, doubled or put elsewhere."""
    names = list(names)
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, len(names) - 1))
        kind = draw(st.sampled_from(["change", "change", "lose", "double", "swap"]))
        if kind == "lose" and len(names) > 1:
            del names[at]
        elif kind == "double":
            names.insert(at, names[at])
        elif kind == "swap":
            names[at], names[0] = names[0], names[at]
        else:
            names[at] = draw(st.sampled_from([names[at] + "x", names[at][1:], "", "score_1", "best_score_1"]))
    return names


@pytest.mark.slow
@pytest.mark.parametrize(("command", "count"), [("compare", 30), ("plot", 10), ("resume", 8)])
def test_columns_of_metrics(finished_run, command, count):
    """Of which all but the first three may be others in another version; those that every version has are asked for."""
    names, *rows = [line.split(",") for line in (finished_run / "metrics.csv").read_text().splitlines()]

    @given(header(names), st.booleans())
    @examples(count)
    def one(changed_names, whole):
        """With the cells of a lost column, or without them."""
        lines = rows if whole else [row[: len(changed_names)] for row in rows]
        with tempfile.TemporaryDirectory() as base:
            folder = Path(shutil.copytree(finished_run, Path(base, "run")))
            (folder / "metrics.csv").write_text("\n".join(",".join(line) for line in [changed_names, *lines]) + "\n")
            before = digests(folder)
            code, errors = COMMANDS[command](folder)
            assert is_polite(code, errors), (changed_names, code, errors)
            assert code == 0 or digests(folder) == before, changed_names

    one()
