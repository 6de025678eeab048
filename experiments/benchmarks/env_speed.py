"""How fast an environment is: random actions, observation, labels, progression and automatic reset in one scan."""

import itertools
from dataclasses import dataclass

import jax
from jax.sharding import NamedSharding, PartitionSpec

from experiments.benchmarks.timing import compiled, rate
from t2tl_jax.env import State
from t2tl_jax.task_env import TaskEnv, TaskParams
from t2tl_jax.training.devices import ENVS, seed_sharding
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
    devices: int = 1
    """How many share the environments."""


def random_policy(env: TaskEnv) -> Player:
    """Uniform actions, discrete or continuous."""

    def act(carry: tuple[()], state: State, key: jax.Array) -> tuple[jax.Array, tuple[()], tuple[()]]:
        num_envs = len(state.obs)
        if env.num_actions is not None:
            return jax.random.randint(key, (num_envs,), 0, env.num_actions), carry, ()
        return jax.random.uniform(key, (num_envs, env.action_size), minval=-1.0, maxval=1.0), carry, ()

    return Player(act)


def shared_out(num_envs: int) -> NamedSharding | None:
    """How a batch of environments lies: evenly over as many devices as divide it; None for a single one."""
    sharding = seed_sharding(1, num_envs, per_seed=jax.device_count())
    return None if sharding is None else NamedSharding(sharding.mesh, PartitionSpec(ENVS))


def begun(
    env: TaskEnv, env_params: TaskParams, num_envs: int, episode_length: int, over: NamedSharding | None
) -> Episode:
    """Episodes under way, with resets that are spread over time; all arrays lead with [num_envs], placed as said."""
    spread = jax.jit(
        lambda params, key: begin(env, params, key, num_envs, episode_length, staggered=True), out_shardings=over
    )
    return spread(env_params, jax.random.key(0))


def measure(env: TaskEnv, num_envs: int, steps: int, repeats: int, episode_length: int) -> Speed:
    """Compile, warm up and time calls of so many `steps` on all devices; of each of the `repeats` one speed."""

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

    over = shared_out(num_envs)
    env_params = jax.device_put(env.make_params(0), over and NamedSharding(over.mesh, PartitionSpec()))
    episodes = begun(env, env_params, num_envs, episode_length, over)
    many = jax.jit(run, donate_argnums=0, out_shardings=(over, None))
    program, costs = compiled(lambda: many.lower(episodes, env_params, jax.random.key(0)))

    numbers = itertools.count()

    def call() -> jax.Array:
        nonlocal episodes
        episodes, total = program(episodes, env_params, jax.random.key(next(numbers)))
        return total

    speed = rate(call, num_envs * steps, repeats)
    devices = 1 if over is None else over.mesh.size
    return Speed(costs.trace_s + costs.compile_s, speed.median, speed.slowest, speed.fastest, devices)
