"""Replay that stores every step once draws what one that stores every window whole does, with the same keys."""

import chex
import flashbax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from flashbax.buffers import trajectory_buffer

from t2tl_jax.agents.replay import make_replay
from t2tl_jax.agents.td_learning import Transition
from t2tl_jax.networks.context_config import ContextConfig
from t2tl_jax.networks.windows import append, empty_where, empty_window, without_oldest
from t2tl_jax.task_env import Shared

ENVS, SIZE, LENGTH, BATCH = 3, 14, 2, 64  # the ring is no multiple of the environments


def steps(recompute, reset, count):
    """Transitions of all environments with their whole windows, step by step; episodes end at random."""
    rng = np.random.default_rng(0)
    window = jax.vmap(lambda _: empty_window(LENGTH, jnp.int32(0), 2 if recompute else 3))(jnp.arange(ENVS))

    @jax.jit
    def following(whole, ended):
        window = without_oldest(whole)
        return empty_where(window, ended) if reset else window

    for _ in range(count):
        obs, next_obs = jnp.array(rng.normal(size=(2, ENVS, 2)), jnp.float32)
        seen = obs if recompute else jnp.array(rng.normal(size=(ENVS, 3)), jnp.float32)
        action, row = jnp.array(rng.integers(1, 5, (2, ENVS)), jnp.int32)
        reward, ended = jnp.array(rng.normal(size=ENVS), jnp.float32), jnp.array(rng.random(ENVS) < 0.3)
        whole = jax.jit(append)(window, action, reward, seen)
        yield Transition(obs, action, next_obs, row, Shared(row, reward, ended), ended, steps=whole)
        window = following(whole, ended)


@pytest.mark.slow
@pytest.mark.parametrize("recompute", [True, False])
@pytest.mark.parametrize("reset", [True, False])
def test_windows_put_together_are_those_stored_whole(recompute, reset):
    """Before the ring is full, when it is, and after it has wrapped around several times."""
    ours = make_replay(SIZE, BATCH, ENVS, ContextConfig(length=LENGTH, recompute=recompute, reset=reset))
    whole = flashbax.make_item_buffer(SIZE, min_length=1, sample_batch_size=SIZE, add_batches=True)
    given = list(steps(recompute, reset, 20))
    first = jax.tree.map(lambda x: x[0], given[0])
    state, expected = ours.init(first), whole.init(first)
    add, add_whole, sample = jax.jit(ours.add), jax.jit(whole.add), jax.jit(ours.sample)
    for number, step in enumerate(given):
        state, expected = add(state, step), add_whole(expected, step)
        drawn = sample(state, jax.random.key(number))
        chex.assert_trees_all_equal(drawn, flat_sample(expected, jax.random.key(number)))
    stored, all_windows = (sum(x.nbytes for x in jax.tree.leaves(tree.experience)) for tree in (state, expected))
    assert stored / (SIZE + LENGTH * ENVS) < all_windows / SIZE  # bytes of a transition


@pytest.mark.parametrize("context", [None, ContextConfig(length=LENGTH)])
def test_an_empty_replay_is_zeros_whatever_was_in_its_memory(context, monkeypatch):
    """From JAX 0.11 on `empty_like` leaves memory as it was; a checkpoint holds no bool that is neither 0 nor 1."""
    left = []

    def empty_like(x):
        left.append(x)
        return jnp.full_like(x, 1)

    monkeypatch.setattr(trajectory_buffer.jnp, "empty_like", empty_like)
    blank = jax.tree.map(lambda x: x[0], next(steps(True, True, 1)))
    blank = blank if context else blank.replace(steps=())
    state = make_replay(SIZE, BATCH, ENVS, context).init(blank)
    assert left and not any(np.any(x) for x in jax.tree.leaves(state))


@jax.jit
def flat_sample(state, key):
    """What flashbax draws, for a batch larger than the ring, which it refuses."""
    drawn = trajectory_buffer.sample(state, key, BATCH, sequence_length=1, period=1)
    return jax.tree.map(lambda x: x[:, 0], drawn.experience)


def test_without_context_nothing_is_kept_behind():
    replay = make_replay(SIZE, BATCH, ENVS, None)
    first = jax.tree.map(lambda x: x[0], next(steps(True, True, 1))).replace(steps=())
    state = replay.init(first)
    assert state.experience.obs.shape == (1, SIZE, 2) and state.experience.steps == ()
