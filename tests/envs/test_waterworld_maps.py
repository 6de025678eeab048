"""Where episodes start: numbered maps, the pool, maps drawn in JAX, and sizes that differ within a batch."""

import dataclasses
from typing import get_args

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from envs.waterworld import LETTERS, WaterWorld, WaterWorldConfig
from t2tl_jax.env import Purpose
from t2tl_jax.registry import make_env
from tests.envs.waterworld_reference import published_map

MANY = 512


def starts_of(env, count=MANY, params=None):
    return jax.jit(jax.vmap(env.reset, in_axes=(0, None)))(jax.random.split(jax.random.key(0), count), params)


@pytest.mark.parametrize(("number", "agent"), [(0, (342.43608506, 310.44312909)), (1, (79.71477032, 343.55048267))])
def test_agents_of_published_maps(number, agent):
    state = make_env(f"Water-M{number}-v0").reset(jax.random.key(0)).pipeline_state
    np.testing.assert_allclose(state.agent_position, agent, rtol=1e-7)
    np.testing.assert_array_equal(state.agent_velocity, 0)


@pytest.mark.parametrize("colours", [LETTERS, WaterWorldConfig().colours, ("Red",)])
@pytest.mark.parametrize("number", [0, 7, 123])
def test_numbered_maps_follow_the_rule_of_the_original(colours, number):
    agent, balls, velocities = published_map(number, 2 * len(colours))
    env = WaterWorld(WaterWorldConfig(colours=colours, map_number=number))
    for key in (0, 1):  # every episode starts the same
        state = env.reset(jax.random.key(key)).pipeline_state
        np.testing.assert_allclose(state.agent_position, agent, rtol=1e-7)
        np.testing.assert_allclose(state.ball_positions, balls, rtol=1e-7)
        np.testing.assert_allclose(state.ball_velocities, velocities, atol=3e-6)


def test_pool_holds_numbered_maps():
    env = WaterWorld(WaterWorldConfig(layout="random", pool_size=3))
    agents = np.unique(starts_of(env).pipeline_state.agent_position, axis=0)
    expected = np.array([published_map(number, 16)[0] for number in range(3)])
    np.testing.assert_allclose(agents, expected[np.argsort(expected[:, 0])], rtol=1e-7)


@pytest.mark.parametrize("pool_size", [256, 0])
@pytest.mark.parametrize("large", [15.0, 37.5])
def test_random_starts_keep_their_distances(pool_size, large):
    radii = (15.0,) * 5 + (large,) * 3
    env = WaterWorld(WaterWorldConfig(layout="random", pool_size=pool_size, radii=radii))
    state = starts_of(env).pipeline_state
    size = np.repeat(radii, 2)
    balls = np.asarray(state.ball_positions, np.float64)
    first, second = np.triu_indices(16, 1)
    between = np.linalg.norm(balls[:, first] - balls[:, second], axis=-1)
    assert (between >= size[first] + size[second] - 1e-3).all()
    to_agent = np.linalg.norm(balls - state.agent_position[:, None], axis=-1)
    assert (to_agent > 2 * (size + 15) - 1e-3).all()
    assert (balls >= 2 * size[:, None]).all() and (balls <= 400).all() and (balls > 385).any()
    np.testing.assert_allclose(np.linalg.norm(state.ball_velocities, axis=-1), 30, rtol=1e-5)
    assert not state.contact.any() and not state.agent_velocity.any()


def test_radii_differ_on_the_same_drawn_maps():
    """Drawn for the largest, so that the radius is all that differs; none of the balls then begins in touch."""
    largest = (15.0,) * 5 + (37.5,) * 2 + (15.0,)

    def world(scale, **more):
        radii = (15.0,) * 5 + (15.0 * scale,) * 2 + (15.0,)
        return WaterWorld(WaterWorldConfig(layout="random", pool_size=0, radii=radii, **more))

    own = world(2.5)
    reset = jax.jit(jax.vmap(own.reset, in_axes=(0, None)))  # which takes all that differs from the parameters
    keys = jax.random.split(jax.random.key(0), 16)
    expected = reset(keys, own.make_params(0))
    for scale in (1.0, 1.5, 2.5):
        params = world(scale, map_radii=largest).make_params(0)
        np.testing.assert_array_equal(params.ball_radius[4:], np.float32([15, 15 * scale, 15 * scale, 15]))
        state = reset(keys, params)
        np.testing.assert_array_equal(state.obs, expected.obs)
        assert not state.pipeline_state.contact.any()
    assert (reset(keys, world(1.0).make_params(0)).obs != expected.obs).any()


@pytest.mark.slow
def test_drawn_maps_are_distributed_like_numbered_ones():
    """Means and spreads over many maps, for the first and the last ball, which the earlier ones push around."""
    drawn = starts_of(WaterWorld(WaterWorldConfig(layout="random", pool_size=0)), 4096).pipeline_state
    maps = [published_map(number, 16) for number in range(1000)]
    for ours, theirs in (
        (drawn.agent_position, [m[0] for m in maps]),
        (drawn.ball_positions[:, 0], [m[1][0] for m in maps]),
        (drawn.ball_positions[:, 15], [m[1][15] for m in maps]),
        (drawn.ball_velocities[:, 3], [m[2][3] for m in maps]),
    ):
        ours, theirs = np.asarray(ours), np.array(theirs)
        error = theirs.std(axis=0) * np.sqrt(1 / len(ours) + 1 / len(theirs))
        assert (np.abs(ours.mean(axis=0) - theirs.mean(axis=0)) < 4 * error).all()
        np.testing.assert_allclose(ours.std(axis=0), theirs.std(axis=0), rtol=0.08)


@pytest.mark.slow
def test_parameters_can_differ_within_a_batch():
    """Radius, speeds and arena of each environment its own; each equals an environment built with these numbers."""
    radii = jnp.array([15.0, 22.5, 37.5])
    base = WaterWorld(WaterWorldConfig(layout="random", pool_size=0))
    sizes = jax.tree.map(jnp.asarray, base.make_params(0))
    batch = jax.vmap(
        lambda radius: dataclasses.replace(
            sizes,
            ball_radius=sizes.ball_radius.at[5:].set(radius),
            ball_speed=radius,
            velocity_limit=4 * radius,
            arena=jnp.array([400.0, 500.0]) + radius,
        )
    )(radii)
    keys = jax.random.split(jax.random.key(3), 3)
    actions = jax.random.randint(jax.random.key(4), (40, 3), 0, 5)

    def rollout(states, actions):
        return jax.lax.scan(lambda s, a: (jax.vmap(base.step)(s, a, batch), None), states, actions)[0]

    together = jax.jit(rollout)(jax.jit(jax.vmap(base.reset))(keys, batch), actions)
    for i, radius in enumerate(np.asarray(radii).tolist()):
        config = dataclasses.replace(
            base.config,
            radii=(15.0,) * 5 + (radius,) * 3,
            ball_speed=radius,
            velocity_limit=4 * radius,
            arena=(400.0 + radius, 500.0 + radius),
        )
        env = WaterWorld(config)
        state, step = jax.jit(env.reset)(keys[i]), jax.jit(env.step)
        for action in actions[:, i]:
            state = step(state, action)
        np.testing.assert_allclose(together.obs[i], state.obs, atol=2e-5)
        np.testing.assert_array_equal(together.pipeline_state.contact[i], state.pipeline_state.contact)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"layout": "map"}, "layout is 'map'"),
        ({"events": "contact"}, "must be 'onset' or 'level'"),
        ({"delay": 2}, "delay is 2"),
        ({"colours": ()}, "one or more different names"),
        ({"colours": ("Red", "Red")}, "one or more different names"),
        ({"balls_per_colour": 0}, "at least one ball"),
        ({"map_number": -1}, "map_number is -1; maps are numbered from 0"),
        ({"pool_size": -1}, "0 \\(no pool\\) or more"),
        ({"radii": (15.0,)}, "radii has 1 entries for 8 colours"),
        ({"map_radii": (15.0,)}, "map_radii has 1 entries for 8 colours"),
        ({"map_radii": (200.0,) * 8}, "does not fit"),
        ({"time_step": 0.0}, "must be positive"),
        ({"ball_speed": -1.0}, "must not be negative"),
        ({"velocity_limit": 0.0}, "velocity_limit is 0"),
        ({"agent_radius": 300.0}, "does not fit"),
        ({"balls_per_colour": 40}, "320 balls with radii 15 to 15 cannot be placed"),
    ],
)
def test_errors_say_what_is_wrong(changes, message, monkeypatch):
    monkeypatch.setattr("envs.waterworld.maps.RESTARTS", 1)
    with pytest.raises(ValueError, match=message):
        WaterWorld(WaterWorldConfig(**changes))


def test_maps_by_seed_are_the_numbered_maps():
    env = WaterWorld(WaterWorldConfig(colours=LETTERS, layout="by_seed", pool_size=12, delay=1))
    both = jax.tree.map(lambda *x: np.stack(x), env.make_params(3), env.make_params(10, "evaluation"))
    states = jax.jit(jax.vmap(env.reset, (None, 0)))(jax.random.key(0), both)
    for index, number in enumerate((3, 10)):
        alone = make_env(f"Water-M{number}-v0").reset(jax.random.key(1))
        # One is compiled and the other is not, which may round the last bit of a number up to 1 differently.
        np.testing.assert_allclose(states.obs[index], alone.obs, rtol=0, atol=3e-7)


def test_seeds_without_a_map_are_refused():
    env = WaterWorld(WaterWorldConfig(layout="by_seed", pool_size=3))
    assert env.make_params(2).starts.agent.shape == (1, 2)
    with pytest.raises(ValueError, match=r"seed 3 has no map: env.pool_size=3 maps serve the seeds 0 to 2"):
        env.make_params(3)
    with pytest.raises(ValueError, match="not negative, got -1"):
        env.make_params(-1)


def test_every_seed_has_random_maps_of_its_own_and_evaluation_others():
    env = WaterWorld(WaterWorldConfig(layout="random", pool_size=3))
    pools = [env.make_params(seed, purpose).starts for seed in (0, 1) for purpose in get_args(Purpose)]
    agents = np.concatenate([pool.agent for pool in pools])
    selection = 2**33 * 3  # behind the maps of the last seed that there can be
    numbers = [*range(6), *range(selection, selection + 3), *range(6, 12), *range(selection + 3, selection + 6)]
    expected = [published_map(number, 16)[0] for number in numbers]
    np.testing.assert_allclose(agents, expected, rtol=1e-6)
    drawn = WaterWorld(WaterWorldConfig(layout="random", pool_size=0))
    assert drawn.make_params(0).starts is None
