"""What an automatic pre-training is trained with: world, learner, random formulas, length."""

from t2tl_jax import single_state
from t2tl_jax.agents.ppo_config import PPOConfig
from t2tl_jax.networks.actor_critic import NetworkConfig
from t2tl_jax.runs.config import Config, PoolConfig, SelectionConfig
from t2tl_jax.runs.convergence import ConvergenceConfig
from t2tl_jax.single_state import SingleStateConfig

SCHEDULE = Config(
    env=SingleStateConfig(),
    task="Eventually_1_5_1_4",
    learner=PPOConfig(
        # The network sees nothing but the encoded task, through one linear layer, so that the encoder does the work.
        network=NetworkConfig(env_layers=(), actor_layers=(), critic_layers=()),
        num_envs=64,
        unroll_length=32,
        epochs=4,
        minibatch_size=512,
        discount=0.9,
        gae_lambda=0.5,
        learning_rate=1e-3,
        clip_eps=0.2,
        entropy_coefficient=0.01,
        noise_time=0.0,
        staggered_start=False,
    ),
    # Every gradient step encodes every row, which here is nearly all of the work.
    pool=PoolConfig(size=16, period=8, rows=192, length=40),
    frames=500_000,
    convergence=ConvergenceConfig(window=20),
    # Its short episodes cost little, and it is the best encoder that is handed on.
    selection=SelectionConfig(episodes=128),
    episode_length=single_state.EPISODE_LENGTH,
)
"""Sizes and schedule of every pre-training; the task encoder and the propositions are those of the run."""
