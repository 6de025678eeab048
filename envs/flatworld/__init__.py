"""FlatWorld: a point among coloured discs that overlap, after DeepLTL."""

from envs.flatworld.config import EPISODE_LENGTH, LETTERS, FlatWorldConfig
from envs.flatworld.flat_env import LEAVING_REWARD, NUM_ACTIONS, FlatState, FlatWorld, FlatWorldParams
from t2tl_jax.registry import register_env

__all__ = [
    "EPISODE_LENGTH",
    "LEAVING_REWARD",
    "LETTERS",
    "NUM_ACTIONS",
    "FlatState",
    "FlatWorld",
    "FlatWorldConfig",
    "FlatWorldParams",
]

register_env("flatworld", FlatWorldConfig, FlatWorld, {"FlatWorld-v0": FlatWorldConfig()})
