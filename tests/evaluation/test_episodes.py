import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.evaluation.curves import sparkline
from t2tl_jax.evaluation.episodes import Episodes, evaluate_seeds
from t2tl_jax.evaluation.report import summarise, table
from t2tl_jax.training.seeds import EVALUATION, TRAINING, stream_keys

sys.path.append(str(Path(__file__).parents[1] / "experiments"))
from fake_learner import SUCCESS, VIOLATION, FakeEnv, make_agent


@pytest.fixture(scope="module")
def played() -> Episodes:
    agent, seeds = make_agent(), (0, 4)
    params = jax.vmap(agent.init)(stream_keys(seeds, TRAINING)).params
    return evaluate_seeds(
        lambda seed: (FakeEnv(), agent), seeds, params, stream_keys(seeds, EVALUATION), 2000, 7, deterministic=True
    )


def test_rates_are_those_of_the_environment(played):
    report = summarise(played, (0, 4), discount=0.9)
    for seed in report.seeds:
        for estimate, truth in (
            (seed.success_rate, SUCCESS),
            (seed.violation_rate, VIOLATION),
            (seed.timeout_rate, 1 - SUCCESS - VIOLATION),
        ):
            assert estimate.count == 2000
            assert abs(estimate.value - truth) < 0.04
            assert estimate.low < estimate.value < estimate.high
        assert seed.success_length.value == 1.0
        assert seed.discounted_return.value == pytest.approx(seed.success_rate.value - seed.violation_rate.value)
    assert report.solved.value == 0.0
    assert "0 of 2 seeds solve" in table({"deterministic": report})


def test_success_is_what_the_verdict_says_whatever_the_task_pays(played):
    class PaysForViolation(FakeEnv):
        def step(self, state, action):
            state = super().step(state, action)
            return state.replace(reward=jnp.abs(state.reward), obs=state.obs + jnp.where(state.reward < 0, -2.0, 0.0))

        def verdict(self, state):
            return jnp.where(state.obs[0] < 0, -1, 1) * state.done

    agent, seeds = make_agent(), (0, 4)
    params = jax.vmap(agent.init)(stream_keys(seeds, TRAINING)).params
    keys = stream_keys(seeds, EVALUATION)
    paid = evaluate_seeds(lambda seed: (PaysForViolation(), agent), seeds, params, keys, 2000, 7, deterministic=True)
    np.testing.assert_array_equal(paid.success, played.success)
    np.testing.assert_array_equal(paid.violation, played.violation)
    assert (paid.total_reward[paid.violation] == 1).all()


def test_only_the_first_episode_counts(played):
    decided = played.success | played.violation
    assert (played.length[decided] == 1).all()
    assert (played.length[~decided] == 7).all()
    assert not (played.success & played.violation).any()
    np.testing.assert_array_equal(played.total_reward, played.success.astype(float) - played.violation)


def test_seeds_have_their_own_streams(played):
    assert (played.success[0] != played.success[1]).any()
    assert not np.array_equal(
        jax.random.key_data(stream_keys((0,), TRAINING)), jax.random.key_data(stream_keys((0,), EVALUATION))
    )


def test_discounted_return_by_hand():
    episodes = Episodes(
        success=np.array([[True, False, False]]),
        violation=np.array([[False, True, False]]),
        total_reward=np.array([[1.0, -1.0, 0.0]], np.float32),
        length=np.array([[3, 2, 5]], np.int32),
    )
    report = summarise(episodes, (0,), discount=0.5)
    assert report.seeds[0].discounted_return.value == pytest.approx((0.25 - 0.5) / 3)
    assert report.success_rate.low is None
    assert "not solved" in table({"sampled": report})


def test_sparkline():
    assert sparkline(np.array([0.0, 1.0, np.nan])) == "▁█ "
    assert len(sparkline(np.linspace(0, 1, 305))) == 32
