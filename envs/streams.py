"""Which random numbers maps are drawn by on the host: others for every seed and for every purpose."""

from t2tl_jax.env import Purpose

_NUMBERS: dict[Purpose, int] = {"training": 1, "evaluation": 0, "selection": 2}


def stream(pool_seed: int, seed: int, purpose: Purpose, renewal: int = 0) -> tuple[int, ...]:
    """What ``numpy.random.default_rng`` takes; different for different arguments.

    Args:
        pool_seed: of the environment's configuration; another number gives other maps throughout.
        seed: number of the seed of a run.
        purpose: what the maps are for.
        renewal: how often they were renewed.
    """
    first = (pool_seed, seed, _NUMBERS[purpose])
    return (*first, renewal) if renewal else first
