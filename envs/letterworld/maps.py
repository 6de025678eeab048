"""Maps of LetterWorld, drawn on the host: which cell holds which letter.

A map is ``int8[size, size]``: the number of each cell's letter, `EMPTY` for none. The start, cell (0, 0), is empty.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

EMPTY = -1
"""What a cell without a letter holds."""

ATTEMPTS_AT_ONCE = 16_384
"""Random placements drawn together."""

FAILED_ATTEMPTS = 500_000
"""Placements without a valid one after which the letters are declared impossible to place."""


@lru_cache(maxsize=64)
def sample_maps(size: int, num_letters: int, copies: int, count: int, seed: int | tuple[int, ...]) -> np.ndarray:
    """Draw ``int8[count, size, size]`` valid maps, uniformly; the last pools asked for are kept.

    The letters are put into random cells until the map is valid. Of the published size, 1.35 % are.

    Args:
        size: cells along each side.
        num_letters: how many letters there are.
        copies: cells with each of them.
        count: how many maps.
        seed: what they are drawn by.

    Raises:
        ValueError: if half a million placements in a row are not valid.
    """
    rng = np.random.default_rng(seed)
    taken = num_letters * copies
    found: list[np.ndarray] = []
    num_found = failed = 0
    while num_found < count:
        noise = rng.random((ATTEMPTS_AT_ONCE, size * size))
        noise[:, 0] = 2.0  # the start stays empty
        last = np.partition(noise, taken - 1)[:, taken - 1]
        noise = noise[is_valid((noise <= last[:, None]).reshape(-1, size, size))]
        failed = 0 if len(noise) else failed + ATTEMPTS_AT_ONCE
        if failed >= FAILED_ATTEMPTS:
            raise ValueError(
                f"{num_letters} letters x {copies} copies cannot be placed on a grid of {size} x {size}: of "
                f"{failed:,} random maps none lets every cell be reached past the letters; use fewer letters"
            )
        cells = np.argsort(noise)[:, :taken]
        maps = np.full(noise.shape, EMPTY, np.int8)
        np.put_along_axis(maps, cells, np.repeat(np.arange(num_letters, dtype=np.int8), copies)[None], axis=1)
        found.append(maps.reshape(-1, size, size))
        num_found += len(maps)
    return np.concatenate(found)[:count]


def is_valid(taken: np.ndarray) -> np.ndarray:
    """Whether every cell can be reached from the start on a path whose inner cells hold no letter: ``bool[n]``.

    Args:
        taken: ``bool[n, size, size]``, which cells hold a letter. The edges of the grid are joined.
    """
    free = ~taken
    # Where a cell other than the start has no free neighbour, no path leads to it. That rules out nearly all maps.
    dead_end = ~_beside(free)
    dead_end[:, 0, 0] = False
    valid = np.logical_not(dead_end.any((1, 2)))
    free = free[valid]
    reached = np.zeros_like(free)
    reached[:, 0, 0] = True
    while True:
        grown = reached | (_beside(reached) & free)
        if (grown == reached).all():
            break
        reached = grown
    valid[valid] = (reached | _beside(reached)).all((1, 2))
    return valid


def from_text(rows: Sequence[str], letters: Sequence[str]) -> np.ndarray:
    """A map, ``int8[size, size]``, from its rows, with a dot for each empty cell.

    Raises:
        ValueError: for rows that are no square, and for other letters than these.
    """
    size = len(rows)
    if not rows or any(len(row) != size for row in rows):
        raise ValueError(f"a map is a square of letters and dots, got rows of {[len(row) for row in rows]} cells")
    unknown = sorted(set("".join(rows)) - {*letters, "."})
    if unknown:
        raise ValueError(f"the map has unknown letters {', '.join(unknown)}; known are {', '.join(letters)}")
    number = {letter: index for index, letter in enumerate(letters)} | {".": EMPTY}
    return np.array([[number[cell] for cell in row] for row in rows], np.int8)


def _beside(cells: np.ndarray) -> np.ndarray:
    """Which cells have one of the given ones as a neighbour: ``bool[n, size, size]`` to the same."""
    near = np.zeros_like(cells)
    for axis in (1, 2):
        for step in (-1, 1):
            near |= np.roll(cells, step, axis)
    return near
