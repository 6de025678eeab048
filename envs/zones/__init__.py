"""ZoneEnv: the Point robot among coloured discs, after LTL2Action, T2TL and DeepLTL, built on Safety-Gym."""

from envs.zones.config import EPISODE_LENGTH, OPEN, OPEN_6, OPEN_8, OPEN_10, ZoneConfig
from envs.zones.zone_env import FAILURE_REWARD, LEAVING_REWARD, ZoneEnv, ZoneParams, ZoneState
from t2tl_jax.registry import register_env

__all__ = [
    "EPISODE_LENGTH",
    "FAILURE_REWARD",
    "LEAVING_REWARD",
    "OPEN",
    "OPEN_6",
    "OPEN_8",
    "OPEN_10",
    "ZoneConfig",
    "ZoneEnv",
    "ZoneParams",
    "ZoneState",
]

register_env(
    "zones",
    ZoneConfig,
    ZoneEnv,
    {
        # Under their published names.
        "Zones-25-v1": ZoneConfig(),
        "Zones-5-v0": ZoneConfig(layout="random"),
        "PointLtl2-v0": OPEN,
        # GenZ-LTL's levels 3 to 5.
        "PointLtl2-6-colours": OPEN_6,
        "PointLtl2-8-colours": OPEN_8,
        "PointLtl2-10-colours": OPEN_10,
    },
)
