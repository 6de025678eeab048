"""Devices: seeds are spread over them first, and the environments of every seed over those that are left.

All arrays of a training state lead with the seeds, and a learner names the arrays that lead with environments or
samples by `over_envs`, and by `on_each` those that every device needs as a whole. The compiler does the rest: each
device steps its environments and differentiates its share of a batch, and the gradients are summed. Results are those
of one device, up to the order of such sums.

Where seeds do not share out evenly, the last one is trained several times over to fill the devices up. These copies are
made on the way to the devices (`padded`) and dropped on the way back (`Program.unpadded`); nothing else knows of them.

The devices may be those of several processes on several hosts (`hosts.py`). Each process then has all values on its way
to the devices (`put`), of which it keeps its share there, and all of them again on the way back (`fetched`).
"""

from collections.abc import Sequence
from functools import cache
from typing import Any

import jax
import numpy as np
from jax.sharding import AxisType, Mesh, NamedSharding, PartitionSpec

SEEDS, ENVS = "seeds", "envs"
"""The axes of the mesh."""


def seed_sharding(
    count: int, num_envs: int = 1, per_seed: int = 0, devices: Sequence[jax.Device] | None = None
) -> NamedSharding | None:
    """How a leading axis of `count` seeds is placed: so that no device has more to do than it must.

    Every array of a training state has the leading seed axis, so this one sharding fits the whole tree. Where the
    devices do not divide the count, and filling up is faster than to leave some of them idle, all are used.

    Args:
        count: seeds.
        num_envs: environments of a seed, which are spread evenly over devices that the seeds leave; 1 spreads none.
        per_seed: the most devices for one seed; 0 leaves the choice open: as many as there are on a CPU, where a device
            is a core, and else one, since a GPU is rarely filled by one seed.
        devices: those to use; by default all.

    Returns:
        Placement on a mesh of (seeds, envs), or None where a single device does all the work.

    Raises:
        ValueError: if there are several processes, and one of them would have nothing to do.
    """
    devices = jax.devices() if devices is None else list(devices)
    number = len(devices)
    most = per_seed or (number if devices[0].platform == "cpu" else 1)

    def envs(over_seeds: int) -> int:
        return _largest_divisor(num_envs, min(number // over_seeds, most))

    def cost(over_seeds: int) -> tuple[float, bool, int]:
        return -(-count // over_seeds) / envs(over_seeds), count % over_seeds > 0, -over_seeds

    over_seeds = min(range(1, number + 1), key=cost)
    over_envs = envs(over_seeds)
    used = over_seeds * over_envs
    busy, present = ({device.process_index for device in some} for some in (devices[:used], devices))
    if busy != present:
        raise ValueError(
            f"there is work for {used} of {number} devices ({count} seeds, {num_envs} environments each that could be "
            f"spread), which leaves {len(present - busy)} of {len(present)} hosts idle: take more seeds or fewer hosts"
            + (", or spread each seed (--run.devices-per-seed)" if num_envs > 1 and most == 1 else "")
        )
    if used == 1:
        return None
    mesh = Mesh(np.array(devices[:used]).reshape(over_seeds, over_envs), (SEEDS, ENVS), axis_types=(AxisType.Auto,) * 2)
    return NamedSharding(mesh, PartitionSpec(SEEDS))


def _largest_divisor(number: int, most: int) -> int:
    return max(n for n in range(1, most + 1) if number % n == 0)


def over_envs(tree: Any) -> Any:
    """The same arrays, their leading axis (environments, or samples of a batch) spread over a seed's devices.

    Where they do not divide it, the compiler fills it up.
    """
    return _constrained(tree, PartitionSpec(ENVS))


def on_each(tree: Any) -> Any:
    """The same arrays, whole on each of a seed's devices."""
    return _constrained(tree, PartitionSpec())


def _constrained(tree: Any, spec: PartitionSpec) -> Any:
    mesh = jax.sharding.get_abstract_mesh()
    if mesh.empty or mesh.shape.get(ENVS, 1) == 1:
        return tree
    return jax.tree.map(lambda x: jax.lax.with_sharding_constraint(x, spec), tree)


def lanes(count: int, sharding: NamedSharding | None) -> int:
    """How many seeds the program trains where `count` are wanted: as many for each device."""
    over = 1 if sharding is None else sharding.mesh.shape[SEEDS]
    return -(-count // over) * over


def padded(tree: Any, sharding: NamedSharding | None) -> Any:
    """A tree with a leading seed axis, filled up with its last entry to as many as the devices need."""

    def fill(x: Any) -> Any:
        count, filled = len(x), lanes(len(x), sharding)
        return x if filled == count else x[np.minimum(np.arange(filled), count - 1)]

    return jax.tree.map(fill, tree)


def place(tree: Any, sharding: NamedSharding | None) -> Any:
    """Move a tree with a leading seed axis to its devices, filled up; one copy in every case, never a view."""
    if sharding is None:
        return jax.tree.map(lambda x: jax.numpy.array(x, copy=True), tree)
    return put(padded(tree, sharding), sharding)


def put(tree: Any, sharding: NamedSharding | None) -> Any:
    """A tree of the host on its devices, of which other processes may have some; what lies there already stays."""
    if sharding is None or sharding.is_fully_addressable:
        return jax.device_put(tree, sharding)
    return jax.tree.map(lambda x: _put(x, sharding), tree)


def _put(x: Any, sharding: NamedSharding) -> jax.Array:
    """Without a word between the processes, which `jax.device_put` would compare the values with."""
    if isinstance(x, jax.Array) and not x.is_fully_addressable:
        return x
    if is_key(x):
        return jax.random.wrap_key_data(_put(jax.random.key_data(x), sharding), impl=jax.random.key_impl(x))
    values = np.asarray(x)
    return jax.make_array_from_callback(values.shape, sharding, lambda index: values[index])


def fetched(tree: Any) -> Any:
    """A tree of arrays on the host; of arrays that other processes have parts of, all parts. Keys stay what they are.

    Where there are several processes, all of them must call it.
    """

    def whole(x: Any) -> Any:
        if not isinstance(x, jax.Array) or x.is_fully_addressable:
            return x
        if is_key(x):
            return jax.random.wrap_key_data(whole(jax.random.key_data(x)), impl=jax.random.key_impl(x))
        assert isinstance(x.sharding, NamedSharding)  # as all programs here are told
        return _replicated(x.sharding.mesh)(x).addressable_data(0)

    return jax.device_get(jax.tree.map(whole, tree))


@cache
def _replicated(mesh: Mesh) -> Any:
    """A function that has an array whole on every device: one array at a time, since there must be room for it."""
    return jax.jit(lambda x: x, out_shardings=NamedSharding(mesh, PartitionSpec()))


def is_key(x: Any) -> bool:
    """Whether an array is of typed keys."""
    return jax.dtypes.issubdtype(x.dtype, jax.dtypes.prng_key)
