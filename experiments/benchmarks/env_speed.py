"""How fast an environment is: random actions, observation, labels, progression and automatic reset in one scan."""

import statistics
import time
from dataclasses import dataclass

import jax

from t2tl_jax.env import State
from t2tl_jax.task_env import TaskEnv, TaskParams
from t2tl_jax.training.unroll import Episode, Player, begin, unroll


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


def random_policy(env: TaskEnv) -> Player:
    """Uniform actions, discrete or continuous."""

    def act(carry: tuple[()], state: State, key: jax.Array) -> tuple[jax.Array, tuple[()], tuple[()]]:
        num_envs = len(state.obs)
        if env.num_actions is not None:
            return jax.random.randint(key, (num_envs,), 0, env.num_actions), carry, ()
        return jax.random.uniform(key, (num_envs, env.action_size), minval=-1.0, maxval=1.0), carry, ()

    return Player(act)


def measure(env: TaskEnv, num_envs: int, steps: int, repeats: int, episode_length: int) -> Speed:
    """Compile, warm up and time calls of so many `steps`; of each of the `repeats` one speed."""

    def run(episodes: Episode, env_params: TaskParams, key: jax.Array) -> tuple[Episode, jax.Array]:
        episodes, _, rewards = unroll(
            env,
            env_params,
            random_policy(env),
            episodes,
            (),
            key,
            steps,
            episode_length,
            discount=1.0,
            keep=lambda step: step.reward.sum(),
        )
        return episodes, rewards.sum()

    env_params = jax.device_put(env.make_params(0))
    spread = jax.jit(lambda params, key: begin(env, params, key, num_envs, episode_length, staggered=True))
    episodes = spread(env_params, jax.random.key(0))  # resets spread over time

    started = time.perf_counter()
    compiled = jax.jit(run, donate_argnums=0).lower(episodes, env_params, jax.random.key(0)).compile()
    compile_s = time.perf_counter() - started

    seconds = []
    for repeat in range(repeats + 1):
        started = time.perf_counter()
        episodes, total = compiled(episodes, env_params, jax.random.key(repeat))
        jax.block_until_ready((episodes, total))
        seconds.append(time.perf_counter() - started)
    speeds = [num_envs * steps / s for s in seconds[1:]]  # the first call warms up
    return Speed(compile_s, statistics.median(speeds), min(speeds), max(speeds))
