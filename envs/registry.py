"""Environments by name."""

import difflib
from collections.abc import Callable

from envs.single_state import SingleState, SingleStateConfig
from envs.waterworld import LETTERS, WaterWorld, WaterWorldConfig
from envs.zones import ZoneConfig, ZoneEnv
from t2tl_jax.env import EnvConfig, LabelledEnv

KINDS: dict[type[EnvConfig], Callable[..., LabelledEnv]] = {
    ZoneConfig: ZoneEnv,
    WaterWorldConfig: WaterWorld,
    SingleStateConfig: SingleState,
}
"""What builds the environment of each kind of configuration."""

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
        ValueError: for an unknown name, with the nearest known one, or a configuration of another kind.
    """
    if isinstance(name_or_config, EnvConfig):
        if type(name_or_config) not in KINDS:
            known = ", ".join(kind.__name__ for kind in KINDS)
            raise ValueError(f"no environment goes with {type(name_or_config).__name__}; known: {known}")
        return KINDS[type(name_or_config)](name_or_config)
    if name_or_config not in CONFIGS:
        near = difflib.get_close_matches(name_or_config, CONFIGS, n=1, cutoff=0.0)
        raise ValueError(
            f"unknown environment {name_or_config!r}; did you mean {near[0]!r}? Known: {', '.join(sorted(CONFIGS))}"
        )
    return make(CONFIGS[name_or_config])
