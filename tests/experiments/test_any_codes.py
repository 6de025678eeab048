"""The page of agents for any task: what it says of the codes of formulas, beside the robot and read alone."""

import json
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import jax
import numpy as np
import pytest

from envs.zones import OPEN, OPEN_6
from experiments.reproduction import stored
from experiments.reproduction.anytask import met, suites, tested
from experiments.reproduction.runs import all_runs
from experiments.reproduction.sections import anyalone, anycodes, anyfigures, anytask, anyunread
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.registry import make_env
from t2tl_jax.runs import config_files
from t2tl_jax.runs.experiment import build
from tests.any_runs import figures
from tests.fake_learner import CONFIG
from tests.made_up_runs import write
from tests.page_cells import cells


def test_sizes_of_learned_codes_are_compared(tmp_path):
    """The largest one learned the least in pre-trainings of one length."""
    ends = {"transformer": 0.9, "automaton": 0.99, "rgcn": 0.98, "gru": 0.97}
    runs = {}
    for code, parameters in {"transformer": 8000, "automaton": 1000, "rgcn": 400, "gru": 2000}.items():
        for kind in (anyalone.BROAD, anyalone.PRETRAINED):
            runs[f"{kind}{code}"] = write(tmp_path / f"{kind}{code}", CONFIG, (0, 1), success_rate=ends[code])
        sizes = {"code": 32, "encoder": parameters, "others": 5}
        (tmp_path / f"{anyalone.BROAD}{code}" / "sizes.json").write_text(json.dumps(sizes))
    said = anycodes.sizes_say(runs)
    assert "rgcn 400, automaton 1,000, gru 2,000, transformer 8,000 parameters" in said
    assert "transformer, has 4 to 20 times as many" in said and "came to 0.900, the others to 0.970 to 0.990" in said
    assert said.endswith("No comparison at equal size was made.")
    del runs[f"{anyalone.PRETRAINED}rgcn"]
    assert "slowest" not in anycodes.sizes_say(runs)
    assert anycodes.sizes_say({}) == anycodes.controls_say({}) == ""


def test_controls_that_fail_in_training_are_no_measure(tmp_path):
    runs = {
        f"{anyalone.BROAD}{code}": write(tmp_path / code, CONFIG, (0, 1), success_rate=rate)
        for code, rate in {"names": 0.24, "nothing": 0.23}.items()
    }
    said = anycodes.controls_say(runs)
    assert "In training names (0.24) and nothing (0.23) fail already" in said and "(0.2" not in anycodes.controls_say(
        {f"{anyalone.BROAD}gru": runs[f"{anyalone.BROAD}names"]}
    )
    assert (stored.REPOSITORY / "tests" / "ltl" / "test_rewordings.py").is_file() and "test_rewordings.py" in said


def test_levels_show_codes_side_by_side_and_what_was_not_played(zones):
    row = cells(anycodes.levels({"any-zones-transformer": zones}))["transformer"]  # of the last table, the costs
    heading = ["state", "parameters of the code", "training", "same family", *anycodes.LEVELS]
    assert row == ["2", *anytask.cost(zones)]
    said, table, ends, steps, *_ = anycodes.levels({"any-zones-transformer": zones}).split("\n\n")
    shown = dict(zip(heading, cells(table)["transformer"], strict=True))
    assert shown["state"] == "merged" and shown["z1 to z6"].startswith("0.99 [") and shown["deeper"] == "-"
    assert shown["texts exchanged"].startswith("0.10") and shown["six colours"] == "-"
    assert "Where `-` stands, nothing was measured." in said
    others = dict(zip(heading[2:], cells(ends)["transformer"], strict=True))
    assert others["z1 to z6"] == "0.000 / 0.010 / 0.000" and others["deeper"] == others["six colours"] == "-"
    assert others["training"] == "0.000 / 0.000 / 1.000" and "cannot read" not in ends + said
    lengths = dict(zip(heading[3:], cells(steps)["transformer"], strict=True))
    assert lengths["z1 to z6"] == "150 / 0.70" and lengths["deeper"] == lengths["same family"] == "-"


def test_agents_whose_layers_are_made_for_four_colours_cannot_read_more(tmp_path):
    names = ("any-zones-broad-rgcn", "any-zones-gru", "any-zones-broad-roles-merged", "any-zones-lookahead")
    runs = {name: write(tmp_path / name, all_runs()[name].config, seeds=(76, 77)) for name in names}
    found = {name: [anyunread.cell(run, level) for level in anycodes.LEVELS] for name, run in runs.items()}
    assert anyunread.COLOURS == {"six colours": 6, "eight colours": 8, "ten colours": 10}
    for name, shown in found.items():
        told = dict(zip(anycodes.LEVELS, shown, strict=True))
        assert {told[level] for level in anyunread.COLOURS} == {"-" if "merged" in name else anyunread.CANNOT}, name
        assert told["z1 to z6"] == told["texts exchanged"] == "-"
    said = anycodes.levels(runs)
    assert "cannot read: the agent has no way" in said and "Where `-` stands, nothing was measured." in said
    assert "not played for broad-rgcn (gated), gru (flat): parameters of these agents are not stored," in said
    (runs["any-zones-gru"].path / anyunread.PARAMETERS).touch()
    assert "not played for broad-rgcn (gated), gru (flat). The other codes" in anycodes.levels(runs)


def test_parameters_of_gates_and_of_flat_states_fit_their_own_number_of_colours():
    """Those of merged states have one size."""

    def shapes(name, env):
        config = all_runs()[name].config
        learner = replace(config.learner, num_envs=2, unroll_length=2, minibatch_size=4)
        small = replace(config, learner=replace(learner, network=replace(learner.network, freeze_task_encoder=False)))
        small = replace(small, pool=replace(config.pool, size=2, rows=64, finish=False), pretrained="")
        there = make_env(replace(env, physics="closed_form", pool_size=2))
        other = build(small, make_env(config.env)).elsewhere(
            there, compile_tasks(["F Blue"], there.propositions, there.alphabet)
        )
        given = other.task_env.make_params(0)
        return jax.tree.map(np.shape, jax.eval_shape(other.agent.init, jax.random.key(0), given).params)

    for name in ("any-zones-broad-lookahead", "any-zones-lookahead", "any-zones-broad-roles-merged"):
        assert (shapes(name, OPEN) == shapes(name, OPEN_6)) == ("merged" in name), name


def test_what_was_met_of_every_level_is_said_once_where_trainings_agree(tmp_path):
    config = all_runs()["any-zones-broad-gru"].config

    def made(name, **more):
        run = write(tmp_path / name, config, seeds=(76, 77))
        renamed = dict.fromkeys(suites.ZONE_Z, "1/2") | dict.fromkeys(suites.ZONE_WIDE, "9/9") | more
        renamed[anyfigures.OWN] = "3/4"
        (run.path / met.FILE).write_text(json.dumps({"exactly": {}, "renamed": renamed, "rows": {}}))
        return run

    runs = {f"{anyalone.BROAD}{name}": made(name) for name in ("gru", "rgcn")}
    runs[f"{anyalone.BROAD}lookahead"] = made("lookahead", **{f"{task} (six colours)": "1/5" for task in suites.SIX})
    said = anycodes.levels(runs)
    row = cells(said)["**rows met, up to names: all**"]
    shown = dict(zip(("same family", *anycodes.LEVELS), row[3:], strict=True))
    assert shown["same family"] == "3/4" and shown["z1 to z6"] == "6/12" and shown["six colours"] == "3/15"
    assert shown["wider"] == "27/27" and shown["deeper"] == "-"
    assert "nearly every open row of wider (27/27): success there is hardly generalisation" in said
    runs[f"{anyalone.BROAD}names"] = made("names", **dict.fromkeys(suites.ZONE_WIDE, "0/9"))
    rows = cells(anycodes.levels(runs))
    assert rows["**rows met, up to names: broad-names**"][6] == "0/27"
    assert rows["**rows met, up to names: others**"][6] == "27/27"


def test_codes_by_dynamic_programming_have_lines_of_their_own(tmp_path):
    """What they come to before is no success, since nothing is played."""
    runs, asked = {}, (*suites.ZONE_Z, *suites.ZONE_HARD)
    unplayed = {"agreement": 1.0000001, "episodes": 0.0, "success_rate": np.nan}
    for code, success in (("transformer", 0.97), ("gru", 0.9)):
        for kind, curves in (("pretraining", unplayed), ("zones", {"success_rate": 0.95})):
            name = f"any-{kind}-solved-{code}"
            runs[name] = write(tmp_path / name, all_runs()[name].config, seeds=(88, 89), **curves)
            part = {"scale": "full", "tasks": {task: figures((success, success)) for task in asked}}
            (runs[name].path / tested.FILE).write_text(json.dumps({"zones": part}))
    broad = write(tmp_path / "broad", all_runs()["any-zones-broad-gru"].config, seeds=(76, 77))
    said = anycodes.levels(runs | {"any-zones-broad-gru": broad})
    table, *rest = said.split("\n\n")
    names = list(cells(table))
    apart = names.index("**codes by dynamic programming, seeds 88 to 97**")
    assert names[apart - 1 :] == ["broad-gru", names[apart], "solved-transformer", "solved-gru"]
    assert "The learning rates (0.002 of transformer, 0.003 of gru) were chosen on seeds 100 to 102" in said
    assert "R-GCN and automaton were not trained so" in said and "there are no episodes, and so no success" in said
    bars = {row: of[-1] for part in rest for row, of in cells(part).items() if "formula alone" in row}
    assert list(bars.values()) == ["reached", "**not reached**"] and all("solved-" in bar for bar in bars)
    before = cells(anyalone.read_alone(runs))["solved-gru"]
    assert before[2] == "agreement 1.000 [0.342, 1.000]" and before[:2] == ["2,000,064", "-"]
    without = anycodes.levels({"any-zones-broad-gru": broad})
    assert "dynamic programming" not in without and "R-GCN and automaton" not in without


def test_what_can_be_read_alone_and_what_was_met_before(zones):
    kept_out = replace(zones.config.pool, unseen="")
    (zones.path / "config.json").write_text(config_files.to_json(replace(zones.config, pool=kept_out)))
    row = cells(anyalone.read_alone({"any-pretraining-gru": stored.Stored(zones.path)}))["gru"]
    assert row[3].startswith("0.99 [") and row[4] == "not measured yet"
    assert row[5:] == ["0.000 / 0.010 / 0.000", "-", "nothing", "4/5", "-", "-"]
    pools = -(-zones.config.iterations // zones.config.pool.period)
    assert row[0] == f"{pools * zones.config.pool.size:,}"
    assert anyalone.read_alone({"any-zones": zones}) == ""


def test_what_an_agent_reads_is_that_of_the_pretraining_it_began_with():
    """A pre-training that was made again is another one: a GPU does not repeat it."""
    runs, results = all_runs(), stored.REPOSITORY / "results" / "any"
    pairs = [(name, run.before) for name, run in runs.items() if name.startswith("any-") and run.before is not None]
    assert len(pairs) >= 8 and anyalone.READERS.items() <= set(pairs)
    measured = [pair for pair in pairs if all((results / name / "versions.json").exists() for name in pair)]
    assert len(measured) >= 8 and len({agent for agent, _ in measured} & set(anyalone.READERS)) >= 4
    for agent, reader in measured:
        trained, taught = (json.loads((results / name / "versions.json").read_text()) for name in (agent, reader))
        assert trained["started"]["git_revision"] == taught["started"]["git_revision"], agent
        status, before = (json.loads((results / name / "status.json").read_text()) for name in (agent, reader))
        assert status["pretraining"]["training_seconds"] == before["all_sessions"]["training_seconds"], agent


@pytest.mark.parametrize(("pairs", "how"), [(anycodes.AGAINST_TABLE, "paired"), (anycodes.AGAINST_PLAYED, "")])
def test_learned_codes_stand_against_the_one_that_is_read_off_the_table_and_those_that_were_played(pairs, how):
    """Pre-trainings by dynamic programming have other seeds, so that nothing pairs these agents."""
    names = {name for pair in pairs for name in pair}
    runs = {name: stored.Stored(stored.REPOSITORY / "results" / "any" / name) for name in names}
    lines = anycodes.compared(runs, pairs).splitlines()
    for tasks in (suites.ZONE_Z, suites.ZONE_HARD):
        for first, second in pairs:
            means = [np.mean(list(anycodes._of_each_seed(runs[name], tasks).values())) for name in (first, second)]
            gap = f"| {first} - {second} | {round(means[0] - means[1], 3) + 0.0:.3f} ["
            assert any(gap in line and line.endswith(f"| {how} |") for line in lines), gap
    assert anycodes.compared({first: runs[first]}, pairs) == ""


def test_what_is_read_alone_stands_beside_what_the_agent_does(monkeypatch: pytest.MonkeyPatch) -> None:
    """Formula by formula; runs of other seeds are not put side by side."""
    asked = (*suites.ZONE_Z, *suites.ZONE_HARD)
    agent, reader = next(iter(anyalone.READERS.items()))
    alone = np.random.default_rng(0).uniform(0.0, 0.9, (len(asked), 4))
    alone[0] = 1.0
    success = {reader: alone, agent: alone / 2}

    def figures(run: SimpleNamespace) -> dict[str, Any]:
        rates = zip(asked, success[run.name], strict=True)
        return {
            task: {
                anyalone.SAMPLED: {"success_rate": values, "success_length": 10 * values}
                | {"violation_rate": 1 - values, "env_termination_rate": 0 * values, "timeout_rate": 0 * values}
            }
            for task, values in rates
        }

    counted = {reader: "1/2", agent: "2/2"}
    monkeypatch.setattr(met, "read", lambda name: {"renamed": dict.fromkeys(asked, counted[name])})
    monkeypatch.setattr(anyalone, "figures", figures)
    monkeypatch.setattr(anyalone, "own_family", lambda run: dict.fromkeys(run.seeds, 0.25) if families else {})
    families = True
    runs: Any = {
        name: SimpleNamespace(name=name, path=name, seeds=(1, 2, 3, 4), end=lambda what: {1: 0.5}) for name in success
    }
    said = anyalone.text_alone(runs)
    assert "as they stand: transformer 0.500, 0.250." in said and "are: transformer 0.500 (4 of 60)." in said
    families = False
    assert "family" not in anyalone.text_alone(runs)
    first = next(line for line in said.splitlines() if "beside the robot |" in line)
    assert first.split(" | ")[3] == f"{alone[1].mean() / 2:.2f} ({alone[1].min() / 2:.2f})"
    alone_steps = next(line for line in said.splitlines() if "read alone, steps |" in line)
    lines = [line.strip("| ").split(" | ") for line in said.splitlines()]
    ends = [line for line in lines if line[1:2] == ["beside the robot"]]
    assert ends[1][3] == f"{1 - alone[1].mean() / 2:.3f} / 0.000 / 0.000"
    assert [line[1:3] for line in lines if "rows met" in line[0]] == [
        ["training of the code: all", "1/2"],
        ["training of the agent: all", "2/2"],
    ]
    assert alone_steps.split(" | ")[3] == f"{10 * alone[1].mean():.1f}"
    assert "**not reached**" in said
    success[agent] = np.full((len(asked), 4), 0.96)
    assert "**not reached**" not in anyalone.text_alone(runs)
    runs[agent].seeds = (5, 6, 7, 8)
    assert anyalone.text_alone(runs) == anyalone.text_alone({}) == ""
