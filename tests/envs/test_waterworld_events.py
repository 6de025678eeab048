"""When a touch becomes a label: onset or level, at once or one step late."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from envs.waterworld import WaterWorld, WaterWorldConfig


@pytest.fixture(scope="module", params=[(e, d) for e in ("onset", "level") for d in (0, 1)], ids=str)
def env(request) -> WaterWorld:
    events, delay = request.param
    return WaterWorld(WaterWorldConfig(colours=("Red", "Blue"), events=events, delay=delay))


def labels_over_time(env, agent, balls, velocities, actions):
    """Labels of the first state and of the state after each action: ``[1 + steps, P]``."""

    @jax.jit
    def run(agent, balls, velocities, actions):
        def step(state, action):
            state = env.step(state, action)
            return state, env.labels(state)

        state = env.reset_to(agent, jnp.zeros(2), balls, velocities)
        return env.labels(state), jax.lax.scan(step, state, actions)[1]

    first, later = run(*map(jnp.array, (agent, balls, velocities, actions)))
    return np.array([first, *later])


def approach(gap):
    """A red ball this far to the right of the agent, flying towards it; the others far away and at rest."""
    balls = [(200.0 + gap, 200.0), (50.0, 350.0), (350.0, 50.0), (350.0, 350.0)]
    return (200.0, 200.0), balls, [(-30.0, 0.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0)]


def test_the_measured_example_of_the_original():
    """At rest, a ball 31 away at 30 units/s: distance 28, then 25; the original reports it with the second step."""
    late = WaterWorld(WaterWorldConfig(colours=("Red", "Blue"), delay=1))
    assert labels_over_time(late, *approach(31.0), [0, 0, 0])[:, 0].tolist() == [False, False, True, False]
    prompt = WaterWorld(WaterWorldConfig(colours=("Red", "Blue")))
    assert labels_over_time(prompt, *approach(31.0), [0, 0, 0])[:, 0].tolist() == [False, True, False, False]


def test_onset_level_and_delay(env):
    """The ball passes through the agent: 31 - 3 k is the distance after k steps, in contact for k = 1 to 20."""
    steps = np.arange(31)
    contact = np.abs(31 - 3 * steps) <= 30
    onset = contact & ~np.roll(contact, 1)
    expected = onset if env.config.events == "onset" else contact
    if env.config.delay:
        expected = np.roll(expected, 1)
    found = labels_over_time(env, *approach(31.0), [0] * 30)
    np.testing.assert_array_equal(found[:, 0], expected)
    assert not found[:, 1].any()


def test_contact_at_the_start_is_no_onset(env):
    found = labels_over_time(env, *approach(10.0), [0, 0, 0])[:, 0].tolist()
    level = env.config.events == "level"
    assert found == ([not env.config.delay] + [True] * 3 if level else [False] * 4)


def test_leaving_and_returning_is_another_onset():
    env = WaterWorld(WaterWorldConfig(colours=("Red",), balls_per_colour=1))
    # The agent drives away from a ball at rest, turns and comes back.
    actions = [4, 2, 2, 0, 0]  # distance 32, 32, 29, 26, 23
    found = labels_over_time(env, (100.0, 200.0), [(129.0, 200.0)], [(0.0, 0.0)], actions)
    assert found[1:, 0].tolist() == [False, False, True, False, False]


def test_touching_counts():
    env = WaterWorld(WaterWorldConfig(events="level", colours=("Red",), balls_per_colour=1))

    def label(distance):
        balls = jnp.array([[200.0, 100.0 + distance]])
        return bool(env.labels(env.reset_to(jnp.array([200.0, 100.0]), jnp.zeros(2), balls, jnp.zeros((1, 2))))[0])

    assert label(30.0) and not label(30.001)


def test_two_colours_at_once_and_two_balls_of_one_colour():
    env = WaterWorld(WaterWorldConfig(colours=("Red", "Blue", "Gray")))
    balls = [(168.0, 200.0), (232.0, 200.0), (200.0, 232.0), (50.0, 50.0), (350.0, 350.0), (350.0, 50.0)]
    velocities = [(30.0, 0.0), (-30.0, 0.0), (0.0, -30.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0)]
    found = labels_over_time(env, (200.0, 200.0), balls, velocities, [0, 0])
    assert env.alphabet == "every_subset"
    assert found[1:].tolist() == [[True, True, False], [False, False, False]]


def test_delay_only_shifts():
    """Over a long random episode the late labels are the prompt ones, one step later, and nothing else differs."""
    prompt, late = (WaterWorld(WaterWorldConfig(delay=delay)) for delay in (0, 1))
    actions = jax.random.randint(jax.random.key(0), (500,), 0, 5)

    def run(env):
        def step(state, action):
            state = env.step(state, action)
            return state, (env.labels(state), state.obs)

        return jax.jit(lambda key: jax.lax.scan(step, env.reset(key), actions)[1])(jax.random.key(0))

    (now, obs), (later, obs_late) = run(prompt), run(late)
    assert now.any(axis=0).all()
    np.testing.assert_array_equal(later[1:], now[:-1])
    assert not later[0].any()
    np.testing.assert_array_equal(obs, obs_late)
