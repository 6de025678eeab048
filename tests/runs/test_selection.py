"""The best parameters: chosen at points of the run, by episodes of their own, the same after an interruption."""

import dataclasses

import jax
import numpy as np
import pytest

import t2tl_jax
from t2tl_jax.runs import selection
from t2tl_jax.runs.config import RunConfig, SelectionConfig
from t2tl_jax.runs.convergence import ConvergenceConfig
from t2tl_jax.runs.selection import Scores, Selected, Selection
from tests import fake_learner
from tests.fake_runs import StopAfter

pytestmark = pytest.mark.slow  # nearly every test compiles a training or an evaluation

CONFIG = dataclasses.replace(fake_learner.CONFIG, seeds="2", selection=SelectionConfig())  # 100 frames an iteration


def config(iterations, **changes):
    return dataclasses.replace(CONFIG, frames=100 * iterations, **changes)


# ----- points and choices -----


@pytest.mark.parametrize(
    ("iterations", "count", "expected"),
    [(100, 10, range(55, 101, 5)), (7, 3, (5, 6, 7)), (7, 10, (4, 5, 6, 7)), (3, 1, (3,)), (1, 10, (1,)), (9, 0, ())],
)
def test_points_are_spread_over_the_second_half(iterations, count, expected):
    assert tuple(selection.points(config(iterations, selection=SelectionConfig(points=count)))) == tuple(expected)


@pytest.mark.parametrize("window", [0, 2])
def test_no_more_points_are_looked_at_than_there_are_iterations(window):
    asked = {"convergence": ConvergenceConfig(window=window), "selection": SelectionConfig(points=10**9)}
    assert tuple(selection.points(config(6, **asked))) == ((1, 2, 3, 4, 5, 6) if window else (4, 5, 6))
    assert selection.points(config(2 * 10**6, **asked))[-1] == 2 * 10**6


def test_a_run_that_may_converge_has_points_in_its_first_half_too():
    early = config(100, convergence=ConvergenceConfig(window=5), selection=SelectionConfig(points=2))
    assert selection.points(early) == (25, 50, 75, 100)


def scores(returns, rates=(0.0, 0.0)):
    return Scores(np.array(returns, float), np.array(rates, float))


def test_every_seed_keeps_its_best_by_return_then_success_then_time():
    kept = Selection(config(10))
    for iteration, gained, rates in (
        (6, (0.5, 0.2), (0.5, 0.5)),
        (7, (0.4, 0.2), (1.0, 0.4)),
        (8, (0.5, 0.2), (0.5, 0.5)),
    ):
        kept.add(iteration, {"w": np.full((2, 3), iteration)}, scores(gained, rates))
    assert kept.best.iteration.tolist() == [8, 8] and kept.best.params["w"][:, 0].tolist() == [8, 8]
    kept.add(9, {"w": np.full((2, 3), 9)}, scores((0.6, 0.1)))
    assert kept.best.iteration.tolist() == [9, 8] and kept.best.params["w"][:, 0].tolist() == [9, 8]
    last = kept.with_last(10, {"w": np.full((2, 3), 10)}, scores((0.1, 0.3)))
    assert last.iteration.tolist() == [9, 10] and kept.best.iteration.tolist() == [9, 8]
    again = Selected.of(last.params, last.info())
    jax.tree.map(np.testing.assert_array_equal, again.info(), last.info())


def test_what_is_selected_is_a_copy():
    """Training goes on in the memory of the parameters."""
    params, kept = {"w": np.zeros((2, 3))}, Selection(config(10))
    kept.add(6, params, scores((1.0, 1.0)))
    params["w"] += 1
    assert (kept.best.params["w"] == 0).all()


def test_one_point_alone_needs_no_score_and_what_lies_before_the_first_point_is_forgotten():
    single = config(10, selection=SelectionConfig(points=1))
    assert not any(Selection(single).is_near(iteration) for iteration in range(11))
    earlier = Selected({"w": np.zeros((2, 3))}, scores((1.0, 1.0)), np.array([4, 8]))
    assert Selection(config(8), dataclasses.replace(earlier, iteration=np.array([5, 8]))).best is not None
    assert Selection(config(8), earlier).best is None
    assert not Selection(config(9, selection=SelectionConfig(points=0))).is_near(9)
    assert [Selection(config(10)).is_near(iteration) for iteration in (1, 2, 3, 10)] == [False, False, True, True]


# ----- in a run -----


@pytest.fixture
def scored(monkeypatch):
    """Scores without playing, which jump from one set of parameters to the next; lists what was scored."""
    asked: list[int] = []

    class Jumping:
        thread = None

        def __init__(self, experiment):
            pass

        def check(self):
            pass

        def __call__(self, params):
            asked.append(len(asked))
            value = np.sin(40 * np.asarray(params["params"]["w"]).sum((1, 2)))
            return Scores(value, np.zeros_like(value))

    monkeypatch.setattr("t2tl_jax.runs.training.Scorer", Jumping)
    return asked


def same(one, other):
    jax.tree.map(np.testing.assert_array_equal, one, other)


def test_an_interrupted_run_goes_on_to_what_an_uninterrupted_one_selects(scored, tmp_path):
    whole = t2tl_jax.train(config(12))
    assert len(scored) == 6  # iterations 7 to 12
    assert any((a != b).any() for a, b in zip(*map(jax.tree.leaves, whole.params.values()), strict=True))

    stopped = t2tl_jax.train(config(12), folder=tmp_path / "run", callbacks=[StopAfter(9)])
    same(t2tl_jax.load(tmp_path / "run").params, stopped.params)
    same(t2tl_jax.resume(tmp_path / "run").params, whole.params)
    same(t2tl_jax.load(tmp_path / "run").params, whole.params)


def test_a_run_that_ends_early_counts_its_last_parameters_for_itself_only(scored, tmp_path):
    wide = dataclasses.replace(config(40), selection=SelectionConfig(points=2))  # after 30 and 40
    stopped = t2tl_jax.train(wide, folder=tmp_path / "run", callbacks=[StopAfter(33)])
    assert len(scored) == 2  # after 30 and 33
    same(t2tl_jax.load(tmp_path / "run").params, stopped.params)
    whole = t2tl_jax.train(wide)
    same(t2tl_jax.resume(tmp_path / "run").params, whole.params)


def test_a_longer_run_equals_one_that_was_long_from_the_start(scored, tmp_path):
    t2tl_jax.train(config(6), folder=tmp_path / "run")
    same(t2tl_jax.resume(tmp_path / "run", frames=1200).params, t2tl_jax.train(config(12)).params)


def test_without_points_the_final_parameters_are_the_best(scored):
    run = t2tl_jax.train(config(4, selection=SelectionConfig(points=0)))
    same(run.params["final"], run.params["best"])
    assert scored == []
    with pytest.raises(t2tl_jax.UserError, match="parameters final and best, got which='latest'"):
        run.policy(which="latest")


def test_episodes_of_selection_are_not_those_of_training_or_evaluation(monkeypatch):
    """The real scorer: its keys, its parameters of the environment, and what comes out."""
    asked: list[str] = []
    make = fake_learner.FakeEnv.make_params

    def remembering(self, seed, purpose="training"):
        asked.append(purpose)
        return make(self, seed, purpose)

    monkeypatch.setattr(fake_learner.FakeEnv, "make_params", remembering)
    run = t2tl_jax.train(config(4, selection=SelectionConfig(episodes=64)))
    assert asked.count("selection") == 2
    found = selection.Scorer(run.experiment)(run.params["final"])
    assert found.success_rate.shape == (2,) and ((found.success_rate > 0.1) & (found.success_rate < 0.9)).all()
    assert len(set(found.discounted_return)) == 2  # each seed has keys of its own


@pytest.mark.parametrize("make", [lambda n: SelectionConfig(episodes=n), lambda n: RunConfig(evaluation_episodes=n)])
def test_episodes_that_are_played_side_by_side_are_bounded(make):
    make(1_000_000)
    with pytest.raises(ValueError, match=r"episodes must be at most 1,000,000, since all .* got 2,000,000,000"):
        make(2_000_000_000)
