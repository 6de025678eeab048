"""The page of agents for any task: what its tables say of stored figures."""

import json
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import jax
import numpy as np
import pytest

import tests.fake_learner  # noqa: F401
from envs.zones import OPEN, OPEN_6, ZoneEnv
from experiments.paper import published_any as published
from experiments.reproduction import stored
from experiments.reproduction.anytask import met, picture, suites, terms, tested
from experiments.reproduction.changed import changed
from experiments.reproduction.plan import Run
from experiments.reproduction.runs import all_runs
from experiments.reproduction.sections import (
    anyaims,
    anyalone,
    anycertified,
    anycodes,
    anyfigures,
    anymemory,
    anytask,
    anyunread,
)
from experiments.reproduction.sections.anyaims import Bar
from experiments.reproduction.sections.figures import found_or_not
from t2tl_jax.evaluation.statistics import exact_rate
from t2tl_jax.ltl import compile_tasks, resolve_tasks
from t2tl_jax.networks.lookahead import LookaheadConfig
from t2tl_jax.networks.state_encoders import FlatConfig
from t2tl_jax.registry import make_env
from t2tl_jax.runs import config_files
from t2tl_jax.runs.experiment import build
from tests.fake_learner import CONFIG
from tests.made_up_runs import write
from tests.page_cells import cells


def figures(success):
    """What is stored of a task, the same for both policies."""
    rest = {"violation_rate": 0.0, "timeout_rate": 0.0, "env_termination_rate": 0.01, "discounted_return": 0.7}
    of = {name: [value] * len(success) for name, value in (rest | {"success_length": 150.0}).items()}
    return {policy: of | {"success_rate": list(success)} for policy in ("sampled", "deterministic")}


@pytest.fixture
def zones(tmp_path):
    """A run of which two seeds were tested on z1 to z6, once with other texts."""
    made = write(tmp_path / "any-zones", all_runs()["any-zones"].config, seeds=(24, 25))
    tasks = {name: figures((1.0, 0.99)) for name in suites.ZONE_Z} | {"z6": figures((1.0, 0.9))}
    exchanged = {name: figures((0.1, 0.1)) for name in suites.ZONE_Z}
    content = {"zones": {"scale": "full", "tasks": tasks}, "texts exchanged": {"scale": "full", "tasks": exchanged}}
    (made.path / tested.FILE).write_text(json.dumps(content))
    (made.path / met.FILE).write_text(
        json.dumps({"exactly": {"z1": "3/5"}, "renamed": {"z1": "4/5"}, "rows": {"exactly": 9, "renamed": 8}})
    )
    return made


def test_the_page_shows_every_formula_beside_the_figures_of_others(zones):
    from experiments.reproduction.items import ITEMS

    rows = cells(ITEMS["any-open"].section({"any-zones": zones}))
    assert rows["z1"][:2] == ["3/5", "4/5"] and rows["z2"][:2] == ["-", "-"]
    assert rows["z6"][2].startswith("0.950 [") and rows["z6"][3:5] == ["[0.315, 1.000]", "0.900"]
    assert rows["z1"][-6:] == ["0.975, 314", "0.922, 303", "0.940, 470", "0.852, 452", "0.595, 424", "116"]
    assert rows["**z1 to z6**"][-6:] == [
        *("0.989, 223, return 0.646", "0.931, 226.5", "0.925, 355.7", "0.868, 347.3", "0.614, 334", "-")
    ]
    assert "GenZ-LTL (not published: played by this project, not stored)" in rows["task"][-6]
    assert rows["**z1 to z6**"][2].startswith("0.988 [") and rows["**z1 to z6**"][3:5] == ["-", "0.900"]
    asked = {name: row for name, row in rows.items() if row[-1] in ("reached", "**not reached**")}
    assert asked["success, worst seed and formula of z1 to z6"] == ["at least 0.97", "0.900 (z6)", "**not reached**"]
    assert asked["steps, mean of z1 to z6"][-1] == "reached" and len(asked) == 5  # of the rest nothing was played
    assert asked["seconds, training of all 2 seeds and compiling"] == ["under 300", "90", "reached"]
    assert ITEMS["any-open"].section({}) == ""


def test_bars_are_reached_or_not():
    of = {"a": figures((1.0, 0.9)), "b": figures((0.98, 0.98))}

    def said(**bar):
        return cells(anyaims.verdicts(of, [Bar("x", ("a", "b"), **bar)]))["x"][-2:]

    assert said(least=0.5)[1] == "reached" and said(least=0.97)[1] == "**not reached**"
    assert said(least=0.2, over="task") == ["0.950 (a); worst seed and formula 0.900", "reached"]
    assert said(least=0.95, over="worst") == ["0.900 (a)", "**not reached**"]
    assert said(most=150, figure="success_length")[1] == "reached"
    assert anyaims.verdicts(of, [Bar("x", ("a", "c"), least=0.1)]) == ""


def rates(*by_seed):
    """Figures of a task with these rates."""
    return {policy: {name: np.array(values) for name, values in of.items()} for policy, of in figures(by_seed).items()}


def test_a_mean_that_reaches_the_bar_is_doubted_by_intervals_and_certificates():
    """As of FlatWorld's fourth formula: ten seeds whose interval includes the bar, and a certificate below it."""
    of = {"a": rates(0.986, 0.996, 0.987, 0.997, 0.984, 0.998), "b": rates(*[0.999] * 3, *[0.998] * 3)}
    below, above = (anycertified.Bounds(40, exact_rate(hits, 10_000)) for hits in (9_870, 9_990))
    bar = {"a": Bar("x", ("a",), least=0.99), "b": Bar("x", ("b",), least=0.99)}

    def said(bar, **certified):
        (aim,) = anyaims.aims(of, [bar], certified)
        return aim[-1]

    doubt = "reached by the mean alone: the interval over seeds includes the bar"
    assert said(bar["a"]) == doubt and said(bar["b"]) == "reached"
    assert said(bar["a"], a=above, b=below) == doubt  # of another task
    both = f"{doubt}; the certificate of a, of seed 40, lies below it: 0.9870 [0.9846, 0.9891]"
    assert said(bar["a"], a=below) == both and said(bar["b"], b=below).endswith("0.9870 [0.9846, 0.9891]")
    assert said(bar["b"], b=above) == "reached"
    worst = Bar("x", ("a", "b"), least=0.99, over="task")
    assert said(worst, a=below).startswith("reached by the mean alone: the interval over seeds, [0.985, 0.998], inclu")
    assert said(worst, a=below).endswith("; the certificate of a, of seed 40, lies below it: 0.9870 [0.9846, 0.9891]")
    assert "certificate" not in said(Bar("x", ("a", "b"), least=0.99), a=below)  # a mean asks nothing of its parts
    assert said(replace(bar["a"], least=0.995), a=below) == "**not reached**"


def test_where_other_formulas_may_miss_the_bar_it_is_said():
    """The formulas differ more than the seeds."""
    of = {"a": rates(0.9, 0.91, 0.9), "b": rates(0.5, 0.51, 0.5)}
    (aim,) = anyaims.aims(of, [Bar("x", ("a", "b"), least=0.6)])
    assert aim[-1] == "reached for these formulas; the interval for others of their kind includes the bar"


def test_tasks_whose_time_is_short_are_named():
    of = {task: rates(0.9, 0.8) for task in suites.ZONE_DEEP}
    for values in of["reach_12"].values():
        values |= {"success_length": np.array([940.0, 960.0]), "success_rate": np.array([0.4, 0.5])}
    said = anytask.near_the_limit(of, 1000)
    assert said.startswith(
        "reach_12: the episodes that succeed take 950 steps of the limit of 1,000, and 0.000 of all run"
    )
    assert "0.793 here, 0.850 without it." in said and said.count("take") == 1
    assert anytask.near_the_limit({"a": rates(0.9, 0.8)}, 1000) == ""


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


def test_a_seed_that_pulls_a_mean_down_is_named(monkeypatch, tmp_path):
    made = write(tmp_path / "carried", CONFIG, (0, 1, 2, 3, 4), success_rate=0.5)
    own = {0: 0.7, 1: 0.72, 2: 0.1, 3: 0.71, 4: 0.69}
    monkeypatch.setattr(anymemory, "own_family", lambda run: own)
    runs = {"any-memory-carried": made}
    wanted = " One seed pulls the mean down of: carried seed 2 (0.100, in training 0.500; mean of the others 0.705)."
    assert anymemory._pulled(runs) == wanted
    own[2] = 0.68
    assert anymemory._pulled(runs) == ""


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
    assert before[2] == "agreement 1.000" and before[:2] == ["2,000,064", "-"]
    without = anycodes.levels({"any-zones-broad-gru": broad})
    assert "dynamic programming" not in without and "R-GCN and automaton" not in without


def test_what_memory_is_and_how_far_it_was_trained_is_said(tmp_path):
    names = ("any-memory-t1tl", "any-memory-gru")
    config, rate = all_runs()["any-memory-gru"].config, np.linspace(0.0, 0.8, 20)[None].repeat(2, 0)
    runs = {name: write(tmp_path / name, config, (24, 25), iterations=20, success_rate=rate) for name in names}
    said = anymemory.memory(names, runs).replace("\n", " ")
    assert "holds the last 24 steps, in which the robot goes 0.7 m at most, where the lidar reaches 1.2 m" in said
    assert (
        "All had 0 million frames, agents of the broad family 80 and any-zones 100." in said
        and "Between 75-80 % and 95-100 % of the frames" in said
    )
    assert "from 0.632 to 0.800 (t1tl), from 0.632 to 0.800 (gru). It rose until the end" in said
    assert "of such a one nothing was measured" in said
    of_carried = write(tmp_path / "carried", all_runs()[anymemory.CARRIED].config, (24, 25), iterations=20)
    with_it = anymemory.memory((*names, anymemory.CARRIED), runs | {anymemory.CARRIED: of_carried})
    assert "learns over 32 steps" in with_it and "nothing was measured" not in with_it
    still = {name: write(tmp_path / f"{name}-2", config, (24, 25), iterations=20, success_rate=0.5) for name in names}
    assert "It still rose of none." in anymemory.memory(names, still)
    assert "m: it holds little that is out of the lidar's reach. No longer window was tried." in said
    assert {"violation", "ended by env", "time-out"} <= set(cells(said)["policy"]) and "open rows" not in said
    own = {"formulas": 8, "exactly": 0, "renamed": 5, "without a row met": 1}
    shares = {"exactly": {met.OWN: "2/9"}, "renamed": {met.OWN: "7/9"}, "rows": {}, "own": own}
    (runs[names[0]].path / met.FILE).write_text(json.dumps(shares))
    with_rows = anymemory.memory(names, runs)
    assert "of 1 no row; of their open rows it met 7/9 up to names, 2/9 under their own." in with_rows


def test_more_colours_are_only_on_the_map():
    for suite in suites.MORE_COLOURS:
        assert suite.tasks == suites.SIX and len(set(suite.env.colours)) >= 6
        named = {name for formula in resolve_tasks(suite.tasks).values() for name in formula.propositions()}
        assert named == set(ZoneEnv(OPEN_6).propositions) <= set(ZoneEnv(suite.env).propositions)
    assert "Discs have a radius of 0.40 m,\n  with ten colours of 0.35 m." in terms.TERMS


def test_what_was_met_stands_beside_certificates(zones):
    one = {"success": vars(exact_rate(9, 10)), "violation": vars(exact_rate(1, 10)), "timeouts": 0}
    made = {"seed": 24, "policy": "sampled", "episodes": 10, "seconds": 1.0, "compile_seconds": 1.0}
    made["by_task"] = dict.fromkeys(("z1", "z2"), one | {"env_terminations": 0})
    (zones.path / tested.FILE).write_text(json.dumps({tested.CERTIFIED: made}))
    said = anycertified.certified({"any-zones": zones})
    z1, z2 = [line.split(" | ") for line in said.splitlines() if line.startswith("| any-zones | ")]
    assert z1[1:4] == ["z1", "3/5", "4/5"] and z2[1:4] == ["z2", "-", "-"] and z1[4].startswith("0.90000 [")
    assert "Their maps are those that are kept for evaluation" in said and "a map of its own" not in said


def test_figures_of_other_worlds_are_told_apart():
    """Means as they were computed from the same files before."""
    means = {method: published.mean_of(list(of.values())) for method, of in published.KINEMATIC_NM.items()}
    wanted = {"StructLTL": 0.954, "DeepLTL": 0.891, "GenZ-LTL": 0.808, "LTL2Action": 0.491}
    assert {method: mean.success for method, mean in means.items()} == pytest.approx(wanted, abs=6e-4)
    said = terms.other_worlds().replace("\n", " ")
    assert said in terms.TERMS.replace("\n", " ")
    assert all(f"{method} {rate:.3f}" in said for method, rate in wanted.items())
    assert "SemLTL 0.675" in said and "GenZ-LTL 1.00" in said and "These figures do not compare with ours." in said


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
            gap = f"| {first} - {second} | {means[0] - means[1]:.3f} ["
            assert any(gap in line and line.endswith(f"| {how} |") for line in lines), gap
    assert anycodes.compared({first: runs[first]}, pairs) == ""


def test_only_policies_that_read_the_same_state_are_compared(tmp_path):
    config = all_runs()["any-memory-t1tl"].config
    flat = replace(config, learner=replace(config.learner, network=replace(config.learner.network, state=FlatConfig())))
    report = {"settings": {"checkpoint": "final", "episode_length": config.episode_length}, "policies": {}}
    names, runs = ("any-memory-t1tl", "any-memory-t2tl", "any-memory-gru"), {}
    for shift, (name, settings) in enumerate(zip(names, (config, flat, config), strict=True)):
        runs[name] = write(tmp_path / name, settings, seeds=(24, 25, 26))
        for policy in ("sampled", "deterministic"):
            by_seed = [
                {"seed": 24 + k} | {what: {"value": 0.1 * (k + shift)} for what in tested.FIGURES} for k in range(3)
            ]
            report["policies"][policy] = {"seeds": by_seed}
        (runs[name].path / "evaluation.json").write_text(json.dumps({"evaluations": [report]}))
    said = anymemory.memory(names, runs)
    assert "any-memory-t1tl - any-memory-gru" in said and "any-memory-t2tl" not in said.split("tells of that state")[1]
    assert "Corrected for 3 comparisons, 1 of which can be made so far." in said.replace("\n", " ")


def test_an_agent_of_waterworld_that_was_told_no_goals_is_said_to_be_one(tmp_path):
    config = all_runs()["any-water"].config
    network = replace(config.learner.network, task_encoder=LookaheadConfig())
    blind = replace(config, learner=replace(config.learner, network=network))
    for settings, told in ((config, True), (blind, False)):
        made = write(tmp_path / str(told), settings, seeds=(40, 41))
        (made.path / tested.FILE).write_text(json.dumps({"water": {"tasks": {"phi_water": figures((1.0, 0.9))}}}))
        said = anytask.tasks_of_run("any-water")({"any-water": made})
        assert ("names no goal of a chain but the last" in said) != told


def test_seeds_are_split_by_whether_training_found_the_task(tmp_path):
    rate = np.array([[0.0, 0.9], [0.0, 0.1], [0.6, 0.2]])
    made = write(tmp_path / "x", CONFIG, (0, 1, 2), iterations=2, success_rate=rate, discounted_return=rate)
    found = cells(found_or_not(made))
    assert found["more than 50% in some iteration"][0] == "2" and found["never that much"][0] == "1"


def test_the_picture_shows_what_is_stored(zones, tmp_path):
    episode = {"task": "z1", "outcome": "done", "steps": 10, "way": [[0, 0], [1, 1]], "changes": [[1, 1]]}
    episode["discs"] = [[0.5 * k - 2, 1.0] for k in range(8)]
    made = {"seed": 24, "policy": "deterministic", "episodes": [episode, episode | {"task": "s8"}]}
    content = tested.read(zones.path) | {tested.DRAWN: made}
    assert picture.of_runs({"any-zones": zones}) == {}
    (zones.path / tested.FILE).write_text(json.dumps(content))
    drawn = picture.of_runs({"any-zones": zones})[picture.ITEM]
    drawn.draw(tmp_path / "x.png")
    from experiments.reproduction.pictures import drawn as digest_of

    assert digest_of(tmp_path / "x.png") == drawn.digest()
    episode["way"] = [[0, 0], [1, 2]]
    (zones.path / tested.FILE).write_text(json.dumps(content))
    assert picture.of_runs({"any-zones": zones})[picture.ITEM].digest() != drawn.digest()


def test_runs_that_would_be_made_otherwise_today_are_named(zones):
    now = Run(zones.config)
    assert changed({"any-zones": zones}, {"any-zones": now}) == ""
    assert changed({"any-zones": zones}, {"any-zones": Run(replace(zones.config, seeds="7,"))}) == ""
    longer = Run(replace(zones.config, frames=2 * zones.config.frames))
    said = changed({"any-zones": zones, "gone": zones}, {"any-zones": longer})
    assert "not measured yet: any-zones (`frames`)." in said.replace("\n", " ")
    later = {"any-zones": longer, "after": Run(zones.config, before="any-zones")}
    said = changed({"any-zones": zones, "after": zones}, later)
    assert "after (those of any-zones, from which it starts)" in said.replace("\n", " ")


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


def test_the_script_beside_the_agent_of_waterworld_is_as_it_was_measured():
    found = json.loads((stored.REPOSITORY / "results" / "script_water.json").read_text(encoding="utf-8"))
    script = found["found"]["phi_water"]["script"]
    assert found["settings"]["radii"] == [] and found["settings"]["episodes"] >= 1000
    assert (round(script["success"], 3), round(script["length"])) == (
        published.SCRIPT_WATER.success,
        published.SCRIPT_WATER.steps,
    )
