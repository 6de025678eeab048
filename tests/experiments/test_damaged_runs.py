"""Files of a run that are missing, damaged or cannot be written: said in words, and no result is lost for it."""

import pytest

from t2tl_jax.registry import AGENTS, Kind
from t2tl_jax.runs import evaluations
from tests import fake_agent, fake_learner

pytestmark = pytest.mark.slow  # every test makes a run or two


def test_a_finished_run_without_metrics_is_evaluated_all_the_same(finished, resume, read_json, capsys):
    (finished / "metrics.csv").unlink()
    assert resume(finished, "--run.evaluation-episodes", "4") == 0
    shown = capsys.readouterr().out
    assert "note: no learning curve: cannot read" in shown and f"done: {finished}" in shown
    assert len(read_json(finished / "evaluation.json")["evaluations"]) == 2  # final and best parameters


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda metrics: metrics.unlink(), "is missing, but the checkpoint stands at iteration 2"),
        (lambda metrics: metrics.write_text(metrics.read_text().replace("\n1,", "\none,")), "is damaged in line 2"),
        (lambda metrics: metrics.write_bytes(metrics.read_bytes() + b"\xff\n"), "is damaged: 'utf-8' codec"),
    ],
)
def test_going_on_without_sound_metrics_is_refused_before_compiling(finished, resume, read_json, capsys, damage, said):
    damage(finished / "metrics.csv")
    before = read_json(finished / "status.json")
    capsys.readouterr()
    assert resume(finished, "--frames", "400") == 2
    shown = capsys.readouterr()
    assert said in shown.err and "bring back a copy" in shown.err and "compiled" not in shown.out
    assert read_json(finished / "status.json") == before


def test_an_evaluation_that_cannot_be_stored_is_shown(finished, evaluate_run, resume, capsys):
    (finished / "evaluation.json.tmp").mkdir()  # where the file would be written
    assert evaluate_run(finished, "--episodes", "4") == 2
    shown = capsys.readouterr()
    assert "deterministic  0" in shown.out and f"cannot write {finished / 'evaluation.json'}: Is a dir" in shown.err
    assert resume(finished, "--run.evaluation-episodes", "4") == 0  # the training is not lost
    shown = capsys.readouterr().out
    assert "deterministic  0" in shown and "note: the evaluation is not stored: cannot write" in shown
    assert f"done: {finished}" in shown


@pytest.mark.parametrize("content", ["{", "[]", '{"evaluations": 3}', '{"evaluations": [3]}'])
def test_a_damaged_evaluation_is_told_before_the_next_one(finished, evaluate_run, capsys, content):
    (finished / "evaluation.json").write_text(content)
    assert evaluate_run(finished) == 2
    shown = capsys.readouterr()
    assert "move this file away" in shown.err and "task:" not in shown.out
    assert (finished / "evaluation.json").read_text() == content


def test_an_animation_that_cannot_be_written(finished, evaluate_run, monkeypatch, capsys):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(fake_learner.FakeEnv, "view", lambda env: "a view")
    monkeypatch.setattr(evaluations, "record", lambda *_, **__: None)
    monkeypatch.setattr(evaluations, "save_gif", full)
    assert evaluate_run(finished, "--episodes", "4", "--gif", "True") == 2
    shown = capsys.readouterr()
    assert "stored:" in shown.out and "episode.gif: No space left" in shown.err


def test_a_task_that_the_network_cannot_read_is_explained(finished, evaluate_run, monkeypatch, capsys):
    def too_large(*_):
        raise ValueError("a one-hot code of size 16 cannot tell 17 states apart; set its size to 17")

    def make(*given):
        return fake_agent.make_agent(*given)._replace(init=too_large)

    monkeypatch.setitem(AGENTS._kinds, "fake", Kind(fake_agent.FakeConfig, make))
    assert evaluate_run(finished, "--task", "F Red") == 2
    message = capsys.readouterr().err
    assert "cannot read F Red: a one-hot code of size 16" in message
    assert "keeps the kind and the sizes that it was made with" in message
