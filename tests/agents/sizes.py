"""Sizes with which a learner solves the worlds of `tests/probe.py` within seconds."""

from t2tl_jax.agents.ppo_config import PPOConfig
from t2tl_jax.networks.gru import GRUConfig
from t2tl_jax.networks.rgcn import RGCNConfig
from t2tl_jax.networks.transformer import TransformerConfig

TRANSFORMER = TransformerConfig(layers=1, width=16, heads=2, feed_forward=32, output=8)
GRU = GRUConfig(width=16, output=8)
GRAPH = RGCNConfig(width=8, layers=2, output=8)  # learns, and has the fewest parameters to compile an update of
PPO = PPOConfig(
    num_envs=16,
    unroll_length=16,
    epochs=4,
    minibatch_size=64,
    discount=0.9,
    gae_lambda=0.9,
    learning_rate=3e-3,
    noise_time=0,
)
