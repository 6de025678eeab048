"""Damaged and changed folders of runs: each command ends with a message, and leaves the run as it was."""

import hashlib
import io
import json
import os
import shutil
import tempfile
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import tests.fake_learner  # noqa: F401
from experiments import compare, evaluate, play, plot, run
from t2tl_jax.runs.host_arrays import checksum
from tests.fuzzing import changed, examples, is_polite, said


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


@pytest.mark.slow
@pytest.mark.parametrize(("command", "count"), [("resume", 25), ("evaluate", 10)])
def test_what_a_checkpoint_says_of_itself(evaluated_run, command, count):
    """With a checksum that fits: it is from a stranger, or the one before is taken."""
    newest = max((evaluated_run / "checkpoints").iterdir(), key=lambda folder: int(folder.name))
    file = newest / "info" / "metadata"
    stored = json.loads(file.read_text())

    @given(changed(stored))
    @examples(count)
    def one(content):
        with tempfile.TemporaryDirectory() as base:
            folder = Path(shutil.copytree(evaluated_run, Path(base, "run")))
            if isinstance(content, dict) and "checksum" in content:
                content["checksum"] = checksum(content)
            (folder / file.relative_to(evaluated_run)).write_text(json.dumps(content))
            code, errors = COMMANDS[command](folder)
            assert is_polite(code, errors), (content, code, errors)

    one()


@pytest.mark.parametrize("name", ["status.json", "checkpoints/pipe"])
@pytest.mark.parametrize("command", ["resume", "evaluate"])
def test_a_pipe_is_not_waited_for(finished_run, tmp_path, name, command):
    folder = Path(shutil.copytree(finished_run, tmp_path / "run"))
    (folder / name).unlink(missing_ok=True)
    os.mkfifo(folder / name)
    code, errors = COMMANDS[command](folder)
    assert code == 2 and "is neither a file nor a folder" in errors


@pytest.mark.parametrize(("name", "command"), [("config.json", "evaluate"), ("status.json", "compare")])
def test_a_file_that_would_fill_the_memory_is_not_read(finished_run, tmp_path, name, command):
    folder = Path(shutil.copytree(finished_run, tmp_path / "run"))
    with open(folder / name, "wb") as file:
        file.truncate(2**40)
    code, errors = COMMANDS[command](folder)
    assert code == 2 and "takes 1,048,576 MiB, and at most 64 MiB are read" in errors
