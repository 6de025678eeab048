"""Formulas on the command line: `experiments.play`, and lists of tasks for `experiments.evaluate`."""

import io
import re

import numpy as np
import pytest
from PIL import Image

from experiments import evaluate, evaluate_tasks, play
from t2tl_jax.errors import UserError
from t2tl_jax.evaluation.animation import Recording
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.runs.folder import RunFolder
from t2tl_jax.runs.prompt import Played
from t2tl_jax.view import Scene, View


@pytest.fixture
def typed(monkeypatch):
    """Plays lines as if they came through a pipe, and returns the exit code."""

    def command(run, lines, *flags):
        monkeypatch.setattr("sys.stdin", io.StringIO("\n".join(lines)))
        return play.main([str(run), *flags])

    return command


@pytest.mark.slow
def test_every_line_is_played(finished_run, typed, capsys):
    assert typed(finished_run, ["!Black U Red", "", "# a comment", "F(White & F Red)"], "--episode-length", "3") == 0
    out, err = capsys.readouterr()
    assert "ready; formulas over Black, White, Red, Yellow" in err and "error" not in err
    lines = out.splitlines()
    assert lines[0].split(maxsplit=1) == ["0", "!Black U Red"] and lines[1].split()[1] in ("done", "violated", "out")
    assert [line.strip() for line in (lines[-2], lines[-3])] == ["3  out of time", "0  F(White & F Red)"]
    assert lines[-1].strip().startswith("(table in ") and "programs compiled" not in out
    assert typed(finished_run, ["F Red &", "F Rde", "F Red"]) == 2
    out, err = capsys.readouterr()
    assert out.count("first action in") == 1 and err.count("error: ") == 2 and 'did you mean "Red"' in err


def test_a_terminal_is_asked_until_its_end(monkeypatch, capsys):
    answers = iter(["F Red", "", " # no formula", "F White "])

    def answer(question):
        assert question == "formula> "
        try:
            return next(answers)
        except StopIteration:
            raise EOFError from None

    monkeypatch.setattr("builtins.input", answer)
    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    assert list(play._lines()) == ["F Red", "F White"]


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (["--gif", "a.gif"], "no view from above"),
        (["--gif", "a.txt"], "--gif is written as GIF: give a name that ends in .gif, got a.txt"),
        (["--gif", "no/such/a.gif"], "--gif no/such/a.gif: there is no folder no/such;"),
        (["--seed", "7"], "no seed 7"),
        (["--episode-length", "0"], "--episode-length must be at least 1"),
        (["--wich", "best"], "did you mean '--which'"),
    ],
)
def test_mistakes_are_plain_lines(finished_run, typed, flags, said, capsys):
    assert typed(finished_run, ["F Red"], *flags) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ") and said in error


def test_pictures_show_what_is_left(tmp_path, capsys):
    table = compile_tasks("F(Up & F Down)", ("Up", "Down"), "at_most_one")
    start, then = int(table.initial_row[0]), int(table.next_row[table.initial_row[0], 1])
    scenes = Scene(np.zeros((4, 0, 2)), np.zeros((4, 0)), np.ones((4, 2)), np.zeros((4, 2)))
    recording = Recording(scenes, np.array([start, start, then, 0]), verdict=1, truncated=False)
    played = Played(table, recording, np.zeros(1), 1.0, 2.0, False)
    assert play._story(played).splitlines()[:3] == ["     0  F(Up & F Down)", "     2  F Down", "     3  done"]
    view = View(lambda state, params: scenes, (0.0, 0.0), (4.0, 2.0), (), 0.25, (255, 255, 255), 0.5)
    play._draw(played, view, tmp_path / "one.gif")
    with Image.open(tmp_path / "one.gif") as gif:
        assert gif.n_frames == 4
    assert "one.gif" in capsys.readouterr().out


@pytest.mark.slow
def test_a_list_of_tasks_is_a_table(finished, evaluate_run, read_json, tmp_path, capsys):
    (tmp_path / "tasks.txt").write_text("# two\nphi_safe\n\nF(Red & F White)  # reach both\n", encoding="utf-8")
    tasks = ["phi_safe", "F(Red & F White)"]
    assert evaluate_run(finished, "--tasks", str(tmp_path / "tasks.txt"), "--episodes", "8", "--which", "final") == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("final ")]
    assert [re.split(r"\s{2,}", line)[1] for line in lines] == [*tasks, "all tasks"] * 2
    assert "0/2" in lines[1]  # of `!Black U Red`
    entries = read_json(finished / "evaluation.json")["evaluations"]
    assert [entry["settings"]["task"] for entry in entries] == tasks
    assert entries[0]["policies"]["sampled"]["seeds"][0]["success_rate"]["count"] == 8

    assert evaluate_run(finished, "--tasks", ",".join(tasks), "--certify", "50") == 0
    assert "All 4 hold at once with 95% (Bonferroni, each 98.750%)" in capsys.readouterr().out
    (made,) = read_json(finished / "certificates.json")["certificates"]
    assert list(made["by_task"]) == tasks and made["by_task"]["phi_safe"]["success"]["count"] == 50
    assert made["policy"] == "sampled" and made["episodes"] == 50 and "task" not in made["settings"]
    assert made["where"]["command"][:3] == ["python", "-m", "experiments.evaluate"] and made["where"]["git_revision"]
    assert made["where"]["command"][-2:] == ["--certify", "50"]


@pytest.mark.slow
def test_a_task_that_is_given_was_not_trained_on(finished, evaluate_run, capsys):
    flags = ["--task", "F White", "--certify", "9", "--policy", "deterministic"]
    assert evaluate_run(finished, *flags) == 0
    (line,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("F White ")]
    assert line.split()[2:4] == ["0/1", "0/1"]  # of the `!Black U Red` in the configuration


def test_certificates_replace_equal_ones(finished, read_json):
    folder, made = RunFolder(finished), {"seed": 0, "policy": "sampled", "by_task": {"F Red": 1}}
    for seed, value in ((0, 1), (0, 2), (3, 1)):
        entry = made | {"seed": seed, "by_task": {"F Red": value}}
        evaluate_tasks.store_certificates(folder, {"task": "x", "episodes": 5}, entry)
    kept = read_json(folder.certificates)["certificates"]
    assert [(one["seed"], one["by_task"]["F Red"]) for one in kept] == [(0, 2), (3, 1)]
    folder.certificates.write_text("[]", encoding="utf-8")
    with pytest.raises(UserError, match="should hold a JSON object"):
        evaluate_tasks.store_certificates(folder, {}, made)


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (["--tasks", "phi_safe,z1"], 'z1: unknown propositions "Green", "Blue"'),
        (["--tasks", ","], "holds no task"),
        (["--tasks", "F Red", "--task", "F Red"], "not both"),
        (["--tasks", "F Red", "--gif", "True"], "experiments.play draws any"),
        (["--certify", "-1"], "--certify is a number of episodes"),
        (["--certify", "10", "--seed", "9"], "no seed 9"),
    ],
)
def test_lists_that_cannot_be_played(finished_run, evaluate_run, flags, said, capsys):
    assert evaluate_run(finished_run, *flags) == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize(
    ("kept", "said"),
    [((24,), "only seed 24 of 24 to 35 is kept with parameters"), ((24, 25), "only seeds 24 to 25 of 24 to 35 are")],
)
def test_which_seeds_are_kept_is_said_in_words(kept, said):
    assert f"not stored: {said}" in evaluate._not_stored(kept, range(24, 36))
