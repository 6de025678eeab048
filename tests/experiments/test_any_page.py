"""The page of agents for any task: what its tables say of stored figures."""

import json
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import tests.fake_learner  # noqa: F401
from experiments.reproduction import stored
from experiments.reproduction.anytask import met, picture, suites, tested
from experiments.reproduction.changed import changed
from experiments.reproduction.plan import Run
from experiments.reproduction.runs import all_runs
from experiments.reproduction.sections import anycodes, anymemory, anytask
from experiments.reproduction.sections.anytask import Bar
from experiments.reproduction.sections.figures import found_or_not
from t2tl_jax.networks.lookahead import LookaheadConfig
from t2tl_jax.networks.state_encoders import FlatConfig
from t2tl_jax.runs import config_files
from tests.fake_learner import CONFIG
from tests.made_up_runs import write


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


def cells(text):
    """The cells of every row of every table, by its first one."""
    lines = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("| ")]
    return {line[0]: line[1:] for line in lines}


def test_the_page_shows_every_formula_beside_the_figures_of_others(zones):
    from experiments.reproduction.items import ITEMS

    rows = cells(ITEMS["any-open"].section({"any-zones": zones}))
    assert rows["z1"][:2] == ["3/5", "4/5"] and rows["z2"][:2] == ["-", "-"]
    assert rows["z6"][2].startswith("0.950 [") and rows["z6"][3] == "0.900"
    assert rows["z1"][-4:] == ["0.975, 314", "0.922, 303", "0.940, 470", "0.595, 424"]
    assert rows["**z1 to z6**"][2].startswith("0.988 [") and rows["**z1 to z6**"][3] == "0.900"
    asked = {name: row for name, row in rows.items() if row[-1] in ("reached", "**not reached**")}
    assert asked["success, worst seed and formula of z1 to z6"] == ["at least 0.97", "0.900 (z6)", "**not reached**"]
    assert asked["steps, mean of z1 to z6"][-1] == "reached" and len(asked) == 4  # of the rest nothing was played
    assert ITEMS["any-open"].section({}) == ""


def test_bars_are_reached_or_not():
    of = {"a": figures((1.0, 0.9)), "b": figures((0.98, 0.98))}

    def said(**bar):
        return cells(anytask.verdicts(of, [Bar("x", ("a", "b"), **bar)]))["x"][-2:]

    assert said(least=0.96)[1] == "reached" and said(least=0.97)[1] == "**not reached**"
    assert said(least=0.95, over="task") == ["0.950 (a)", "reached"]
    assert said(least=0.95, over="worst") == ["0.900 (a)", "**not reached**"]
    assert said(most=150, figure="success_length")[1] == "reached"
    assert anytask.verdicts(of, [Bar("x", ("a", "c"), least=0.1)]) == ""


def test_levels_show_codes_side_by_side_and_what_was_not_played(zones):
    row = cells(anycodes.levels({"any-zones-transformer": zones}))["transformer"]  # of the last table, the costs
    heading = ["state", "training", "same family", *anycodes.LEVELS]
    assert row == ["2", *anytask.cost(zones)]
    table = anycodes.levels({"any-zones-transformer": zones}).split("\n\n")[0]
    shown = dict(zip(heading, cells(table)["transformer"], strict=True))
    assert shown["state"] == "merged" and shown["z1 to z6"].startswith("0.99 [") and shown["deeper"] == "-"
    assert shown["texts exchanged"].startswith("0.10")


def test_what_can_be_read_alone_and_what_was_met_before(zones):
    kept_out = replace(zones.config.pool, unseen="")
    (zones.path / "config.json").write_text(config_files.to_json(replace(zones.config, pool=kept_out)))
    row = cells(anycodes.read_alone({"any-pretraining-gru": stored.Stored(zones.path)}))["gru"]
    assert row[2].startswith("0.99 [") and row[3] == "not measured yet" and row[4:] == ["nothing", "4/5", "-", "-"]
    pools = -(-zones.config.iterations // zones.config.pool.period)
    assert row[0] == f"{pools * zones.config.pool.size:,}"
    assert anycodes.read_alone({"any-zones": zones}) == ""


def test_what_an_agent_reads_is_that_of_the_pretraining_it_began_with():
    """A pre-training that was made again is another one: a GPU does not repeat it."""
    runs, results = all_runs(), stored.REPOSITORY / "results" / "any"
    pairs = [(name, run.before) for name, run in runs.items() if name.startswith("any-") and run.before is not None]
    assert len(pairs) >= 8 and anycodes.READERS.items() <= set(pairs)
    measured = [pair for pair in pairs if all((results / name / "versions.json").exists() for name in pair)]
    assert len(measured) >= 8 and len({agent for agent, _ in measured} & set(anycodes.READERS)) >= 4
    for agent, reader in measured:
        trained, taught = (json.loads((results / name / "versions.json").read_text()) for name in (agent, reader))
        assert trained["started"]["git_revision"] == taught["started"]["git_revision"], agent
        status, before = (json.loads((results / name / "status.json").read_text()) for name in (agent, reader))
        assert status["pretraining"]["training_seconds"] == before["all_sessions"]["training_seconds"], agent


def test_learned_codes_stand_against_the_one_that_is_read_off_the_table():
    names = {name for pair in anycodes.AGAINST_TABLE for name in pair}
    runs = {name: stored.Stored(stored.REPOSITORY / "results" / "any" / name) for name in names}
    lines = anycodes.against_table(runs).splitlines()
    for tasks in (suites.ZONE_Z, suites.ZONE_HARD):
        for first, second in anycodes.AGAINST_TABLE:
            means = [np.mean(list(anycodes._of_each_seed(runs[name], tasks).values())) for name in (first, second)]
            gap = f"| {first} - {second} | {means[0] - means[1]:.3f} ["
            assert any(gap in line and "paired" in line for line in lines), gap
    assert anycodes.against_table({first: runs[first]}) == ""


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
    agent, reader = next(iter(anycodes.READERS.items()))
    alone = np.random.default_rng(0).uniform(0.0, 0.9, (len(asked), 4))
    alone[0] = 1.0
    success = {reader: alone, agent: alone / 2}

    def figures(run: SimpleNamespace) -> dict[str, Any]:
        rates = zip(asked, success[run.name], strict=True)
        return {
            task: {anycodes.SAMPLED: {"success_rate": values, "success_length": 10 * values}} for task, values in rates
        }

    monkeypatch.setattr(anycodes, "figures", figures)
    monkeypatch.setattr(anycodes, "own_family", lambda run: dict.fromkeys(run.seeds, 0.25) if families else {})
    families = True
    runs: Any = {name: SimpleNamespace(name=name, seeds=(1, 2, 3, 4), end=lambda what: {1: 0.5}) for name in success}
    said = anycodes.text_alone(runs)
    assert "had not met: transformer 0.500, 0.250." in said and "are: transformer 0.500 (4 of 60)." in said
    families = False
    assert "family" not in anycodes.text_alone(runs)
    first = next(line for line in said.splitlines() if "beside the robot |" in line)
    assert first.split(" | ")[3] == f"{alone[1].mean() / 2:.2f} ({alone[1].min() / 2:.2f})"
    alone_steps = next(line for line in said.splitlines() if "read alone, steps |" in line)
    assert alone_steps.split(" | ")[3] == f"{10 * alone[1].mean():.1f}"
    assert "**not reached**" in said
    success[agent] = np.full((len(asked), 4), 0.96)
    assert "**not reached**" not in anycodes.text_alone(runs)
    runs[agent].seeds = (5, 6, 7, 8)
    assert anycodes.text_alone(runs) == anycodes.text_alone({}) == ""
