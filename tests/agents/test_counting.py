"""How far a run has come, against whole numbers of Python, which do not overflow."""

from fractions import Fraction

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from t2tl_jax.agents import counting
from t2tl_jax.agents.dqn import epsilon
from t2tl_jax.agents.dqn_config import DQNConfig

MOST = 2**31 - 1
COUNTS = st.one_of(st.integers(1, MOST), st.integers(1, 10**4), st.integers(MOST - 100, MOST))


@settings(max_examples=60, deadline=None)
@given(COUNTS, COUNTS, COUNTS)
def test_a_product_beyond_32_bits_is_exact_modulo_another_number(number, factor, modulus):
    found = counting.product_modulo(jnp.int32(number), factor, modulus)
    assert found.dtype == jnp.int32 and int(found) == number * factor % modulus


@settings(max_examples=60, deadline=None)
@given(COUNTS, COUNTS, COUNTS, st.integers(0, MOST), st.sampled_from((-1, 0, 1, None)))
def test_a_step_is_reached_when_it_is(iteration, length, place, bound, aside):
    """Also right before it, on it and right behind it."""
    place %= length
    if aside is not None:
        bound = min(max(iteration * length + place + aside, 0), MOST)
    found = counting.has_reached(jnp.int32(iteration), jnp.int32(place), length, bound)
    assert bool(found) == (iteration * length + place >= bound)


def test_a_run_that_can_be_counted_has_its_schedule_to_the_last_bit():
    """That of a program that multiplies whole numbers, as all did before; up to the longest that one can count."""
    config = DQNConfig(epsilon_fraction=0.3)
    for iterations, length in ((750, 500), (16_777, 1_000), (MOST // 2_000, 2_000), (MOST // 64, 64)):
        total = iterations * length

        @jax.jit
        def both(iteration, place, length=length, total=total):
            now = counting.before(iteration, length, total) + place
            counted = iteration * length + place
            return now, counted, epsilon(config, now / float(total)), epsilon(config, counted / total)

        draw = np.random.default_rng(iterations)
        for at in (0, iterations - 1, *draw.integers(iterations, size=20)):
            now, counted, *shares = both(jnp.int32(at), jnp.int32(draw.integers(length)))
            assert now.dtype == jnp.int32 and now == counted and shares[0] == shares[1]


@pytest.mark.parametrize("frames", [2**31 + 10_000, 10**10, 10**12])
def test_the_share_of_a_longer_run_is_right_to_a_millionth(frames):
    length = 2_000
    iterations = frames // length
    for iteration in (0, 1, iterations // 3, iterations - 1):
        steps = counting.before(jnp.int32(iteration), length, frames) + jnp.int32(1_999)
        share = float(steps / float(frames))
        assert share == pytest.approx(float(Fraction(iteration * length + 1_999, frames)), rel=1e-6)
