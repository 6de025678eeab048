"""Where the coloured discs of a ZoneEnv map lie: the published map, and random maps by the published rejection rule.

Everything here is host-side numpy. A random map is never drawn inside a jitted program: a pool of maps is sampled once,
and a reset picks one of them.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

ZONE_RADIUS = 0.25
"""Radius of the published map's discs in metres; a disc is entered at this distance from its centre, inclusive."""

COLOURS = {
    "J": "Black",
    "W": "White",
    "B": "Blue",
    "G": "Green",
    "R": "Red",
    "Y": "Yellow",
    "C": "Cyan",
    "M": "Magenta",
    "O": "Orange",
    "P": "Purple",
    "L": "Lime",
    "T": "Teal",
}
"""Proposition of each colour's letter, in the order in which propositions are listed."""

FIXED_COLOURS = "JJJRRWWWYYY"
"""Colours of the eleven discs of the published map."""

FIXED_ZONES = (
    (0.0, 0.0),
    (1.0, 0.5),
    (-1.0, 2.0),
    (-0.5, -1.0),
    (0.75, -0.5),
    (-1.5, -1.0),
    (-1.0, 0.5),
    (0.5, 1.0),
    (-0.5, 1.0),
    (-0.5, -2.0),
    (1.0, 2.0),
)
"""Disc centres of the published map, in metres."""

FIXED_START = (0.0, -1.5, 2.0)
"""Robot position in metres and heading in radians at the start of every episode on the published map."""

RANDOM_COLOURS = "JJRRWWYY"
"""Colours of the eight discs of the published random maps."""

ARENA = 2.5
"""Half the side of the square in which objects are placed, in metres."""

ZONE_KEEPOUT = 0.55
"""Metres that a disc's centre keeps from the arena's edge, and adds to its distance from other objects; as published
for up to twelve discs."""

GAP = 1e-5
"""Metres that lie between two discs at least, however small their keepout is: no rounding lets them share a point."""

ROBOT_KEEPOUT = 0.4
"""The same for the robot."""

DRAWS_PER_OBJECT = 100
"""Draws after which an object counts as unplaceable and its whole layout is dropped."""

LAYOUTS_PER_RESET = 10_000
"""Dropped layouts after which the colours are declared impossible to place."""


class Layouts(NamedTuple):
    """A pool of maps."""

    robots: np.ndarray
    """``float32[pool, 2]``: start positions of the robot in metres."""
    zones: np.ndarray
    """``float32[pool, n, 2]``: disc centres in metres."""


@lru_cache(maxsize=64)
def sample_layouts(
    num_zones: int,
    pool_size: int,
    seed: int | tuple[int, ...],
    radius: float = ZONE_RADIUS,
    keepout: float = ZONE_KEEPOUT,
) -> Layouts:
    """Draw ``pool_size`` random maps with ``num_zones`` discs each; the last pools asked for are kept.

    The rule is that of Safety-Gym: the robot first, then disc after disc, each uniform in the arena shrunk by its own
    keepout, redrawn until it keeps the sum of both keepouts from everything already placed. A layout in which an object
    finds no place in 100 draws is dropped as a whole. The walls need no check, the shrunk rectangle respects them.

    Args:
        num_zones: discs of a map.
        pool_size: how many maps.
        seed: what they are drawn by.
        radius: of the discs, in metres.
        keepout: of the discs, in metres.

    Raises:
        ValueError: if 10,000 layouts in a row fail, that is, if the discs do not fit.
    """
    rng = np.random.default_rng(seed)
    found: list[np.ndarray] = []
    num_found = dropped = 0
    while num_found < pool_size:
        batch = _attempt_layouts(rng, num_zones, min(1024, 2 * pool_size), radius, keepout)
        dropped = 0 if len(batch) else dropped + min(1024, 2 * pool_size)
        if dropped >= LAYOUTS_PER_RESET:
            raise ValueError(
                f"{num_zones} zones cannot be placed: {dropped:,} random layouts in a row failed to keep "
                f"{2 * keepout:.2f} m between centres in the {2 * ARENA:g} m arena. Use fewer zones (with a keepout of "
                f"{ZONE_KEEPOUT} up to 11 are found quickly) or a smaller keepout."
            )
        found.append(batch)
        num_found += len(batch)
    pool = np.concatenate(found)[:pool_size].astype(np.float32)
    return Layouts(robots=pool[:, 0], zones=pool[:, 1:])


def _attempt_layouts(
    rng: np.random.Generator,
    num_zones: int,
    attempts: int,
    radius: float = ZONE_RADIUS,
    zone_keepout: float = ZONE_KEEPOUT,
) -> np.ndarray:
    """Those of ``attempts`` layouts that succeed: ``float64[successes, 1 + num_zones, 2]``, the robot first."""
    placed = np.empty((attempts, 0, 2))
    keepouts: list[float] = []
    for keepout in [ROBOT_KEEPOUT] + [zone_keepout] * num_zones:
        limit = ARENA - keepout
        draws = rng.uniform(-limit, limit, (len(placed), DRAWS_PER_OBJECT, 2))
        least = np.array(keepouts) + keepout
        least[1:] = np.maximum(least[1:], 2 * radius + GAP)
        first = _first_free(draws, placed, least)
        alive = first >= 0
        chosen = draws[alive, first[alive]]
        placed = np.concatenate([placed[alive], chosen[:, None]], axis=1)
        keepouts.append(keepout)
        if not len(placed):
            break
    return placed.reshape(-1, 1 + num_zones, 2)


def _first_free(draws: np.ndarray, placed: np.ndarray, least: np.ndarray) -> np.ndarray:
    """Which draw of each layout is the first that keeps its distances: ``int[layouts]``, -1 where none does.

    Most layouts need a few draws only, so the later ones are looked at where they are needed.

    Args:
        draws: ``float[layouts, draws, 2]``.
        placed: ``float[layouts, k, 2]``, what lies there already.
        least: ``float[k]``, how far away from each of these.
    """
    first = np.full(len(draws), -1)
    for begin, end in ((0, 4), (4, 20), (20, DRAWS_PER_OBJECT)):
        waiting = np.flatnonzero(first < 0)
        if not len(waiting):
            break
        x, y = np.moveaxis(draws[waiting, begin:end], -1, 0)
        free = np.ones(x.shape, bool)
        for other, distance in zip(np.moveaxis(placed[waiting], 1, 0), least, strict=True):
            free &= (x - other[:, :1]) ** 2 + (y - other[:, 1:]) ** 2 >= distance**2
        first[waiting] = np.where(free.any(1), begin + free.argmax(1), -1)
    return first


def check_disjoint(zones: np.ndarray, radius: float = ZONE_RADIUS) -> None:
    """Make sure that at most one label holds at a time: no two discs of a map may share a point.

    Args:
        zones: ``float[..., n, 2]`` disc centres in metres.
        radius: of the discs, in metres.

    Raises:
        ValueError: if two centres are no more than two radii apart.
    """
    num_zones = zones.shape[-2]
    if num_zones < 2:
        return
    first, second = np.triu_indices(num_zones, 1)
    nearest = np.linalg.norm(zones[..., first, :] - zones[..., second, :], axis=-1).min()
    if nearest <= 2 * radius:
        raise ValueError(f"two zones overlap: their centres are {nearest:.3f} m apart, they need > {2 * radius:g} m")
