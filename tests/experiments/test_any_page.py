"""The page of agents for any task: what its tables say of stored figures. Of codes see `test_any_codes.py`."""

import json
from dataclasses import replace

import numpy as np
import pytest

import tests.fake_learner  # noqa: F401
from envs.zones import OPEN_6, ZoneEnv
from experiments.paper import published_any as published
from experiments.reproduction import stored
from experiments.reproduction.anytask import met, picture, suites, terms, tested
from experiments.reproduction.changed import changed
from experiments.reproduction.plan import Run
from experiments.reproduction.runs import all_runs
from experiments.reproduction.sections import anyaims, anycertified, anyfigures, anymemory, anytask
from experiments.reproduction.sections.anyaims import Bar
from experiments.reproduction.sections.figures import found_or_not
from t2tl_jax.evaluation.statistics import exact_rate, rate
from t2tl_jax.ltl import resolve_tasks
from t2tl_jax.networks.lookahead import LookaheadConfig
from t2tl_jax.networks.state_encoders import FlatConfig
from tests.any_runs import figures
from tests.fake_learner import CONFIG
from tests.made_up_runs import write
from tests.page_cells import cells


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
    assert rows["**z1 to z6**"][2].startswith("0.988 [") and rows["**z1 to z6**"][3:5] == ["[0.802, 1.000]", "0.900"]
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


def test_a_seed_that_pulls_a_mean_down_is_named(monkeypatch, tmp_path):
    made = write(tmp_path / "carried", CONFIG, (0, 1, 2, 3, 4), success_rate=0.5)
    own = {0: 0.7, 1: 0.72, 2: 0.1, 3: 0.71, 4: 0.69}
    monkeypatch.setattr(anymemory, "own_family", lambda run: own)
    runs = {"any-memory-carried": made}
    wanted = " One seed pulls the mean down of: carried seed 2 (0.100, in training 0.500; mean of the others 0.705)."
    assert anymemory._pulled(runs) == wanted
    own[2] = 0.68
    assert anymemory._pulled(runs) == ""


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


def test_the_script_beside_the_agent_of_waterworld_is_as_it_was_measured():
    found = json.loads((stored.REPOSITORY / "results" / "script_water.json").read_text(encoding="utf-8"))
    script = found["found"]["phi_water"]["script"]
    assert found["settings"]["radii"] == [] and found["settings"]["episodes"] >= 1000
    assert (round(script["success"], 3), round(script["length"])) == (
        published.SCRIPT_WATER.success,
        published.SCRIPT_WATER.steps,
    )


def test_a_cell_of_rates_over_formulas_is_no_surer_than_of_one(tmp_path):
    """Wilson's over seeds at least; of other figures Student's t alone."""

    def of(*rates):
        return {f"f{k}": {anyfigures.SAMPLED: {"success_rate": np.array(column), "success_length": np.array(column)}}
                for k, column in enumerate(rates)}  # fmt: skip

    same, near, far = of([1.0] * 3, [1.0] * 3), of([1.0] * 3, [1.0, 1.0, 0.99]), of([1.0, 0.0, 1.0], [0.0, 1.0, 0.5])
    least = rate(3, 3).low
    for one in (same, near):
        found = anyfigures.over_tasks(one, [*one], anyfigures.SAMPLED, "success_rate")
        assert found.low == pytest.approx(least, abs=0.01) and found.high == 1.0
    found = anyfigures.over_tasks(far, [*far], anyfigures.SAMPLED, "success_rate")
    by_t = anyfigures.by_tasks(far, [*far], anyfigures.SAMPLED, "success_rate")
    assert found.low <= by_t.low and found.high >= by_t.high
    steps = [
        how(near, [*near], anyfigures.SAMPLED, "success_length") for how in (anyfigures.over_tasks, anyfigures.by_tasks)
    ]
    assert steps[0] == steps[1]
