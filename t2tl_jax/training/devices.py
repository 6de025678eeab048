"""Devices: seeds are spread over them first, and the environments of every seed over those that are left.

All arrays of a training state lead with the seeds, and a learner names the arrays that lead with environments or
samples by `over_envs`. The compiler does the rest: each device steps its environments and differentiates its share of
a minibatch, and the gradients are summed. Results are those of one device, up to the order of such sums.
"""

from collections.abc import Sequence
from typing import Any

import jax
import numpy as np
from jax.sharding import AxisType, Mesh, NamedSharding, PartitionSpec

SEEDS, ENVS = "seeds", "envs"
"""The axes of the mesh."""


def seed_sharding(
    count: int, num_envs: int = 1, per_seed: int = 0, devices: Sequence[jax.Device] | None = None
) -> NamedSharding | None:
    """How a leading axis of `count` seeds is placed: evenly, over as many devices as divide the count.

    Every array of a training state has the leading seed axis, so this one sharding fits the whole tree.

    Args:
        count: seeds.
        num_envs: environments of a seed, which are spread evenly over devices that the seeds leave; 1 spreads none.
        per_seed: the most devices for one seed; 0 leaves the choice open: as many as there are on a CPU, where a device
            is a core, and else one, since a GPU is rarely filled by one seed.
        devices: those to use; by default all.

    Returns:
        Placement on a mesh of (seeds, envs), or None where a single device does all the work.
    """
    devices = jax.devices() if devices is None else list(devices)
    over_seeds = _largest_divisor(count, len(devices))
    left = len(devices) // over_seeds
    most = per_seed or (left if devices[0].platform == "cpu" else 1)
    over_envs = _largest_divisor(num_envs, min(most, left))
    used = over_seeds * over_envs
    if used == 1:
        return None
    mesh = Mesh(np.array(devices[:used]).reshape(over_seeds, over_envs), (SEEDS, ENVS), axis_types=(AxisType.Auto,) * 2)
    return NamedSharding(mesh, PartitionSpec(SEEDS))


def _largest_divisor(number: int, most: int) -> int:
    return max(n for n in range(1, most + 1) if number % n == 0)


def over_envs(tree: Any) -> Any:
    """The same arrays, their leading axis (environments, or samples of a minibatch) spread over a seed's devices."""
    return _constrained(tree, PartitionSpec(ENVS))


def on_each(tree: Any) -> Any:
    """The same arrays, whole on each of a seed's devices."""
    return _constrained(tree, PartitionSpec())


def _constrained(tree: Any, spec: PartitionSpec) -> Any:
    mesh = jax.sharding.get_abstract_mesh()
    if mesh.empty or mesh.shape.get(ENVS, 1) == 1:
        return tree
    return jax.tree.map(lambda x: jax.lax.with_sharding_constraint(x, spec), tree)


def place(tree: Any, sharding: NamedSharding | None) -> Any:
    """Move a tree with a leading seed axis to its devices; one copy in every case, never a view of host memory."""
    if sharding is None:
        return jax.tree.map(lambda x: jax.numpy.array(x, copy=True), tree)
    return jax.device_put(tree, sharding)
