"""How fast an environment is: random actions, observation, labels, progression and automatic reset in one scan."""

import itertools
from dataclasses import dataclass

import jax

from experiments.benchmarks.timing import compiled, rate
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

    program, costs = compiled(lambda: jax.jit(run, donate_argnums=0).lower(episodes, env_params, jax.random.key(0)))

    numbers = itertools.count()

    def call() -> jax.Array:
        nonlocal episodes
        episodes, total = program(episodes, env_params, jax.random.key(next(numbers)))
        return total

    speed = rate(call, num_envs * steps, repeats)
    return Speed(costs.trace_s + costs.compile_s, speed.median, speed.slowest, speed.fastest)
