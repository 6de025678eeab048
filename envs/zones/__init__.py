"""ZoneEnv: the Point robot among coloured discs, after the environment of LTL2Action and T2TL built on Safety-Gym."""

from envs.zones.config import EPISODE_LENGTH, ZoneConfig
from envs.zones.zone_env import FAILURE_REWARD, ZoneEnv, ZoneParams, ZoneState
from t2tl_jax.registry import register_env

__all__ = ["EPISODE_LENGTH", "FAILURE_REWARD", "ZoneConfig", "ZoneEnv", "ZoneParams", "ZoneState"]

# Under their published names.
register_env("zones", ZoneConfig, ZoneEnv, {"Zones-25-v1": ZoneConfig(), "Zones-5-v0": ZoneConfig(layout="random")})
