"""WaterWorld: an agent among coloured balls that fly straight and bounce off the walls, after Toro Icarte et al."""

from envs.waterworld.water_env import (
    COLOURS,
    EPISODE_LENGTH,
    LETTERS,
    NUM_ACTIONS,
    WaterWorld,
    WaterWorldConfig,
    WaterWorldState,
)

__all__ = [
    "COLOURS",
    "EPISODE_LENGTH",
    "LETTERS",
    "NUM_ACTIONS",
    "WaterWorld",
    "WaterWorldConfig",
    "WaterWorldState",
]
