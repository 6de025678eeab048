"""Which random numbers maps are drawn by on the host: others for every seed and for every purpose."""

from typing import Literal, TypeVar

import jax

from t2tl_jax.env import Purpose

Maps = TypeVar("Maps")

_NUMBERS: dict[Purpose | Literal["certificate"], int] = {
    "training": 1,
    "evaluation": 0,
    "selection": 2,
    "certificate": 3,
}


def stream(pool_seed: int, seed: int, purpose: Purpose | Literal["certificate"], renewal: int = 0) -> tuple[int, ...]:
    """What ``numpy.random.default_rng`` takes; different for different arguments.

    Args:
        pool_seed: of the environment's configuration; another number gives other maps throughout.
        seed: number of the seed of a run.
        purpose: what the maps are for.
        renewal: how often they were renewed.
    """
    first = (pool_seed, seed, _NUMBERS[purpose])
    return (*first, renewal) if renewal else first


def one_each(pool: Maps) -> Maps:
    """A pool of maps, a tree of arrays ``[count, ...]``, as stacked pools of a single map: ``[count, 1, ...]``."""
    return jax.tree.map(lambda part: part[:, None], pool)
