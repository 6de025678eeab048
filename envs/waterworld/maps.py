"""Where a WaterWorld episode starts: the published numbered maps on the host, and maps drawn inside a jitted program.

Both follow the rule of the original. A coordinate of a centre is uniform from two radii up to the *far wall*, so that a
body may start overlapping that wall. The agent comes first, then ball after ball in the order of colours: a direction,
then places until one is free, that is, touches no ball placed before and keeps twice the touching distance from the
agent. Radii that differ between colours are not in the original; they enter the rule in the obvious way.
"""

import math
import random
from collections.abc import Sequence
from functools import lru_cache

import jax
import jax.numpy as jnp
import numpy as np

from envs.waterworld.params import Start, WaterWorldParams

DRAWS_PER_BALL = 1000
"""Places tried for one ball, after which everything is placed anew. The original would go on for ever."""

RESTARTS = 100
"""Attempts at a whole map, after which the balls are declared impossible to place."""

Placing = tuple[jax.Array, jax.Array, jax.Array, jax.Array]
"""Proposals so far, bodies placed, proposals for the present body, places ``[1 + n, 2]`` (the agent first)."""


def numbered_map(number: int, radii: Sequence[float], agent_radius: float, arena: tuple[float, float]) -> Start:
    """Map ``number``, in float64: for the six colours of the original exactly its published map of that number.

    The draws come from CPython's generator, seeded with the number, in the order of the original.

    Args:
        number: any integer.
        radii: of every ball, in their order.
        agent_radius: in the same units.
        arena: width and height.

    Raises:
        ValueError: if the balls do not fit.
    """
    generator = random.Random(number)
    for _ in range(RESTARTS):
        start = _try_map(generator, radii, agent_radius, arena)
        if start is not None:
            return start
    raise ValueError(
        f"{len(radii)} balls with radii {min(radii):g} to {max(radii):g} cannot be placed in an arena of "
        f"{arena[0]:g} x {arena[1]:g}: use fewer or smaller balls, or a larger arena"
    )


@lru_cache(maxsize=64)
def map_pool(
    first: int, count: int, radii: tuple[float, ...], agent_radius: float, arena: tuple[float, float]
) -> Start:
    """The numbered maps ``first`` to ``first + count - 1``, stacked, in float32; ValueError if the balls do not fit.

    A pool takes a good part of a second and is asked for in every call without parameters, so the last ones are kept.
    """
    maps = [numbered_map(first + i, radii, agent_radius, arena) for i in range(count)]
    return Start(*(np.stack(part).astype(np.float32) for part in zip(*maps, strict=True)))


def _try_map(
    generator: random.Random, radii: Sequence[float], agent_radius: float, arena: tuple[float, float]
) -> Start | None:
    """One attempt at a map; None when a ball finds no place."""

    def place(radius: float) -> tuple[float, float]:
        x = 2 * radius + generator.random() * (arena[0] - 2 * radius)
        y = 2 * radius + generator.random() * (arena[1] - 2 * radius)
        return x, y

    agent = place(agent_radius)
    balls: list[tuple[float, float]] = []
    directions: list[tuple[float, float]] = []
    for radius in radii:
        angle = generator.random() * 2 * math.pi
        directions.append((math.sin(angle), math.cos(angle)))  # drawn once, however often the place is
        for _ in range(DRAWS_PER_BALL):
            centre = place(radius)
            clear_of_balls = all(math.dist(centre, b) >= radius + r for b, r in zip(balls, radii, strict=False))
            if clear_of_balls and math.dist(centre, agent) > 2 * (radius + agent_radius):
                balls.append(centre)
                break
        else:
            return None
    return Start(np.array(agent), np.array(balls), np.array(directions))


def random_map(key: jax.Array, radii: jax.Array, params: WaterWorldParams) -> Start:
    """A map by the same rule, drawn inside a jitted program.

    One loop proposes a place for the next body until all are placed, so that in a batch a late ball of one environment
    and an early one of another share an iteration: 16 balls take some 20 iterations alone and 50 in a large batch.

    Args:
        key: typed or legacy key.
        radii: ``float32[n]`` of every ball.
        params: the other sizes; may be traced.

    Returns:
        The start. After 100,000 proposals, for balls that hardly fit, the rest is placed without regard to the rule.
    """
    place_key, angle_key = jax.random.split(key)
    num_bodies = len(radii) + 1
    bodies = jnp.arange(num_bodies)
    sizes = jnp.concatenate([params.agent_radius[None], radii])

    def propose(carry: Placing) -> Placing:
        count, placed, tries, places = carry
        unit = jax.random.uniform(jax.random.fold_in(place_key, count), (2,), radii.dtype)
        is_next = bodies == placed  # selects by comparison: a gather and a scatter per iteration would be slower
        radius = jnp.where(is_next, sizes, 0.0).sum()
        centre = 2 * radius + unit * (params.arena - 2 * radius)
        offset = places - centre
        distance = jnp.sqrt(offset[:, 0] ** 2 + offset[:, 1] ** 2)
        touching = sizes + radius
        clear = jnp.where(bodies == 0, distance > 2 * touching, distance >= touching)
        free = (clear | (bodies >= placed)).all() | (count >= DRAWS_PER_BALL * RESTARTS)
        places = jnp.where((is_next & free)[:, None], centre, places)
        placed = jnp.where(free, placed + 1, jnp.where(tries >= DRAWS_PER_BALL, 0, placed))
        tries = jnp.where(free | (tries >= DRAWS_PER_BALL), 0, tries + 1)
        return count + 1, placed, tries, places

    first = (jnp.int32(0), jnp.int32(0), jnp.int32(0), jnp.zeros((num_bodies, 2), radii.dtype))
    places = jax.lax.while_loop(lambda carry: carry[1] < num_bodies, propose, first)[3]
    angles = jax.random.uniform(angle_key, radii.shape, radii.dtype, 0.0, 2 * math.pi)
    return Start(places[0], places[1:], jnp.stack([jnp.sin(angles), jnp.cos(angles)], axis=-1))
