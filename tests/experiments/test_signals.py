"""Ctrl-C and SIGTERM at every stage: exit code 0, no traceback, a folder that can be resumed."""

import signal
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

import t2tl_jax
import tests.fake_learner  # noqa: F401
from experiments import run
from t2tl_jax.runs import pretraining
from tests.fake_learner import PRETRAINING
from tests.forked_commands import Command, Commands

pytestmark = pytest.mark.slow  # every test waits for processes

Start = Callable[..., Command]


@pytest.fixture(scope="module")
def commands(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Commands]:
    begun = Commands(tmp_path_factory.mktemp("commands"))
    yield begun
    begun.end()


@pytest.fixture
def command(commands: Commands) -> Start:
    """Starts `experiments.run` with these flags, and with delays as environment variables."""
    return lambda *flags, **delays: commands.start("--import", "tests.fake_pretraining", *flags, **delays)


@pytest.fixture
def start(command: Start) -> Start:
    """Starts a run of the fake learner."""

    def begin(folder: Path, frames: str, pretrained: str = "", **delays: str) -> Command:
        flags = ["--config", "fake", "--run.folder", str(folder), "--pretrained", pretrained, "--frames", frames]
        return command(*flags, "--run.progress", "True", **delays)

    return begin


@pytest.fixture
def go_on(command: Start) -> Start:
    """Resumes a run."""
    return lambda run, **delays: command("--resume", str(run), **delays)


def read_until(process: Command, text: str) -> str:
    seen = ""
    while text not in seen:
        character = process.stdout.read(1)
        assert character, f"the process ended before {text!r}:\n{seen}"
        seen += character
    return seen


def finish(process: Command) -> str:
    output = process.rest()
    assert "Traceback" not in output, output
    return output


def iterations(folder: Path) -> int:
    (metrics,) = folder.glob("fake/*/metrics.csv")
    return len(metrics.read_text().splitlines()) - 1


def test_stop_during_training_saves_and_resumes_and_during_evaluation_keeps_the_training(tmp_path, start, go_on, train):
    process = start(tmp_path, "1500", FAKE_SECONDS="0.2")
    read_until(process, "training:")
    time.sleep(0.5)
    process.send_signal(signal.SIGINT)
    output = finish(process)
    assert process.returncode == 0, output
    assert "continue with --resume" in output
    done = iterations(tmp_path)
    assert 0 < done < 15
    (run,) = (tmp_path / "fake").iterdir()
    assert (run / "learning_curve.png").exists()

    process = go_on(run, FAKE_EVALUATION_SECONDS="30")
    read_until(process, "evaluating")
    process.send_signal(signal.SIGTERM)
    output = finish(process)
    assert process.returncode == 0, output
    assert "stopped while evaluating and drawing, with training complete; continue with --resume" in output
    whole = train("--frames", "1500", "--run.evaluation-episodes", "0")
    assert (run / "metrics.csv").read_bytes() == (whole / "metrics.csv").read_bytes()


def test_a_stop_while_drawing_says_whether_training_was_complete(tmp_path):
    result, heard = t2tl_jax.train("fake", folder=tmp_path / "run"), []
    for ended in ("complete", "interrupted"):
        cut = replace(result, ended=ended, iteration=1)
        run._conclude(cut, SimpleNamespace(call=lambda work, when: heard.append(when)))
    assert heard[0] == "while evaluating and drawing, with training complete"
    assert heard[1].startswith("while drawing, with training cut after iteration 1 of ")


def test_stop_during_automatic_pretraining_gives_one_hint_which_works(
    tmp_path, start, go_on, resume, read_json, monkeypatch
):
    """Before it compiles, and after it has been resumed and is at work."""
    monkeypatch.setattr(pretraining, "SCHEDULE", PRETRAINING)
    process = start(tmp_path, "300", pretrained="auto", FAKE_SECONDS="0.05")
    stop_in_pretraining(process, tmp_path, "/pretraining\n")
    (run,) = (tmp_path / "fake").iterdir()
    stop_in_pretraining(go_on(run, FAKE_SECONDS="0.05"), tmp_path, "training:")
    assert resume(run, "--run.progress", "False", "--run.evaluation-episodes", "0") == 0
    assert read_json(run / "status.json")["iteration"] == 3
    assert read_json(run / "status.json")["pretraining"]["frames_per_seed"] > 0
    assert read_json(run / "pretraining" / "status.json")["state"] == "finished"


def stop_in_pretraining(process: Command, base: Path, moment: str) -> None:
    seen = read_until(process, moment)
    process.send_signal(signal.SIGINT)
    output = seen + finish(process)
    assert process.returncode == 0, output
    (run,) = (base / "fake").iterdir()
    assert "stopped during pre-training" in output
    assert output.count("--resume") == 1 and f"continue with --resume {run}\n" in output


def test_stop_while_preparing_writes_nothing(tmp_path, start):
    process = start(tmp_path, "4000", FAKE_COMPILE_SECONDS="20")
    read_until(process, "building")
    process.send_signal(signal.SIGINT)
    finish(process)
    assert not list(tmp_path.iterdir())
