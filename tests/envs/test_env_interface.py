"""What every trainer relies on: structure, dtypes, keys, jit and vmap, scan, failures, and the registry."""

import copy

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from envs.zones import ZoneConfig, ZoneEnv
from envs.zones.point_robot import PointState
from t2tl_jax.env import EnvConfig, LabelledEnv
from t2tl_jax.registry import make_env

BATCH = 4


@pytest.fixture(scope="module")
def random_env() -> ZoneEnv:
    return make_env(ZoneConfig(physics="closed_form", layout="random", pool_size=50))


def describe(tree):
    """Structure, shapes, dtypes and weak types."""
    return jax.tree.map(lambda x: (x.shape, str(x.dtype), jax.typeof(x).weak_type), tree)


def test_reset_and_step_have_one_structure(env):
    state = jax.eval_shape(env.reset, jax.random.key(0))
    after = jax.eval_shape(env.step, state, jnp.zeros(2))
    assert jax.tree.structure(state) == jax.tree.structure(after)
    assert describe(state) == describe(after)
    assert all(leaf.dtype == jnp.float32 for leaf in jax.tree.leaves(after))
    assert state.info == {} and state.metrics == {}
    assert state.obs.shape == (env.observation_size,) == (76,)


def test_interface(env):
    assert isinstance(env, LabelledEnv)
    assert env.propositions == ("Black", "White", "Red", "Yellow")
    assert (env.action_size, env.num_actions, env.alphabet) == (2, None, "at_most_one")
    labels = jax.eval_shape(env.labels, jax.eval_shape(env.reset, jax.random.key(0)))
    assert labels.shape == (4,) and labels.dtype == jnp.bool_


def test_double_precision_keeps_the_dtypes(env):
    with jax.enable_x64(True):
        state = jax.eval_shape(env.reset, jax.random.key(0))
        after = jax.eval_shape(env.step, state, jnp.zeros(2))
        assert describe(state) == describe(after)


@pytest.mark.slow
def test_vmap_equals_loop(closed_form_env):
    """To rounding: on its own or in a batch, XLA may order the arithmetic differently."""
    env = closed_form_env  # of MJX, vmap is its authors' care, and takes half a minute to compile
    rng = np.random.default_rng(0)
    qpos, qvel = (jnp.asarray(rng.uniform(-2, 2, (BATCH, 3)), jnp.float32) for _ in range(2))
    actions = jnp.asarray(rng.uniform(-1, 1, (BATCH, 2)), jnp.float32)
    states = jax.jit(jax.vmap(env.reset))(jax.random.split(jax.random.key(0), BATCH))
    moving = states.pipeline_state.replace(robot=PointState(qpos=qpos, qvel=qvel))
    states = states.replace(pipeline_state=moving)
    together = jax.jit(jax.vmap(env.step))(states, actions)
    step = jax.jit(env.step)
    for i in range(BATCH):
        alone = step(jax.tree.map(lambda x, i=i: x[i], states), actions[i])
        np.testing.assert_allclose(together.pipeline_state.qpos[i], alone.pipeline_state.qpos, atol=1e-4)
        np.testing.assert_allclose(together.obs[i, 12:], alone.obs[12:], atol=1e-4)


@pytest.mark.slow
def test_scan_is_stable_and_deterministic(drive):
    rng = np.random.default_rng(0)
    qpos, actions = rng.uniform(-2, 2, (8, 3)), rng.uniform(-1, 1, (8, 2))
    first, again = drive(qpos, actions), drive(qpos, actions)
    assert first.obs.shape == (250, 8, 76) and np.isfinite(first.obs).all()
    jax.tree.map(np.testing.assert_array_equal, first, again)


@pytest.mark.slow
def test_typed_and_legacy_keys_give_the_same_reset(random_env):
    typed, legacy = random_env.reset(jax.random.key(5)), random_env.reset(jax.random.PRNGKey(5))
    other = random_env.reset(jax.random.key(6))
    jax.tree.map(np.testing.assert_array_equal, typed, legacy)
    assert not np.array_equal(typed.obs, other.obs)
    compiled = jax.jit(random_env.reset)
    jax.tree.map(np.testing.assert_array_equal, compiled(jax.random.key(5)), compiled(jax.random.PRNGKey(5)))


def test_no_reward_and_no_end(closed_form_env):
    state = closed_form_env.reset(jax.random.key(0))

    def step(state, key):
        state = closed_form_env.step(state, jax.random.uniform(key, (2,), minval=-1.0))
        return state, (state.reward, state.done)

    _, (reward, done) = jax.lax.scan(step, state, jax.random.split(jax.random.key(1), 1500))
    assert not reward.any() and not done.any()


@pytest.mark.parametrize("broken", ["action", "velocity"])
def test_physics_failure_ends_the_episode(drive, broken):
    """In the first step; nothing resets the environment here."""
    qpos = np.random.default_rng(0).uniform(-2, 2, (BATCH, 3)).astype(np.float32)
    actions, qvel = np.zeros((BATCH, 2)), np.zeros((BATCH, 3))
    if broken == "action":
        actions[1, 1] = np.nan
    else:
        qvel[1, 0] = np.inf
    after = jax.tree.map(lambda x: x[0], drive(qpos, actions, qvel))
    np.testing.assert_array_equal(after.done, [0, 1, 0, 0])
    np.testing.assert_array_equal(after.reward, [0, -10, 0, 0])
    assert np.isfinite(after.obs).all()
    np.testing.assert_array_equal(after.pipeline_state.qpos[1], qpos[1])


@pytest.mark.slow
def test_actions_are_clipped_and_cast(closed_form_env):
    state, step = jax.jit(closed_form_env.reset)(jax.random.key(0)), jax.jit(closed_form_env.step)
    ordinary = step(state, jnp.array([1.0, -1.0]))
    for action in (jnp.array([5, -9]), np.array([5.0, -9.0]), jnp.array([5.0, -9.0], jnp.bfloat16)):
        jax.tree.map(np.testing.assert_array_equal, ordinary, step(state, action))


def test_no_second_compilation(closed_form_env):
    step = jax.jit(closed_form_env.step)
    state = jax.jit(closed_form_env.reset)(jax.random.key(0))
    for _ in range(3):
        state = step(state, jnp.zeros(2))
    assert step._cache_size() == 1


def test_environments_can_be_copied(closed_form_env):
    again = copy.deepcopy(closed_form_env)
    state = closed_form_env.reset(jax.random.key(0))
    jax.tree.map(np.testing.assert_array_equal, state, again.reset(jax.random.key(0)))


def test_registry():
    assert make_env("Zones-25-v1").backend == "mjx"
    random = make_env("Zones-5-v0")
    assert jax.eval_shape(random.reset, jax.random.key(0)).pipeline_state.zones.shape == (8, 2)
    with pytest.raises(ValueError, match="did you mean 'Zones-25-v1'"):
        make_env("Zone-25")
    with pytest.raises(ValueError, match="EnvConfig is not the configuration of a registered environment"):
        make_env(EnvConfig())
