"""The published map and the random maps: keepouts, coverage, clear errors."""

from typing import get_args

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from envs.zones import ZoneConfig, ZoneEnv
from envs.zones import layouts as zone_layouts
from t2tl_jax.env import Purpose


@pytest.fixture(scope="module")
def random_env() -> ZoneEnv:
    return ZoneEnv(ZoneConfig(physics="closed_form", layout="random", pool_size=500))


def pairwise(points: np.ndarray) -> np.ndarray:
    """Distances between the points of each layout: ``[pool, n, n]``."""
    return np.linalg.norm(points[:, :, None] - points[:, None], axis=-1)


@pytest.mark.slow
@pytest.mark.parametrize("num_zones", [1, 8, 11])
def test_random_layouts_keep_every_distance(num_zones):
    layouts = zone_layouts.sample_layouts(num_zones, pool_size=1000, seed=0)
    assert layouts.robots.shape == (1000, 2) and layouts.zones.shape == (1000, num_zones, 2)
    assert np.abs(layouts.robots).max() <= 2.1 and np.abs(layouts.zones).max() <= 1.95
    to_robot = np.linalg.norm(layouts.zones - layouts.robots[:, None], axis=-1)
    assert to_robot.min() >= 0.95 - 1e-6
    between = pairwise(layouts.zones) + 9.0 * np.eye(num_zones)
    assert between.min() >= 1.10 - 1e-6


def test_random_layouts_cover_their_rectangles():
    layouts = zone_layouts.sample_layouts(8, pool_size=4000, seed=0)
    for points, limit in ((layouts.robots, 2.1), (layouts.zones[:, 0], 1.95), (layouts.zones[:, 7], 1.95)):
        counts, _, _ = np.histogram2d(points[:, 0], points[:, 1], bins=4, range=[[-limit, limit]] * 2)
        assert counts.min() > 4000 / 16 / 3
    assert len(np.unique(layouts.robots, axis=0)) == 4000


@pytest.mark.slow
@pytest.mark.parametrize(("num_zones", "probability"), [(8, 0.97), (10, 0.53), (11, 0.19)])
def test_success_probability_is_the_published_one(num_zones, probability):
    succeeded = zone_layouts._attempt_layouts(np.random.default_rng(0), num_zones, 3000)
    assert len(succeeded) / 3000 == pytest.approx(probability, abs=0.04)


def test_pool_depends_on_its_seed_alone():
    first, again, other = (zone_layouts.sample_layouts(8, 20, seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first.zones, again.zones)
    assert not np.array_equal(first.zones, other.zones)


def test_every_seed_has_maps_of_its_own_and_evaluation_others():
    env = ZoneEnv(ZoneConfig(physics="closed_form", layout="random", pool_size=50))
    pools = [env.make_params(seed, purpose) for seed in (0, 1) for purpose in get_args(Purpose)]
    assert {jax.tree.map(jnp.shape, pool).zones for pool in pools} == {(50, 8, 2)}
    assert len(np.unique(np.concatenate([pool.starts for pool in pools]), axis=0)) == 300
    jax.tree.map(np.testing.assert_array_equal, pools[4], env.make_params(1, "evaluation"))
    reset = jax.jit(jax.vmap(env.reset, (0, None)))
    for pool in pools[:2]:
        states = reset(jax.random.split(jax.random.key(0), 20), pool).pipeline_state
        assert all((pool.zones == zones).all((1, 2)).any() for zones in states.zones)
    fixed = ZoneEnv(ZoneConfig(physics="closed_form"))
    jax.tree.map(np.testing.assert_array_equal, fixed.make_params(0), fixed.make_params(5, "evaluation"))


@pytest.mark.slow
def test_resets_reach_the_whole_pool(random_env):
    states = jax.jit(jax.vmap(random_env.reset))(jax.random.split(jax.random.key(0), 5000)).pipeline_state
    starts = np.unique(np.asarray(states.qpos[:, :2]), axis=0)
    assert len(starts) == 500
    heading = np.asarray(states.qpos[:, 2])
    assert heading.min() >= 0.0 and heading.max() < 2 * np.pi
    counts, _ = np.histogram(heading, bins=8, range=(0, 2 * np.pi))
    assert counts.min() > 500
    np.testing.assert_array_equal(states.qvel, 0.0)


def test_random_reset_shows_its_own_map(random_env):
    state = jax.jit(random_env.reset)(jax.random.key(7))
    same = jax.jit(random_env.reset_to)(
        state.pipeline_state.qpos, state.pipeline_state.qvel, state.pipeline_state.zones
    )
    np.testing.assert_allclose(state.obs, same.obs, atol=1e-6)
    assert state.obs.shape == (76,) and random_env.propositions == ("Black", "White", "Red", "Yellow")


@pytest.mark.slow
def test_impossible_layouts_fail_clearly():
    with pytest.raises(ValueError, match="40 zones cannot be placed"):
        ZoneEnv(ZoneConfig(physics="closed_form", layout="random", colours="J" * 40, pool_size=512))


def test_overlapping_zones_fail_clearly():
    zone_layouts.check_disjoint(np.array(zone_layouts.FIXED_ZONES))
    with pytest.raises(ValueError, match=r"0\.500 m apart"):
        zone_layouts.check_disjoint(np.array([[0.0, 0.0], [0.5, 0.0], [2.0, 2.0]]))


def test_a_given_map_with_overlapping_zones_is_refused(random_env):
    zones = random_env.make_params(0).zones[0].copy()
    random_env.reset_to(np.zeros(3), np.zeros(3), zones)
    zones[1] = zones[0] + 0.3
    with pytest.raises(ValueError, match=r"two zones overlap: their centres are 0\.424 m apart"):
        random_env.reset_to(np.zeros(3), np.zeros(3), zones)
    jax.eval_shape(random_env.reset_to, jnp.zeros(3), jnp.zeros(3), zones)  # a traced map cannot be checked


@pytest.mark.parametrize(
    ("config", "message"),
    [
        ({"layout": "random", "colours": "JXQ"}, "unknown colours Q, X"),
        ({"colours": "JJRR"}, "needs layout='random'"),
        ({"physics": "bullet"}, "must be 'mjx' or 'closed_form'"),
        ({"layout": "maze"}, "must be 'fixed' or 'random'"),
        ({"layout": "random", "pool_size": 0}, "at least one map"),
        ({"pool_seed": -1}, "must not be negative"),
    ],
)
def test_bad_configurations_fail_clearly(config, message):
    with pytest.raises(ValueError, match=message):
        ZoneConfig(**config)
