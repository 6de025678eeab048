"""Agents for any task: what they are tested on, what is stored of it, what training met, and the page made of it."""

import gzip
import json
import shutil
import threading
from dataclasses import replace
from random import Random
from types import SimpleNamespace
from typing import Any

import jax
import numpy as np
import pytest

import t2tl_jax
import tests.fake_learner  # noqa: F401
from envs.zones import OPEN, ZoneEnv
from experiments.controls import NamesConfig, NamesTaskEncoder
from experiments.paper import fixed_set
from experiments.reproduction import stored, work
from experiments.reproduction.anytask import met, picture, suites, tested
from experiments.reproduction.anytask.suites import Suite
from experiments.reproduction.changed import changed
from experiments.reproduction.plan import Run
from experiments.reproduction.runs import all_runs
from experiments.reproduction.sections import anycodes, anymemory, anytask
from experiments.reproduction.sections.anytask import Bar
from experiments.reproduction.sections.figures import found_or_not
from t2tl_jax.ltl import Chains, Limits, compile_tasks, make_sampler, resolve_tasks
from t2tl_jax.networks.lookahead import LookaheadConfig
from t2tl_jax.networks.state_encoders import FlatConfig
from t2tl_jax.registry import make_env, named_config
from t2tl_jax.runs import config_files, interrupts
from t2tl_jax.runs.config import PoolConfig
from tests.fake_learner import CONFIG
from tests.made_up_runs import write

COLOURS = ("Blue", "Green", "Magenta", "Yellow")
FEW = 20


@pytest.fixture(scope="module")
def run():
    """A run of the fake learner that is tested on two suites, and has a certificate."""
    own = (Suite("one by one", ("F Red", "!Yellow U Black")), Suite("in turns", ("F Red",), "together"))
    return Run(CONFIG, suites=own, certified=("F Red",))


@pytest.fixture(scope="module")
def result(tmp_path_factory, run):
    """Trained and tested."""
    done = t2tl_jax.train("fake", seeds=[7, 1], folder=tmp_path_factory.mktemp("any") / "run")
    assert tested.missing(run, "smoke", done.folder) == ["one by one", "in turns", tested.CERTIFIED]
    tested.add(run, "smoke", done, ["one by one"])
    assert tested.missing(run, "smoke", done.folder) == ["in turns", tested.CERTIFIED]
    tested.add(run, "smoke", done, ["in turns", tested.CERTIFIED])
    return done


@pytest.mark.slow
def test_what_was_played_is_stored_by_seed_and_is_not_played_again(run, result):
    assert tested.is_complete(run, "smoke", result.folder) and not tested.is_complete(run, "full", result.folder)
    found = tested.read(result.folder)
    assert list(found["one by one"]["tasks"]) == ["F Red", "!Yellow U Black"]
    assert list(found["in turns"]["tasks"]) == ["F Red, all 1"]
    assert found[tested.CERTIFIED]["episodes"] == 20 and found[tested.CERTIFIED]["seed"] == 7
    for policy in ("sampled", "deterministic"):
        figures = found["one by one"]["tasks"]["F Red"][policy]
        assert set(figures) == set(tested.FIGURES) and all(len(values) == 2 for values in figures.values())
        rates = [figures[name] for name in tested.FIGURES if name.endswith("_rate")]
        np.testing.assert_allclose(np.sum(rates, axis=0), 1.0)


@pytest.mark.slow
def test_a_part_that_fails_leaves_the_others_and_none_is_begun_once_stopped(run, result, monkeypatch, tmp_path):
    def made(run, scale, result, part):
        if part == "bad":
            raise ValueError("no such part")
        return part, {"scale": scale}

    monkeypatch.setattr(tested, "_made", made)
    monkeypatch.setattr(tested, "AT_ONCE", 1)  # the one that fails comes first
    here = replace(result, folder=tmp_path)
    with pytest.raises(ValueError, match="no such part"):
        tested.add(run, "smoke", here, ["bad", "one", "two"])
    assert set(tested.read(tmp_path)) == {"one", "two"}
    tested.add(run, "smoke", here, ["three"], stopped=lambda: True)
    assert set(tested.read(tmp_path)) == {"one", "two"}


@pytest.mark.slow
@pytest.mark.parametrize("by", ["time", "signal"])
def test_a_run_that_is_stopped_while_it_is_tested_is_not_done(run, result, monkeypatch, tmp_path, by):
    """The parts come one after another, and time or a signal comes with the first."""
    deadline, stop = work.Deadline(60), interrupts.StopRequest()
    begun, release = [], threading.Event()

    def made(run, scale, result, part):
        begun.append(part)
        if by == "time":
            deadline.at = 0
        else:
            stop._event.set()
            release.wait(timeout=20)
        return part, {"scale": scale}

    monkeypatch.setattr(tested, "_made", made)
    monkeypatch.setattr(tested, "AT_ONCE", 1)
    here = replace(result, folder=tmp_path)
    said = work._test(run, SimpleNamespace(name="smoke"), here, deadline, stop)
    assert said == (work.OUT_OF_TIME if by == "time" else "stopped while testing")
    release.set()
    for thread in stop._abandoned:
        thread.join(timeout=20)
    assert begun == ["one by one"] and list(tested.read(tmp_path)) == begun


@pytest.mark.slow
def test_the_stored_figures_are_those_of_an_evaluation(result):
    report = result.evaluate(tasks=["!Yellow U Black"], episodes=2)["!Yellow U Black"]["sampled"]
    known = tested.read(result.folder)["one by one"]["tasks"]["!Yellow U Black"]["sampled"]
    assert known["violation_rate"] == [seed.violation_rate.value for seed in report.seeds]
    assert known["discounted_return"] == pytest.approx([seed.discounted_return.value for seed in report.seeds])


@pytest.mark.slow
def test_stored_tests_are_text_of_few_lines(result):
    text = (result.folder / tested.FILE).read_text(encoding="utf-8")
    assert json.loads(text) == tested.read(result.folder) and len(text.splitlines()) < FEW


def test_the_small_family_is_listed_as_a_whole():
    """36 formulas over four colours: three pairs of colours that differ, as zeroshot tests of others count them."""
    found = tested.every_task("Until_1_2_1_1", COLOURS)
    assert len(found) == len(set(found)) == 36
    assert tested.name_of_all("Until_1_2_1_1", len(found)) == anytask.UNTIL_36
    assert tested.every_task("z1", COLOURS) == list(resolve_tasks("z1").values())


def test_rows_that_exchange_their_texts_stay_what_they_are():
    table = compile_tasks(["F(Blue & F Green)"], COLOURS, "at_most_one")
    other = tested.exchanged(table)
    texts = [table.text(row) for row in range(table.num_rows)]
    shown = [other.text(row) for row in range(table.num_rows)]
    assert sorted(shown) == sorted(texts) and shown[:2] == texts[:2]
    assert all(one != another for one, another in zip(shown[2:], texts[2:], strict=True))
    np.testing.assert_array_equal(other.verdict, table.verdict)


def test_every_task_of_the_fixed_set_meets_its_own_map():
    env = ZoneEnv(replace(OPEN, physics="closed_form", pool_size=2))
    config = replace(CONFIG, limits=Limits())
    table = compile_tasks(["F Blue"], env.propositions, env.alphabet)
    given = SimpleNamespace(experiment=SimpleNamespace(env=env, config=config, table=table), seeds=(0, 1))
    tables, worlds = tested.on_maps(given, "zones", None)
    assert len(tables) == len(worlds) == 50
    reset = jax.jit(env.reset)
    for number in (0, 49):
        line = fixed_set.ZONES[number]
        seed = jax.tree.map(lambda x: x[1], worlds[number])
        state = reset(jax.random.key(3), seed).pipeline_state
        np.testing.assert_allclose(state.qpos, fixed_set.start(line), rtol=1e-6)
        np.testing.assert_allclose(state.zones, fixed_set.discs(line), rtol=1e-6)
        (row,) = np.asarray(tables[number].initial_row)
        wanted = compile_tasks([str(fixed_set.formulas("zones")[number])], env.propositions, env.alphabet)
        assert tables[number].text(int(row)) == wanted.text(int(wanted.initial_row[0]))


def test_what_training_met_is_counted_in_its_own_pools():
    config = replace(
        named_config("zones_any"),
        task=Chains((2, 2), (1, 1), (0, 1)),
        pool=PoolConfig(size=6, rows=64, period=64, finish=True, unseen="F(Blue & F Yellow)"),
    )
    tasks = ["F Blue", "F(Blue & F Yellow)", "F(Blue | Green)"]
    shares = met.shares(config, {name: [formula] for name, formula in resolve_tasks(tasks).items()})
    assert shares["renamed"] == {"F Blue": "1/1", "F(Blue & F Yellow)": "1/2", "F(Blue | Green)": "0/1"}
    exactly, renamed = met.rows_trained_on(config, make_env(config.env))
    assert shares["rows"] == {"exactly": len(exactly), "renamed": len(renamed)} and len(renamed) < len(exactly)


@pytest.mark.slow
def test_a_code_of_names_tells_rows_apart_and_is_the_same_in_every_table():
    one, two = (compile_tasks([task], COLOURS, "at_most_one") for task in ("F(Blue & F Green)", "F(Green & F Green)"))
    first, second = (np.asarray(NamesTaskEncoder(NamesConfig()).apply({}, table)) for table in (one, two))
    rows = [[table.text(row) for row in range(table.num_rows)] for table in (one, two)]
    np.testing.assert_array_equal(first[rows[0].index("F Green")], second[rows[1].index("F Green")])
    assert len({code.tobytes() for code in first}) == len(first)
    assert not np.array_equal(first[int(one.initial_row[0])], second[int(two.initial_row[0])])


@pytest.mark.slow
def test_every_run_can_draw_its_tasks():
    """Pre-trainings too: a mixture is drawn from until each of its families was."""
    for name, run in all_runs().items():
        if name.startswith("any-"):
            propositions = make_env(run.config.env).propositions
            draw, rng = make_sampler(run.config.task, propositions), Random(0)
            assert len({draw(rng) for _ in range(50)}) > 10, name


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


def test_what_longer_training_changes_needs_both_trainings(zones):
    (longer, shorter), (other, _) = anycodes.LONGER
    assert anycodes.longer_training({longer: zones, other: zones}) == ""
    said = anycodes.longer_training({longer: zones, shorter: zones, other: zones})
    assert "0.000" in said and "2 pairs cannot give a p under 0.5." in said.replace("\n", " ")
    assert "Corrected for 2 comparisons, 1 of which can be made so far." in said


def test_what_can_be_read_alone_and_what_was_met_before(zones):
    kept_out = replace(zones.config.pool, unseen="")
    (zones.path / "config.json").write_text(config_files.to_json(replace(zones.config, pool=kept_out)))
    row = cells(anycodes.read_alone({"any-pretraining-gru": stored.Stored(zones.path)}))["gru"]
    assert row[1].startswith("0.99 [") and row[2] == "not measured yet" and row[3:] == ["nothing", "4/5", "-", "-"]
    assert anycodes.read_alone({"any-zones": zones}) == ""


def test_what_an_agent_reads_is_that_of_the_pretraining_it_began_with():
    """A pre-training that was made again is another one: a GPU does not repeat it."""
    runs, results = all_runs(), stored.REPOSITORY / "results" / "any"
    pairs = [pair for pair in anycodes.READERS.items() if (results / pair[0]).is_dir()]
    assert len(pairs) >= 4
    for agent, reader in pairs:
        assert runs[agent].before == reader
        trained, taught = (json.loads((results / name / "versions.json").read_text()) for name in (agent, reader))
        assert trained["started"]["git_revision"] == taught["started"]["git_revision"], agent
        status, before = (json.loads((results / name / "status.json").read_text()) for name in (agent, reader))
        assert status["pretraining"]["training_seconds"] == before["all_sessions"]["training_seconds"], agent


def test_two_pretrainings_of_one_code_are_compared():
    names = {name for pair in anycodes.TAUGHT_MORE for name in pair}
    runs = {name: stored.Stored(stored.REPOSITORY / "results" / "any" / name) for name in names}
    lines = anycodes.read_alone(runs).splitlines()
    for more, fewer in anycodes.TAUGHT_MORE:
        line = next(line for line in lines if f"| {more} - {fewer} |" in line)
        gap = np.subtract(*(np.mean(list(anycodes._of_each_seed(runs[name]).values())) for name in (more, fewer)))
        assert f"{gap:.3f}" in line and "paired" not in line
        assert "more frames" not in anycodes.read_alone({more: runs[more]})


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


def test_few_iterations_are_kept_as_they_are(tmp_path):
    made = write(tmp_path / "run", CONFIG, seeds=(0, 1), iterations=10, success_rate=np.arange(20).reshape(2, 10) / 20)
    whole = (made.path / "metrics.csv").read_text().replace("\r\n", "\n")
    stored._copy_metrics(made.path / "metrics.csv", tmp_path / "all.csv", None)
    assert gzip.decompress((tmp_path / "all.csv.gz").read_bytes()).decode() == whole
    stored._copy_metrics(made.path / "metrics.csv", tmp_path / "few.csv", 4)
    header, *rows = gzip.decompress((tmp_path / "few.csv.gz").read_bytes()).decode().splitlines()
    assert [row.split(",")[0] for row in rows] == ["4", "4", "8", "8", "10", "10"]
    assert set(rows) < set(whole.splitlines()) and header.startswith("iteration,")


@pytest.mark.parametrize(("iterations", "many", "last"), [(1000, 29, 50), (2000, 29, 50)])
def test_of_few_iterations_the_end_is_measured_by_the_last_ones(tmp_path, iterations, many, last):
    rate = np.linspace(0, 1, iterations)[None] * [[1.0], [0.5]]
    whole = write(tmp_path / "run", CONFIG, (0, 1), iterations, success_rate=rate, target_lag=rate)
    shutil.copytree(whole.path, tmp_path / "few")
    (tmp_path / "few" / "metrics.csv").unlink()
    stored._copy_metrics(whole.path / "metrics.csv", tmp_path / "few" / "metrics.csv", stored.MOST_ITERATIONS)
    few = stored.Stored(tmp_path / "few")
    kept = np.unique(few.columns["iteration"])
    assert len(kept) == many + last and kept[-1] == iterations and (kept > 0.95 * iterations).sum() == last
    for name in ("success_rate", "target_lag"):
        assert few.end(name) == pytest.approx(whole.end(name), rel=1e-3)
        assert few.area(name) == pytest.approx(whole.area(name), abs=0.02)  # its dense end weighs no more


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
    """Formula by formula and seed by seed; seeds that do not pair are not put side by side."""
    alone = np.random.default_rng(0).uniform(size=(6, 4))
    success = {"any-pretraining-transformer": alone, "any-zones-transformer": alone / 2}

    def figures(run: SimpleNamespace) -> dict[str, Any]:
        rates = zip(suites.ZONE_Z, success[run.name], strict=True)
        return {task: {anycodes.SAMPLED: {"success_rate": values}} for task, values in rates}

    monkeypatch.setattr(anycodes, "figures", figures)
    runs: Any = {name: SimpleNamespace(name=name, seeds=(1, 2, 3, 4)) for name in success}
    said = anycodes.text_alone(runs)
    assert "transformer 1.00, 1.00." in said.replace("\n", " ")
    first = next(line for line in said.splitlines() if "beside the robot |" in line)
    assert ", ".join(f"{value:.2f}" for value in alone[2] / 2) in first.split(" | ")[4]
    assert "**not reached**" in said
    success["any-zones-transformer"] = np.full((6, 4), 0.96)
    assert "**not reached**" not in anycodes.text_alone(runs)
    runs["any-zones-transformer"].seeds = (5, 6, 7, 8)
    assert anycodes.text_alone(runs) == anycodes.text_alone({}) == ""
