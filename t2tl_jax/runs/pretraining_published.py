"""The schedule of the authors' pre-training, from the log and the configuration that they ship with its weights."""

from dataclasses import replace
from typing import Any

from t2tl_jax.runs.config import Config
from t2tl_jax.runs.convergence import ConvergenceConfig


def as_published(schedule: Config) -> Config:
    """A pre-training with the published number of frames, rollouts, epochs and constants of PPO.

    It runs to its end: 245 iterations of 16 x 512 steps. What it trains on, and which encoder, stays.
    """
    learner: Any = schedule.learner
    return replace(
        schedule,
        learner=replace(
            learner,
            network=replace(learner.network, mean_scale=1.0, value_scale=1.0),
            num_envs=16,
            unroll_length=512,
            epochs=2,
            minibatch_size=1024,
            discount=0.9,
            gae_lambda=0.5,
            learning_rate=1e-3,
            anneal_learning_rate=False,
            adam_epsilon=1e-8,
            clip_eps=0.1,
            clip_value=True,
            value_coefficient=0.5,
            entropy_coefficient=0.01,
            max_gradient_norm=0.5,
            normalise_advantage=False,
            timeout_is_terminal=True,
            staggered_start=False,
        ),
        frames=2_000_000,
        convergence=ConvergenceConfig(),
        episode_length=76,  # an episode ends when more than 75 steps were taken
    )
