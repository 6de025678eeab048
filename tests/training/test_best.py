"""Which parameters count as the best so far."""

import jax.numpy as jnp
import pytest

from t2tl_jax.training.best import keep_best
from t2tl_jax.training.types import EpisodeTotals

FRAMES = 1000


def totals(episodes: int, mean_return: float, length: float) -> EpisodeTotals:
    """Of so many episodes, of which each has this return and this length."""
    count, zero = jnp.int32(episodes), jnp.int32(0)
    whole = jnp.float32(episodes * length)
    return EpisodeTotals(count, count, zero, zero, zero, jnp.float32(episodes * mean_return), whole, whole)


def score(*of: float) -> float:
    return float(keep_best({}, totals(*of), FRAMES, {}, jnp.float32(-jnp.inf))[1])


def test_the_score_is_the_average_return_where_episodes_account_for_all_steps():
    assert score(20, 0.8, 50) == pytest.approx(0.8) == pytest.approx(score(30, 0.8, 50))


def test_robots_that_stand_still_lower_it_before_their_time_is_up():
    """Half of them end no episode, so the others' 20 episodes account for half of the steps."""
    assert score(20, 0.8, 25) == pytest.approx(0.4)
    assert score(20, 0.8, 25) < score(20, 0.7, 50)


def test_a_loss_is_none_the_smaller_for_few_episodes():
    assert score(20, -0.9, 25) == pytest.approx(-0.9)


def test_few_episodes_score_nothing():
    assert score(15, 1.0, 60) == -jnp.inf
