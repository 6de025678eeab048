"""WaterWorld: an agent among coloured balls that fly straight and bounce off the walls, after Toro Icarte et al."""

from envs.waterworld.config import COLOURS, EPISODE_LENGTH, LETTERS, WaterWorldConfig
from envs.waterworld.params import WaterWorldParams
from envs.waterworld.water_env import NUM_ACTIONS, WaterWorld, WaterWorldState
from t2tl_jax.registry import register_env

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

register_env(
    "waterworld",
    WaterWorldConfig,
    WaterWorld,
    {
        "WaterWorld": WaterWorldConfig(),
        "WaterWorld-random": WaterWorldConfig(layout="random"),
        # The original's worlds, under their published names: six colours, labels one step late.
        **{f"Water-M{i}-v0": WaterWorldConfig(colours=LETTERS, map_number=i, delay=1) for i in range(11)},
    },
)
