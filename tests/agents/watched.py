"""A learner whose values are watched, and what holds of every learner with memory: a window or a carried state."""

from pathlib import Path
from typing import Any, NamedTuple

import chex
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.agents import ppo
from t2tl_jax.runs.checkpoints import Checkpoints
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.training.advantages import generalised_advantages
from t2tl_jax.training.types import Agent


class Watched(NamedTuple):
    """An environment, a learner, and the learner's functions, compiled once."""

    env: TaskEnv
    agent: Agent
    init: Any  # key -> state
    iterate: Any  # state -> (state, metrics)
    values: list[tuple[np.ndarray, ...]]  # of each iteration: value, next_value, ended, each [T, N]


def watched(env: TaskEnv, agent: Agent) -> Watched:
    """The learner, spied on while its program is made."""
    values: list[tuple[np.ndarray, ...]] = []

    def spy(reward, value, next_value, terminated, truncated, *constants):
        jax.debug.callback(lambda *arrays: values.append(arrays), value, next_value, terminated | truncated)
        return generalised_advantages(reward, value, next_value, terminated, truncated, *constants)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ppo, "generalised_advantages", spy)
        key, given = jax.eval_shape(jax.random.key, 0), env.make_params(0)
        iterate = jax.jit(agent.iterate).lower(jax.eval_shape(agent.init, key, given), given).compile()
    init = jax.jit(agent.init)
    return Watched(env, agent, lambda key: init(key, given), lambda state: iterate(state, given), values)


def check_what_acted_is_learned_from(learner: Watched, check_carry: Any) -> None:
    """Ratio 1 in every iteration, across ends of episodes and of rollouts; `check_carry` is asked of every state."""
    state = learner.init(jax.random.key(0))
    for _ in range(3):
        state, metrics = learner.iterate(state)
        assert metrics.episodes.successes > 0 and metrics.episodes.timeouts > 0
        assert abs(metrics.scalars["kl"]) < 1e-6 and metrics.scalars["clip_fraction"] == 0
        check_carry(state)


def check_values_after_steps(learner: Watched) -> None:
    """Within an episode the next state is valued twice: after the step that led there, and before the next."""
    jax.block_until_ready(learner.iterate(learner.init(jax.random.key(0))))
    jax.effects_barrier()
    value, next_value, ended = map(np.asarray, learner.values[-1])
    goes_on = ~ended[:-1]
    np.testing.assert_allclose(next_value[:-1][goes_on], value[1:][goes_on], atol=1e-5)
    assert np.abs(next_value[:-1] - value[1:])[~goes_on].max() > 1e-3  # another episode's value is another


def check_resumed(learner: Watched, folder: Path) -> Any:
    """A checkpoint holds the carry, and learning goes on from it as if nothing had been; returns what it holds."""
    state, _ = learner.iterate(learner.init(jax.random.key(0)))
    with Checkpoints(folder) as checkpoints:
        checkpoints.save(1, state, {})
        _, restored = checkpoints.restore(jax.eval_shape(lambda: state))
    chex.assert_trees_all_equal(restored.carry, state.carry)
    resumed, straight = (learner.iterate(jax.tree.map(jnp.asarray, start))[0] for start in (restored, state))
    chex.assert_trees_all_equal(resumed.carry, straight.carry)
    chex.assert_trees_all_equal(resumed.params, straight.params)
    return restored
