"""What `experiments.evaluate` says of the rows that training met, of stored runs and without playing."""

import json
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import experiments.configs  # noqa: F401, registers what runs are made of
from experiments import evaluate_rows
from t2tl_jax.errors import UserError
from t2tl_jax.registry import make_env
from t2tl_jax.runs import config_files
from t2tl_jax.runs import met as of_pools
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.folder import RunFolder

ANY = Path(__file__).parents[2] / "results/any"


@dataclass(frozen=True)
class Stored:
    """What the counting asks of a result."""

    folder: Path | None
    experiment: Any
    iteration: int


def stored(name: str) -> tuple[Any, Config]:
    folder = ANY / name
    config = config_files.load(RunFolder(folder).config)
    return Stored(folder, SimpleNamespace(env=make_env(config.env)), config.iterations), config


@pytest.fixture
def no_drawing(monkeypatch: pytest.MonkeyPatch) -> None:
    def draws(*given: Any) -> None:
        raise AssertionError("a pool is drawn, which takes seconds")

    monkeypatch.setattr(of_pools, "make_pools", draws)


def cells(rows: Any, tasks: list[str]) -> dict[str, tuple[str, str]]:
    return {task: rows.cells(task) for task in tasks}


def test_what_the_folder_knows_is_not_counted_again(no_drawing):
    tasks = ["g1", "g2", "g3", "avoid_6"]
    result, config = stored("any-zones")
    rows = evaluate_rows.rows_met(result, config, tasks, 2)
    known = json.loads((ANY / "any-zones/met.json").read_text(encoding="utf-8"))
    assert cells(rows, tasks) == {task: (known["exactly"][task], known["renamed"][task]) for task in tasks}
    assert rows.cells("g3") == ("2/5", "3/5")
    legend = " ".join(rows.legend())
    assert "met.json, which counts all pools of training: g1, g2, g3, avoid_6." in legend
    assert ">=" not in legend and "pool.held_out" in legend and "pool.unseen" in legend


def test_water_is_answered_at_once_where_its_folder_knows_the_task(no_drawing, capsys):
    result, config = stored("any-water")
    rows = evaluate_rows.rows_met(result, config, ["phi_water"], 2)
    assert rows.cells("phi_water") == ("1/5", "2/5") and "counting" not in capsys.readouterr().out


def test_a_formula_that_is_stored_by_a_name_is_known(no_drawing, tmp_path):
    shares = {"exactly": {"z4": "1/2", "50 tasks on their maps": "1/9"}, "renamed": {"z4": "2/2"}}
    (tmp_path / "met.json").write_text(json.dumps(shares), encoding="utf-8")
    from t2tl_jax.ltl import resolve_tasks

    text = str(resolve_tasks("z4")["z4"])
    found = evaluate_rows.stored(tmp_path, [text, "F Blue"])
    assert {task: tuple(map(str, one)) for task, one in found.items()} == {text: ("1/2", "2/2")}


def test_other_tasks_are_counted_in_some_pools_which_is_said_first(monkeypatch, capsys):
    result, config = stored("any-water")
    before: list[str] = []

    def counted(config: Config, env: Any, tasks: list[str], iterations: int, most: int) -> of_pools.MetInTraining:
        before.append(capsys.readouterr().out)
        share = of_pools.Share(0, 2, at_least=True)
        return of_pools.MetInTraining({task: of_pools.Met(share, share) for task in tasks}, most, 12)

    monkeypatch.setattr(of_pools, "met_in_training", counted)
    rows = evaluate_rows.rows_met(result, config, ["phi_water", "F(Pink & F Gray)"], 2)
    assert before == ["counting the rows of 2 of the 12 pools drawn in training (--pools)\n"]
    assert rows.cells("phi_water") == ("1/5", "2/5") and rows.cells("F(Pink & F Gray)") == (">=0/2", ">=0/2")
    assert rows.cells_of_all(["phi_water", "F(Pink & F Gray)"]) == (">=1/7", ">=2/7")
    legend = " ".join(rows.legend())
    assert "at least so many, from 2 of the 12 pools" in legend and "no task is called new" in legend


def test_none_are_drawn_where_none_are_asked_for(no_drawing):
    result, config = stored("any-zones")
    rows = evaluate_rows.rows_met(result, config, ["F(Blue & F Green)"], 0)
    assert rows.cells("F(Blue & F Green)") == ("-", "-") and "of the 12 pools" in " ".join(rows.legend())


@pytest.mark.slow
def test_all_pools_give_what_is_stored():
    """Where a row of letters_3 is met in the last pool alone."""
    tasks = ["letters_1", "letters_2", "letters_3", "letters_5", "letters_avoid_6"]
    result, config = stored("any-letters")
    found = of_pools.met_in_training(config, result.experiment.env, tasks, result.iteration, 3)
    assert found is not None and (found.counted, found.drawn) == (3, 3)
    known = evaluate_rows.stored(ANY / "any-letters", tasks)
    assert {task: (one.exactly, one.renamed) for task, one in found.by_task.items()} == known


def test_reward_machines_are_named_and_the_other_tasks_counted(no_drawing):
    result, config = stored("any-zones")
    rows = evaluate_rows.rows_met(result, config, ["g3", "rm_t1"], 2)
    assert rows.cells("g3") == ("2/5", "3/5") and rows.cells("rm_t1") == ("-", "-")
    assert "-: no formula, whose rows could be compared: rm_t1." in " ".join(rows.legend())


@pytest.mark.parametrize(("name", "says"), [("any-zones", False), ("any-zones-gru", True)])
def test_that_pretraining_is_not_counted_is_said(no_drawing, name, says):
    legend = " ".join(evaluate_rows.rows_met(*stored(name), ["g3"], 0).legend())
    assert (evaluate_rows.BEFORE in legend) == says


@pytest.mark.parametrize(
    "content",
    [{"a": 1}, {"exactly": 5}, {"exactly": {"z1": [1, 2]}, "renamed": {}}, {"exactly": {}, "renamed": {"z1": "x"}}],
)
def test_what_is_no_count_is_told(tmp_path, content):
    (tmp_path / "met.json").write_text(json.dumps(content), encoding="utf-8")
    with pytest.raises(UserError, match=r"met\.json should hold, for each task"):
        evaluate_rows.stored(tmp_path, ["z1"])


def test_a_count_of_one_kind_alone_is_none(tmp_path):
    (tmp_path / "met.json").write_text(json.dumps({"exactly": {"z1": "1/2"}, "renamed": {}}), encoding="utf-8")
    assert evaluate_rows.stored(tmp_path, ["z1"]) == {}
