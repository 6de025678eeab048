"""WaterWorld: an agent among coloured balls that fly straight and bounce off the walls, after Toro Icarte et al."""

from envs.waterworld.config import COLOURS, EPISODE_LENGTH, LETTERS, WaterWorldConfig
from envs.waterworld.params import WaterWorldParams
from envs.waterworld.water_env import NUM_ACTIONS, WaterWorld, WaterWorldState

__all__ = [
    "COLOURS",
    "EPISODE_LENGTH",
    "LETTERS",
    "NUM_ACTIONS",
    "WaterWorld",
    "WaterWorldConfig",
    "WaterWorldParams",
    "WaterWorldState",
]
