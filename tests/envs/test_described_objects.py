"""What environments say about their observations holds: which numbers are which object, and what it stands for."""

import jax
import jax.numpy as jnp
import numpy as np

from envs.letterworld import LetterWorld, LetterWorldConfig
from envs.waterworld import WaterWorld, WaterWorldConfig
from t2tl_jax.single_state import SingleState


def of_object(obs, objects, number):
    """The numbers of one object."""
    return np.asarray(obs)[list(objects.numbers[number])]


def test_each_ball_is_where_it_is_said_to_be_and_has_its_colour():
    env = WaterWorld(WaterWorldConfig(colours=("a", "b", "c"), events="level"))
    objects = env.objects
    assert (len(objects.numbers), objects.place, objects.numbers[-1][-1] + 1) == (6, 2, env.observation_size)
    apart = jnp.stack([jnp.linspace(20.0, 380.0, 6), jnp.full(6, 300.0)], axis=-1)
    reset = jax.jit(lambda agent: env.reset_to(agent, jnp.zeros(2), apart, jnp.zeros((6, 2))))
    for number in range(6):
        state = reset(apart[number])  # the agent stands on this ball
        np.testing.assert_array_equal(np.flatnonzero(env.labels(state)), [objects.proposition[number]])
        np.testing.assert_array_equal(of_object(state.obs, objects, number)[:2], [0, 0])
        others = [of_object(state.obs, objects, other)[0] for other in range(6) if other != number]
        expected = [(apart[other, 0] - apart[number, 0]) / 400 for other in range(6) if other != number]
        np.testing.assert_allclose(others, expected, atol=1e-6)


def test_each_lidar_shows_the_colour_it_is_said_to_show(closed_form_env):
    env, zones = closed_form_env, closed_form_env.make_params(0).zones[0]
    objects = env.objects
    assert (len(objects.numbers), objects.place) == (4, 0)
    reset = jax.jit(env.reset_to)
    seen = set()
    for centre in zones:
        state = reset(jnp.array([*centre, 0.0]), jnp.zeros(3))  # in the middle of this disc
        (colour,) = np.flatnonzero(env.labels(state))
        strongest = [of_object(state.obs, objects, number).max() for number in range(4)]
        assert objects.proposition[int(np.argmax(strongest))] == colour and max(strongest) > 0.99
        seen.add(int(colour))
    assert seen == set(range(4))


def test_each_letter_is_in_the_cells_that_are_said_to_hold_it():
    env = LetterWorld(LetterWorldConfig(pool_size=1))
    state = jax.jit(env.reset)(jax.random.key(0))
    for letter, numbers in zip(env.objects.proposition, env.objects.numbers, strict=True):
        cells = np.asarray(state.obs)[list(numbers)].reshape(7, 7)
        np.testing.assert_array_equal(cells, state.pipeline_state.seen == letter)
        assert cells.sum() == 2


def test_others_say_nothing():
    assert SingleState().objects is None
