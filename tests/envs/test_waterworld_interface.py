"""What every trainer relies on: structure, dtypes, keys, jit and vmap, scan, auto-reset, and the registry."""

import copy

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from brax.envs.wrappers.training import AutoResetWrapper, EpisodeWrapper, VmapWrapper

from envs.waterworld import COLOURS, EPISODE_LENGTH, LETTERS, WaterWorld, WaterWorldConfig
from t2tl_jax.env import LabelledEnv
from t2tl_jax.ltl import WATER_PROPOSITIONS, compile_reward_machines, compile_tasks, named_machines, named_task
from t2tl_jax.registry import env_names, make_env
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.training.program import OVER_SEEDS, params_of_seeds

BATCH = 8
OPTIMISED = {"xla_backend_optimization_level": 1}
"""Compiler options of programs that run much longer than they compile; see `tests/conftest.py`."""


@pytest.fixture(scope="module", params=["fixed", "pool", "drawn"])
def env(request) -> WaterWorld:
    layout = "fixed" if request.param == "fixed" else "random"
    return WaterWorld(WaterWorldConfig(layout=layout, pool_size=0 if request.param == "drawn" else 32, delay=1))


@pytest.fixture(scope="module")
def task_env() -> TaskEnv:
    water = WaterWorld(WaterWorldConfig(layout="random", pool_size=64))
    return TaskEnv(water, compile_tasks(named_task("phi_water"), water.propositions, water.alphabet))


def describe(tree):
    """Structure, shapes, dtypes and weak types."""
    return jax.tree.map(lambda x: (x.shape, str(x.dtype), jax.typeof(x).weak_type), tree)


@pytest.mark.parametrize("x64", [False, True])
def test_reset_and_step_have_one_structure(env, x64):
    with jax.enable_x64(x64):
        state = jax.eval_shape(env.reset, jax.random.key(0))
        after = jax.eval_shape(env.step, state, jnp.int32(0))
        assert jax.tree.structure(state) == jax.tree.structure(after)
        assert describe(state) == describe(after)
        assert {str(leaf.dtype) for leaf in jax.tree.leaves(after)} == {"float32", "bool"}
        assert state.info == {} and state.metrics == {}
        assert state.obs.shape == (env.observation_size,) == (68,)


def test_interface(env):
    assert isinstance(env, LabelledEnv)
    assert env.propositions == COLOURS == WATER_PROPOSITIONS
    assert (env.action_size, env.num_actions, env.alphabet) == (1, 5, "every_subset")
    labels = jax.eval_shape(env.labels, jax.eval_shape(env.reset, jax.random.key(0)))
    assert labels.shape == (8,) and labels.dtype == jnp.bool_
    assert EPISODE_LENGTH == 600


def test_typed_and_legacy_keys_give_the_same_reset(env):
    reset = jax.jit(env.reset)
    typed, legacy = reset(jax.random.key(5)), reset(jax.random.PRNGKey(5))
    jax.tree.map(np.testing.assert_array_equal, typed, legacy)
    other = reset(jax.random.key(6))
    assert np.array_equal(typed.obs, other.obs) == (env.config.layout == "fixed")


@pytest.mark.slow
def test_vmap_equals_loop_through_a_scan(env):
    keys = jax.random.split(jax.random.key(0), BATCH)
    actions = jax.random.randint(jax.random.key(1), (100, BATCH), 0, 5)

    def step(states, actions):
        states = jax.vmap(env.step)(states, actions)
        return states, (states.obs, jax.vmap(env.labels)(states))

    run = jax.jit(lambda states: jax.lax.scan(step, states, actions))
    start = jax.jit(jax.vmap(env.reset))(keys)
    last, (obs, labels) = jax.tree.map(np.asarray, run(start))
    jax.tree.map(np.testing.assert_array_equal, (last, (obs, labels)), run(start))
    reset, alone = jax.jit(env.reset), jax.jit(lambda *given: (state := env.step(*given), env.labels(state)))
    for i in range(BATCH):
        state = reset(keys[i])
        for t, action in enumerate(np.asarray(actions[:, i])):
            state, now = alone(state, action)
            np.testing.assert_allclose(obs[t, i], state.obs, atol=2e-5)
            np.testing.assert_array_equal(labels[t, i], now)
    assert not last.reward.any() and not last.done.any()


@pytest.mark.slow
def test_actions_of_any_integer_kind(env):
    state = env.reset(jax.random.key(0))
    up = env.step(state, jnp.int32(1))
    for action in (1, np.int64(1), jnp.uint8(1), jnp.array([1]), jnp.float32(1.0)):
        jax.tree.map(np.testing.assert_array_equal, up, env.step(state, action))
    nothing = env.step(state, 0)
    for action in (-1, 5, 99):
        jax.tree.map(np.testing.assert_array_equal, nothing, env.step(state, action))


def test_no_second_compilation(env):
    step = jax.jit(env.step)
    state = jax.jit(env.reset)(jax.random.key(0))
    for _ in range(3):
        state = step(state, jnp.int32(2))
    assert step._cache_size() == 1


def test_environments_can_be_copied(env):
    again = copy.deepcopy(env)
    jax.tree.map(np.testing.assert_array_equal, env.reset(jax.random.key(1)), again.reset(jax.random.key(1)))


@pytest.mark.slow
def test_auto_reset_of_brax_restores_world_and_task(task_env):
    """Episodes are cut after 30 steps; afterwards world, contacts and task row are those of the first state."""
    wrapped = AutoResetWrapper(EpisodeWrapper(VmapWrapper(task_env), episode_length=30, action_repeat=1))
    first = jax.jit(wrapped.reset)(jax.random.split(jax.random.PRNGKey(0), BATCH))  # its wrappers want legacy keys
    actions = jax.random.randint(jax.random.key(1), (90, BATCH), 0, 5)
    step = jax.jit(lambda first, actions: jax.lax.scan(lambda at, do: (wrapped.step(at, do),) * 2, first, actions)[1])
    states = jax.tree.map(np.asarray, step(first, actions))  # [90, BATCH]
    done = states.done.astype(bool)
    jax.tree.map(
        lambda now, start: np.testing.assert_array_equal(now[done], np.broadcast_to(start, now.shape)[done]),
        (states.pipeline_state, states.obs),
        (first.pipeline_state, first.obs),
    )
    assert (done.sum(axis=0) >= 3).all()


@pytest.mark.slow
def test_random_play_of_phi_water(task_env):
    """The original's dynamics give a random player -1.00 after 62 steps in the mean (300 episodes)."""
    rows, lengths, _ = _play_randomly(task_env, [0], 300)
    verdict = np.asarray(task_env.table.verdict)[rows]
    assert verdict.mean() < -0.97
    assert abs(lengths.mean() - 62) < 12


@pytest.mark.slow
def test_random_play_of_the_original_single_task():
    """Touch d, e, f in order and nothing else, over maps 1 to 10; the original: 10,000 episodes."""
    water = WaterWorld(WaterWorldConfig(colours=LETTERS, layout="by_seed", pool_size=11, delay=1))
    table = compile_reward_machines(named_machines("rm_t10_published"), water.propositions)
    count = 10_000
    rows, lengths, paid = _play_randomly(TaskEnv(water, table), range(1, 11), count // 10)
    assert abs(lengths.mean() - 41.0) < 4 * lengths.std() * np.sqrt(2 / count)
    for published, here in ((0.0172, paid > 0), (0.0028, np.asarray(table.verdict)[rows] > 0)):
        assert abs(here.mean() - published) < 4 * np.sqrt(2 * published / count)  # both have a standard error


@pytest.mark.slow
def test_random_play_of_the_ten_published_tasks():
    """Share of random episodes that are paid, by task, and their length over maps 1 to 10 (the original: 1,200)."""
    water = WaterWorld(WaterWorldConfig(colours=LETTERS, layout="by_seed", pool_size=11, delay=1))
    env = TaskEnv(water, compile_reward_machines(named_machines("rm_water_published"), water.propositions))
    per_map = 600

    def episode(params, key, turn):
        def step(carry, key):
            state, length, total = carry
            after, alive = env.step(state, jax.random.randint(key, (), 0, 5), params), state.done == 0
            state = jax.tree.map(lambda new, old: jnp.where(alive, new, old), after, state)
            return (state, length + alive, total + alive * after.reward), None

        reset_key, action_key = jax.random.split(key)
        start = (env.reset(reset_key, params, turn), jnp.int32(0), jnp.float32(0))
        return jax.lax.scan(step, start, jax.random.split(action_key, EPISODE_LENGTH))[0][1:]

    keys, turns = jax.random.split(jax.random.key(0), (10, per_map)), jnp.arange(10 * per_map).reshape(10, per_map)
    on_a_map = jax.vmap(episode, (None, 0, 0))
    play = jax.jit(jax.vmap(on_a_map, (OVER_SEEDS, 0, 0)), compiler_options=OPTIMISED)
    lengths, total = play(params_of_seeds(env, range(1, 11)), keys, turns)
    paid = np.asarray(total).reshape(-1, 10).mean(axis=0)
    published = np.array([0.90, 0.89, 0.93, 0.79, 0.80, 0.80, 0.68, 0.52, 0.02, 0.03])
    # 600 episodes here and 120 there for every task: 4 standard errors of the difference.
    error = np.sqrt(published * (1 - published) * (1 / per_map + 1 / 120))
    np.testing.assert_array_less(np.abs(paid - published), 4 * error)
    assert abs(paid.mean() - 0.634) < 4 * np.sqrt(0.634 * 0.366 / 1200)
    assert abs(lengths.mean() - 318) < 25


def _play_randomly(env, seeds, each):
    """Final rows, lengths and returns of episodes, cut after 600 steps, so many for each of the seeds."""

    def episode(params, key):
        def goes_on(carry):
            state, length, _ = carry
            return (state.done == 0) & (length < EPISODE_LENGTH)

        def step(carry):
            state, length, total = carry
            after = env.step(state, jax.random.randint(jax.random.fold_in(action_key, length), (), 0, 5), params)
            return after, length + 1, total + after.reward

        reset_key, action_key = jax.random.split(key)
        start = (env.reset(reset_key, params), jnp.int32(0), jnp.float32(0))
        state, length, total = jax.lax.while_loop(goes_on, step, start)
        return env.row(state), length, total

    keys = jax.random.split(jax.random.key(0), (len(seeds), each))
    play = jax.jit(jax.vmap(jax.vmap(episode, (None, 0)), (OVER_SEEDS, 0)), compiler_options=OPTIMISED)
    return jax.tree.map(np.ravel, play(params_of_seeds(env, seeds), keys))


def test_registry():
    assert make_env("WaterWorld").propositions == COLOURS
    assert make_env("WaterWorld-random").config.layout == "random"
    original = make_env("Water-M10-v0")
    assert isinstance(original, WaterWorld)
    assert original.propositions == LETTERS and original.observation_size == 52
    assert (original.config.delay, original.config.events, original.config.map_number) == (1, "onset", 10)
    assert sum(name.startswith("Water-M") for name in env_names()) == 11
    with pytest.raises(ValueError, match="did you mean 'waterworld'"):
        make_env("Waterworld")
