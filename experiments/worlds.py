"""What the seeds of a run stand for beside chance: runs that share it are compared seed by seed."""

from functools import cache
from typing import Any

import jax
import numpy as np

from t2tl_jax.errors import UserError
from t2tl_jax.registry import make_env
from t2tl_jax.runs.config import Config


def worlds(config: Config, seeds: tuple[int, ...]) -> Any:
    """The environment's configuration, where its maps differ by seed; None where a seed is nothing but a random number.

    Args:
        config: of a run.
        seeds: its seeds.
    """
    return _worlds(config.env, seeds)


@cache
def _worlds(described: Any, seeds: tuple[int, ...]) -> Any:
    """The same for what describes an environment, which many runs share."""
    try:
        env = make_env(described)
        maps = [jax.tree.leaves(env.make_params(seed)) for seed in seeds[:2]]
    except (UserError, ValueError):  # an environment that was given as an object, or a seed without a map
        return None
    differ = len(maps) > 1 and any(not np.array_equal(a, b) for a, b in zip(*maps, strict=True))
    return described if differ else None
