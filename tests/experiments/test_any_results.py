"""Agents for any task: what they are tested on, what is stored of it, and what training met."""

import gzip
import json
import shutil
import threading
from dataclasses import replace
from random import Random
from types import SimpleNamespace

import jax
import numpy as np
import pytest

import t2tl_jax
import tests.fake_learner  # noqa: F401
from envs.zones import OPEN, OPEN_6, ZoneEnv
from experiments.controls import NamesConfig, NamesTaskEncoder
from experiments.paper import fixed_set
from experiments.reproduction import stored, work
from experiments.reproduction.anytask import met, tested
from experiments.reproduction.anytask.suites import Suite
from experiments.reproduction.plan import Run
from experiments.reproduction.runs import all_runs
from experiments.reproduction.sections import anytask
from t2tl_jax.ltl import Chains, Limits, compile_tasks, make_sampler, resolve_tasks
from t2tl_jax.registry import make_env, named_config
from t2tl_jax.runs import interrupts
from t2tl_jax.runs.config import PoolConfig
from t2tl_jax.runs.prompt import Prompt
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
    found = {"F Blue": "1/1", "F(Blue & F Yellow)": "1/2", "F(Blue | Green)": "0/1"}
    assert shares["renamed"] == found | {met.OWN: shares["renamed"][met.OWN]}
    exactly, renamed = met.rows_trained_on(config, make_env(config.env))
    assert shares["rows"] == {"exactly": len(exactly), "renamed": len(renamed)} and len(renamed) < len(exactly)
    own, (some, rows) = shares["own"], map(int, shares["renamed"][met.OWN].split("/"))
    assert own["formulas"] == 6 and own["exactly"] == 0 and own["renamed"] > 0 and 0 < some <= rows
    assert own["renamed"] + own["without a row met"] <= own["formulas"]


def test_what_training_met_is_counted_in_other_worlds_too():
    """A row that reads no more colours than there were may have been met under other names."""
    config = replace(
        named_config("zones_any"),
        task=Chains((1, 1), (1, 1), (0, 1)),
        pool=PoolConfig(size=6, rows=64, period=64, finish=True),
    )
    more = Suite("six colours", ("F Blue", "F Red", "F(Red & F Cyan)", "F(Red | Cyan)"), env=OPEN_6)
    shares = met.shares(config, {}, met._elsewhere((more, Suite("here", ("F Green",)))))
    names = [f"{task} (six colours)" for task in more.tasks]
    assert [shares["renamed"][name] for name in names] == ["1/1", "1/1", "1/2", "0/1"]
    assert [shares["exactly"][name] for name in names[1:]] == ["0/1", "0/2", "0/1"]
    assert set(shares["renamed"]) == {*names, met.OWN}


def test_of_a_run_on_one_task_nothing_is_counted(tmp_path):
    met.keep(write(tmp_path / "one", CONFIG).path, ())
    assert not (tmp_path / "one" / met.FILE).exists()
    met.keep(tmp_path, ())
    assert met.read(tmp_path)["rows"] == {}


@pytest.mark.slow
def test_a_stored_agent_acts_at_once_on_a_formula_that_is_typed():
    """Asked for are 5 ms to the first action after warming up; four times that, for machines that others use too."""
    prompt = Prompt(t2tl_jax.load(stored.REPOSITORY / "results" / "any" / "any-zones"), episode_length=8)
    prompt.play("z1")
    formulas = ("z2", "z3", "z4", "z5", "z6", "F Blue", "F(Green & F Blue)", "!Blue U Green", "F Blue & F Yellow")
    played = [prompt.play(formula) for formula in formulas]
    assert not any(one.is_new_shape for one in played)
    assert np.median([one.action_ms for one in played]) < 20


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
