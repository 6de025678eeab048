"""How fast an environment is: random actions, observation, labels, progression and automatic reset in one scan."""

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

import jax
import jax.numpy as jnp

from t2tl_jax.env import State
from t2tl_jax.task_env import TaskEnv


@dataclass(frozen=True)
class Speed:
    """Of one environment at one batch size."""

    compile_s: float
    """Seconds to trace and compile."""
    steps_per_s: float
    """Environment steps per second, median of the repeats."""
    slowest: float
    """The same in the slowest repeat."""
    fastest: float
    """The same in the fastest repeat."""


def random_actions(key: jax.Array, env: TaskEnv, num_envs: int) -> jax.Array:
    """Uniform actions for a batch, discrete or continuous."""
    if env.num_actions is not None:
        return jax.random.randint(key, (num_envs,), 0, env.num_actions)
    return jax.random.uniform(key, (num_envs, env.action_size), minval=-1.0, maxval=1.0)


def make_rollout(env: TaskEnv, num_envs: int, steps: int, episode_length: int) -> Callable[..., tuple]:
    """A function ``(states, ages, key) -> (states, ages, total reward)`` that takes ``steps`` random actions each."""

    def step(carry: tuple[State, jax.Array, jax.Array], key: jax.Array) -> tuple[tuple, None]:
        states, ages, total = carry
        action_key, reset_key = jax.random.split(key)
        actions = random_actions(action_key, env, num_envs)
        states = jax.vmap(env.step)(states, actions)
        total += states.reward.sum()
        ages += 1
        ended = (states.done > 0.0) | (ages >= episode_length)
        fresh = jax.vmap(env.reset)(jax.random.split(reset_key, num_envs))
        states = jax.vmap(lambda end, new, old: jax.tree.map(lambda a, b: jnp.where(end, a, b), new, old))(
            ended, fresh, states
        )
        return (states, jnp.where(ended, 0, ages), total), None

    def rollout(states: State, ages: jax.Array, key: jax.Array) -> tuple[State, jax.Array, jax.Array]:
        return jax.lax.scan(step, (states, ages, jnp.zeros(())), jax.random.split(key, steps))[0]

    return rollout


def measure(env: TaskEnv, num_envs: int, steps: int, repeats: int, episode_length: int) -> Speed:
    """Compile, warm up and time calls of so many `steps`; of each of the `repeats` one speed."""
    states = jax.jit(jax.vmap(env.reset))(jax.random.split(jax.random.key(0), num_envs))
    ages = jnp.arange(num_envs, dtype=jnp.int32) % episode_length  # spread the resets over time
    rollout = make_rollout(env, num_envs, steps, episode_length)

    started = time.perf_counter()
    compiled = jax.jit(rollout, donate_argnums=(0, 1)).lower(states, ages, jax.random.key(0)).compile()
    compile_s = time.perf_counter() - started

    seconds = []
    for repeat in range(repeats + 1):
        started = time.perf_counter()
        states, ages, total = compiled(states, ages, jax.random.key(repeat))
        jax.block_until_ready((states, total))
        seconds.append(time.perf_counter() - started)
    speeds = [num_envs * steps / s for s in seconds[1:]]  # the first call warms up
    return Speed(compile_s, statistics.median(speeds), min(speeds), max(speeds))
