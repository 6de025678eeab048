"""How fast a configuration trains: whole iterations, and how much of one is acting."""

from dataclasses import dataclass
from typing import Any

import jax

from experiments.benchmarks.timing import Costs, Rate, compiled, rate
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.experiment import build
from t2tl_jax.task_env import TaskParams
from t2tl_jax.training.compiler_options import compiler_options
from t2tl_jax.training.program import OVER_SEEDS
from t2tl_jax.training.types import repeated
from t2tl_jax.training.unroll import begin, player_of, unroll


@dataclass(frozen=True)
class TrainingSpeed:
    """Of one configuration with all of its seeds, on the devices that a run of it uses."""

    iterate: Rate
    """Environment steps/s of all seeds while training."""
    costs: Costs
    """Of the program of one iteration. Tracing includes the first state's program, and the maps."""
    acting: Rate | None
    """Environment steps/s of all seeds where the policy acts and nothing is learned; None where several devices train,
    since this is timed on one."""
    frames: int
    """Environment steps of all seeds in one iteration."""
    devices: int
    """How many train."""


def measure(config: Config, repeats: int) -> TrainingSpeed:
    """Compile a configuration and time so many of its iterations; then its acting alone, on a single device.

    Pre-training does not count: the encoder's parameters make no difference to the time.
    """
    experiment = build(config)
    iterate, costs = compiled(lambda: experiment.program.lowered_iterate)
    program = experiment.program
    init = program.lowered_init.compile()
    state = init(program.keys, program.env_params)
    frames = experiment.agent.frames_per_iteration * len(experiment.seeds)

    def one_iteration() -> Any:
        nonlocal state
        state, metrics = iterate(state, program.env_params)
        return metrics

    training = rate(one_iteration, frames, repeats)
    acting = _acting(experiment, state.params, repeats) if experiment.devices == 1 else None
    return TrainingSpeed(training, costs, acting, frames, experiment.devices)


def _acting(experiment: Any, params: Any, repeats: int) -> Rate:
    """The same environments and steps, with the sampled policy."""
    config, agent, env = experiment.config, experiment.agent, experiment.task_env
    steps = config.learner.unroll_length
    num_envs = agent.frames_per_iteration // steps

    def play(params: Any, env_params: TaskParams, key: jax.Array) -> jax.Array:
        policy = player_of(agent, env, params, agent.embed(params, env_params.table), deterministic=False)
        start_key, key = jax.random.split(key)
        episodes = begin(env, env_params, start_key, num_envs, config.episode_length)
        carry, limit = repeated(agent.begin(), num_envs), config.episode_length
        _, _, rewards = unroll(
            *(env, env_params, policy, episodes, carry, key, steps, limit, config.learner.discount),
            keep=lambda step: step.reward.sum(),
        )
        return rewards.sum()

    seeds = len(experiment.seeds)
    keys = jax.random.split(jax.random.key(0), seeds)
    env_params = jax.device_put(experiment.env_params("evaluation"))
    params = jax.device_put(jax.device_get(params))
    many = jax.jit(jax.vmap(play, in_axes=(0, OVER_SEEDS, 0)), compiler_options=compiler_options())
    program = many.lower(params, env_params, keys).compile()
    return rate(lambda: program(params, env_params, keys), num_envs * steps * seeds, repeats)
