"""Environments by name."""

from envs.base import LabelledEnv
from envs.single_state import SingleState, SingleStateConfig
from envs.waterworld import LETTERS, WaterWorld, WaterWorldConfig
from envs.zones import ZoneConfig, ZoneEnv
from t2tl_jax.names import nearest

EnvConfig = ZoneConfig | WaterWorldConfig | SingleStateConfig
"""Configurations of the environments that are registered here."""

CONFIGS: dict[str, EnvConfig] = {
    "Zones-25-v1": ZoneConfig(),
    "Zones-5-v0": ZoneConfig(layout="random"),
    "WaterWorld": WaterWorldConfig(),
    "WaterWorld-random": WaterWorldConfig(layout="random"),
    # The original's worlds: six colours, labels one step late.
    **{f"Water-M{i}-v0": WaterWorldConfig(colours=LETTERS, map_number=i, delay=1) for i in range(11)},
    "SingleState": SingleStateConfig(),
}
"""Configurations by name: ``Zones-*`` and ``Water-M*`` are the published names."""


def make(name_or_config: str | EnvConfig) -> LabelledEnv:
    """Build an environment from a registered name or from its configuration.

    Raises:
        ValueError: for an unknown name, with the nearest known one.
    """
    if isinstance(name_or_config, ZoneConfig):
        return ZoneEnv(name_or_config)
    if isinstance(name_or_config, WaterWorldConfig):
        return WaterWorld(name_or_config)
    if isinstance(name_or_config, SingleStateConfig):
        return SingleState(name_or_config)
    if name_or_config not in CONFIGS:
        raise ValueError(
            f"unknown environment {name_or_config!r}; did you mean {nearest(name_or_config, CONFIGS)!r}? "
            f"Known: {', '.join(sorted(CONFIGS))}"
        )
    return make(CONFIGS[name_or_config])
