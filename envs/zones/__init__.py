"""ZoneEnv: the Point robot among coloured discs, after the environment of LTL2Action and T2TL built on Safety-Gym."""

from envs.zones.zone_env import EPISODE_LENGTH, FAILURE_REWARD, ZoneConfig, ZoneEnv, ZoneState

__all__ = ["EPISODE_LENGTH", "FAILURE_REWARD", "ZoneConfig", "ZoneEnv", "ZoneState"]
