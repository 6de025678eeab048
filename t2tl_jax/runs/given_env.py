"""The configuration of an environment that was given as an object: a stored run keeps its name and nothing else."""

from dataclasses import dataclass
from typing import NoReturn

from t2tl_jax.env import EnvConfig
from t2tl_jax.errors import UserError
from t2tl_jax.registry import register_env


@dataclass(frozen=True)
class GivenEnv(EnvConfig):
    """Stands for an environment object."""

    name: str = ""
    """Name of its class."""


def _missing(config: GivenEnv) -> NoReturn:
    raise UserError(
        f"the environment of this run, {config.name}, was given as an object: give it again, as env=..., or register "
        "it with register_env and train it by its configuration"
    )


register_env("given", GivenEnv, _missing)
