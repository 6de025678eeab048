"""Nonsense, more than 500 pieces: each ends with exit code 0 or 2 and a message, soon, and leaves runs as they were.

Formulas, machines, configurations and arguments; folders of runs are in `test_fuzz_folders.py`.
"""

import json
import tempfile
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import tests.fake_learner  # noqa: F401
from experiments import pretrain, run, split, sweep
from t2tl_jax.errors import UserError
from t2tl_jax.ltl import named_machines
from t2tl_jax.ltl.__main__ import main as show_task
from t2tl_jax.registry import named_config
from t2tl_jax.runs import config_files
from tests.fuzzing import changed, examples, is_polite, said

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
