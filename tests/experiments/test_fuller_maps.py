"""Tasks over colours that the maps of a run lack: they get discs there, and the agent must be able to tell them."""

import dataclasses
import io
import json
import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import experiments.configs  # noqa: F401, registers what runs are made of
from envs.zones import OPEN, ZoneConfig, ZoneEnv
from experiments import fuller_maps, play
from t2tl_jax.errors import UserError
from t2tl_jax.networks.lookahead import LookaheadConfig
from t2tl_jax.networks.roles import RolesConfig
from t2tl_jax.networks.state_encoders import FlatConfig, GatedConfig
from t2tl_jax.registry import named_config
from t2tl_jax.runs import evaluations
from t2tl_jax.runs.folder import RunFolder, open_existing

STORED = Path(__file__).parents[2] / "results/any/any-zones"
NEW = "F(Red & F White)"


@pytest.fixture
def zones_run(tmp_path: Path) -> Path:
    """The stored agent of the open ZoneEnv, as if the one seed that is kept with parameters were all of its seeds."""
    folder = Path(shutil.copytree(STORED, tmp_path / "any-zones"))
    (folder / "evaluation.json").unlink()
    config = json.loads((folder / "config.json").read_text(encoding="utf-8"))
    (folder / "config.json").write_text(json.dumps(config | {"seeds": "60,"}), encoding="utf-8")
    return folder


@pytest.fixture
def run_on() -> Any:
    """What is asked of a run before anything is played: its configuration and its environment, whose pool is small."""

    def made(env: ZoneConfig = OPEN, **network: Any) -> Any:
        config = named_config("zones_any")
        network = dataclasses.replace(config.learner.network, **network)
        config = dataclasses.replace(
            config,
            env=dataclasses.replace(env, physics="closed_form"),
            learner=dataclasses.replace(config.learner, network=network),
        )
        return SimpleNamespace(config=config, experiment=SimpleNamespace(env=ZoneEnv(config.env)))

    return made


@pytest.mark.slow
def test_a_list_with_other_colours_is_played_where_they_are(zones_run, evaluate_run, read_json, capsys):
    flags = ["--episodes", "50", "--which", "final", "--pools", "0", "--episode-length", "500"]
    assert evaluate_run(zones_run, "--tasks", f"z1,{NEW}", *flags) == 0
    note, *lines = capsys.readouterr().out.splitlines()
    assert note == (
        "note: the maps of this run have no White or Red, so every episode is played on fuller maps: discs are added "
        "(2 White, 2 Red), and each map has 12 of them in place of 8"
    )
    assert [line.split()[2] for line in lines if line.startswith("final sampled ")] == ["z1", "F(Red", "all"]
    entries = read_json(zones_run / "evaluation.json")["evaluations"]
    assert [(entry["settings"]["task"], entry["settings"]["colours"]) for entry in entries] == [
        ("z1", "GGYYBBMMWWRR"),
        (NEW, "GGYYBBMMWWRR"),
    ]
    for entry in entries:
        assert entry["policies"]["sampled"]["seeds"][0]["success_rate"]["value"] > 0.9


@pytest.mark.slow
def test_one_task_with_another_colour_is_loaded_with_it(zones_run):
    folder, stored = open_existing(zones_run)
    changes = {"task": "F Red", "episode_length": 7}
    played = fuller_maps.load(zones_run, stored, ["F Red"], changes)
    result = played.result
    assert result.config.task == "F Red" and result.config.episode_length == 7 and result.folder == zones_run
    assert result.experiment.env.propositions == ("Blue", "Green", "Red", "Yellow", "Magenta")
    assert result.experiment.table.text(int(result.experiment.table.initial_row[0])) == "F Red"
    what = evaluations.settings(folder, result.experiment, "final", result.iteration, 9) | played.settings
    assert what["task"] == "F Red" and what["colours"] == "GGYYBBMMRR"


@pytest.mark.slow
def test_what_is_typed_may_bring_other_colours(zones_run, monkeypatch, capsys):
    """Programs for the fuller maps are compiled before the formula that asks for them is timed. What is typed later and
    needs other colours does not find the arena full of those before."""
    story, played = play._story, []
    monkeypatch.setattr(play, "_story", lambda one: played.append(one) or story(one))
    monkeypatch.setattr("sys.stdin", io.StringIO("F Redd\nF Red\nF Redd\nF Blue\nF(Cyan & F White)\n"))
    assert play.main([str(zones_run), "--episode-length", "3"]) == 2
    out, err = capsys.readouterr()
    assert out.count("0  F Red\n") == out.count("0  F Blue\n") == out.count("0  F(Cyan & F White)\n") == 1
    assert err.count("note: the maps of this run have no White or Cyan,") == 1 and "and each map has 12" in err
    assert err.count("note: the maps of this run have no Red,") == 1 and "(2 Red), and each map has 10" in err
    assert [one.is_new_shape for one in played] == [False] * 3 and "programs compiled" not in out
    assert err.count("compiling the programs ...") == 1 and err.count("compiling the programs for these maps ...") == 2
    assert "maps ... ready; formulas over Blue, Green, Red, Yellow, Magenta" in err
    first, second = [line for line in err.splitlines() if "unknown" in line]
    assert "known: Blue, Green, Yellow, Magenta" in first and second.endswith('did you mean "Red"?')


@pytest.mark.parametrize("tasks", [["z1", "long"], [], ["F Redd"], ["F Red &"], ["rm_t1"], ["no_such_5"]])
def test_other_tasks_are_left_as_they_are(run_on, tasks):
    """On the maps of the run, or with the mistakes that whoever compiles them tells."""
    result = run_on()
    played = fuller_maps.ready(result, tasks)
    assert played.result is result and not played.note and not played.settings


@pytest.mark.parametrize(
    ("network", "env", "task", "said"),
    [
        ({"state": FlatConfig()}, OPEN, NEW, 'unknown propositions "Red", "White"; known: Blue, Green, Yellow, Mag'),
        ({"state": FlatConfig()}, OPEN, NEW, "no others can be added to its maps: .*network.state=merged"),
        ({"state": GatedConfig()}, OPEN, NEW, "no others can be added"),
        ({}, ZoneConfig(), "F Blue", "known: Black, White, Red, Yellow\nThe one fixed map has no others"),
        ({}, OPEN, "F(White & F Redd)", 'F\\(White & F Redd\\): unknown proposition "Redd"; .*did you mean "Red"'),
        ({}, OPEN, "F(Red & F(Cyan & F Lime))", "no room for discs of Red, Cyan and Lime .*for 2 other colours"),
        ({"task_encoder": RolesConfig(5)}, OPEN, NEW, "tells 5 colours apart, .* have 6: .*name at most 1 in one list"),
        ({"task_encoder": LookaheadConfig(5)}, OPEN, NEW, "tells 5 colours apart"),
    ],
)
def test_colours_that_cannot_be_added(run_on, network, env, task, said):
    with pytest.raises(UserError, match=f"(?s){said}"):
        fuller_maps.ready(run_on(env, **network), ["z1" if env is OPEN else "F Red", task])


def test_a_full_arena_takes_no_other_colour(run_on):
    full = dataclasses.replace(OPEN, colours="GGYYBBMMWWRR")
    with pytest.raises(UserError, match=r"no room for discs of Cyan besides .* and Magenta: write tasks in these"):
        fuller_maps.ready(run_on(full), ["F Cyan"])


def test_evaluations_on_fuller_maps_do_not_say_whether_a_run_solved_its_task(zones_run):
    folder = RunFolder(zones_run)
    config = dataclasses.replace(open_existing(zones_run)[1], task="F Blue")
    what = {"task": "F Blue", "physics": "closed_form", "checkpoint": "final", "episode_length": 1000}

    def stored(value: float, **more: str) -> dict[str, Any]:
        solved = {"value": value, "low": 0.0, "high": 1.0, "count": 1}
        return {"settings": what | more, "policies": {"sampled": {"solved": solved}}}

    entries = [stored(1.0), stored(0.0, colours="GGYYBBMMRR")]
    folder.evaluation.write_text(json.dumps({"evaluations": entries}), encoding="utf-8")
    found = evaluations.solved(folder, config, "closed_form")
    assert found is not None and found.value == 1.0
