"""Environments by name."""

import difflib

from envs.base import LabelledEnv
from envs.zones import ZoneConfig, ZoneEnv

CONFIGS: dict[str, ZoneConfig] = {
    "Zones-25-v1": ZoneConfig(),
    "Zones-5-v0": ZoneConfig(layout="random"),
}
"""Configurations under their published names."""


def make(name_or_config: str | ZoneConfig) -> LabelledEnv:
    """Build an environment from a registered name or from its configuration.

    Raises:
        ValueError: for an unknown name, with the nearest known one.
    """
    if not isinstance(name_or_config, str):
        return ZoneEnv(name_or_config)
    if name_or_config not in CONFIGS:
        near = difflib.get_close_matches(name_or_config, CONFIGS, n=1, cutoff=0.0)
        raise ValueError(
            f"unknown environment {name_or_config!r}; did you mean {near[0]!r}? Known: {', '.join(sorted(CONFIGS))}"
        )
    return ZoneEnv(CONFIGS[name_or_config])
