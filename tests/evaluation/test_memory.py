"""Evaluation and animation carry what a policy remembers from step to step of its episode."""

from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from t2tl_jax.evaluation.animation import Scene, record
from t2tl_jax.evaluation.episodes import play
from t2tl_jax.training.types import Agent


@struct.dataclass
class Count:
    """How far the agent has counted, or -1 after a mistake."""

    env: jax.Array


@struct.dataclass
class Counting:
    pipeline_state: Count
    obs: jax.Array
    reward: jax.Array
    done: jax.Array


class CountingEnv:
    """The agent sees nothing, and succeeds if its actions are 0, 1, 2."""

    def reset(self, rng):
        return Counting(Count(jnp.float32(0)), jnp.ones(1), jnp.float32(0), jnp.float32(0))

    def step(self, state, action):
        count = jnp.where(action == state.pipeline_state.env, state.pipeline_state.env + 1, -1.0)
        verdict = jnp.where(count == 3, 1.0, jnp.where(count < 0, -1.0, 0.0))
        return Counting(Count(count), jnp.ones(1), verdict, jnp.abs(verdict))

    def row(self, state):
        return jnp.int32(2)

    def verdict(self, state):
        return jnp.sign(state.reward)


def counting_agent():
    """Its action is how many steps it remembers."""
    return Agent(
        init=lambda key: None,
        iterate=lambda state: (state, None),
        embed=lambda params: jnp.zeros((3, 1)),
        act=lambda params, embedding, memory, obs, row, key, deterministic: memory,
        frames_per_iteration=1,
        begin=lambda: jnp.float32(0),
        remember=lambda params, memory, obs, action, reward: memory + obs[..., 0],
    )


def test_every_evaluated_episode_has_its_own_memory():
    episodes = play(CountingEnv(), counting_agent(), {}, jax.random.key(0), 4, 10, True)
    assert episodes.success.all() and (episodes.length == 3).all()


def test_the_animated_episode_has_a_memory():
    def scene(count):
        return Scene(discs=jnp.zeros((0, 2)), radii=jnp.zeros(0), agent=jnp.full(2, count), heading=jnp.zeros(2))

    recording = record(CountingEnv(), SimpleNamespace(scene=scene), counting_agent(), {}, jax.random.key(0), 10, True)
    assert recording.verdict == 1
    np.testing.assert_array_equal(recording.scenes.agent[:, 0], [0, 1, 2, 3])
