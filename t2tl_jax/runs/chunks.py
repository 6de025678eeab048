"""Seeds that do not fit into the memory of the devices together: they train in groups, one after another.

The state of all seeds lies on the host. In every iteration each group is moved to the devices, goes on, and is moved
back, so that everything around the training sees one iteration of all seeds. A group is a program of its own width,
and the last one is filled up (see `training/devices.py`). On a CPU both are in the same memory, so that groups save
only what programs take beside the states.
"""

import math
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import jax
import numpy as np

from t2tl_jax.errors import Note, UserError
from t2tl_jax.runs.compilation import Compilation, Compiled
from t2tl_jax.runs.experiment import Experiment
from t2tl_jax.task_env import TaskParams
from t2tl_jax.training import hosts
from t2tl_jax.training.devices import is_key, place
from t2tl_jax.training.program import Program, place_params

MOST = 0.9
"""Share of a device's memory that a program may take."""

SIZES = ("buffer_size", "num_envs")
"""Fields of learners that the memory of one seed grows with."""


def fit(experiment: Experiment, compilation: Compilation, width: int = 0) -> tuple[int, Compiled]:
    """How many seeds are on the devices together, and the program of all seeds that goes through such groups.

    As many as the configuration says, else as fit by what the compiler says, which a `Note` tells where it is not all.

    Args:
        experiment: what is trained.
        compilation: of the experiment, under way.
        width: of an earlier session, which is kept if it fits: programs of different widths round differently.

    Raises:
        UserError: if the fewest seeds, or as many as the configuration says, need more memory than a device has.
    """
    count, asked = experiment.program.count, experiment.config.run.seeds_at_once
    width = min(asked or width or count, count)
    states = size_of(experiment.program.stored)
    waiting = states // jax.local_device_count() if one_device().platform == "cpu" else 0
    while True:
        width = even(count, width)
        program = experiment.program_for(width)
        same = compilation.program.count == program.count
        compiled = (compilation if same else Compilation(program, compilation.fresh)).result()
        in_groups = width < count
        most = width if asked else hosts.least_of(fitting(compiled.iterate, width, count, waiting))
        if hosts.are_several() and min(most, width) < count:
            raise UserError(
                f"{count:,} seeds do not fit into the memory of the devices together ({min(most, width):,} may), and "
                "groups that train in turns are for a single host: take more hosts, or fewer seeds"
            )
        if most == width:
            check_room(experiment, program, compiled.iterate, states if in_groups else 0)
            return width, in_chunks(program, compiled, count) if in_groups else compiled
        width = most
        warnings.warn(
            f"{count:,} seeds do not fit into the memory of the devices together: {even(count, width):,} train side by "
            "side, and every iteration goes through all of them (--run.seeds-at-once sets the number)",
            Note,
            stacklevel=2,
        )


def even(count: int, most: int) -> int:
    """The width of the fewest groups of `most` seeds at most, as even as can be."""
    return -(-count // -(-count // most))


def fitting(compiled: Any, width: int, count: int = 0, waiting: int = 0, memory: int | None = None) -> int:
    """How many seeds fit on the devices side by side, by what the compiler says of a program for `width`; at least 1.

    As many as there are where fewer of them would not take less.

    Args:
        compiled: its iteration.
        width: its seeds.
        count: seeds in all; by default these.
        waiting: bytes of one device that the states of all take where they train in groups; 0 if they wait elsewhere.
        memory: bytes of one device; by default those that are there.
    """
    need, count = needed(compiled), count or width
    memory = device_memory() if memory is None else memory
    if need is None or memory is None:  # not told on this hardware
        return width
    room, of_seed = MOST * memory, need / width + waiting / count  # whose state is copied on its way
    takes = need if width == count else waiting + width * of_seed
    if takes <= room:
        return width
    fewer = max(1, min(width, int((room - waiting) / of_seed)))
    return fewer if waiting + fewer * of_seed < takes else width


def size_of(shapes: Any) -> int:
    """Bytes of a tree of arrays, or of their shapes and dtypes."""
    return sum(math.prod(x.shape) * x.dtype.itemsize for x in jax.tree.leaves(shapes))


def needed(compiled: Any) -> int | None:
    """Bytes that a program takes on each of its devices; None where the compiler does not say."""
    given = compiled.memory_analysis()
    if given is None:
        return None
    sizes = given.argument_size_in_bytes, given.output_size_in_bytes, given.temp_size_in_bytes
    return sum(sizes) - given.alias_size_in_bytes


def check_room(experiment: Experiment, program: Program, compiled: Any, waiting: int = 0) -> None:
    """Say so where a program that cannot be split up further needs more memory than there is.

    For the memory of the host a `Note` says it: what others have of it now they may give back.

    Args:
        experiment: what is trained.
        program: of as many seeds as train side by side.
        compiled: its iteration.
        waiting: bytes of the states of all seeds, which wait on the host; 0 where all train side by side.

    Raises:
        UserError: where it is the memory of a GPU.
    """
    need, memory, free = needed(compiled), device_memory(), host_memory()
    run, learner = experiment.config.run, experiment.config.learner
    on_cpu = one_device().platform == "cpu"
    sizes = [f"--learner.{name.replace('_', '-')}" for name in SIZES if hasattr(learner, name)]
    flags = (["--run.seeds-at-once"] if run.seeds_at_once > 1 else []) + sizes
    what = "one seed needs" if program.count == 1 else f"{program.count:,} seeds side by side need"

    def way_out(flags: list[str]) -> str:
        words = f"smaller with {' or '.join(flags)}" if flags else "make the numbers of the learner smaller"
        return f"{words}; a run that is resumed keeps these, and needs more memory"

    if need is None or memory is None:
        need = 0
    elif not on_cpu and need > memory:
        raise UserError(f"{what} {_gib(need)} of memory, and its device has {_gib(memory)}: {way_out(flags)}")
    # Of a CPU, the memory of the devices is the machine's, of which any device may take more than its share.
    used = 1 if program.sharding is None else len(program.sharding.addressable_devices)
    wanted = waiting + (need * used if on_cpu else 0)
    if free is None or wanted <= free:
        return
    if waiting:
        what = f"the states of all seeds{' and a program' if on_cpu else ', which wait on the host,'} need"
    may = f"it may be ended for it, or be slow; {way_out(flags if on_cpu else sizes)}"
    warnings.warn(
        f"{what} {_gib(wanted)} of memory, and this machine has free {_gib(free)}: {may}",
        Note,
        stacklevel=3,
    )


def _gib(size: int) -> str:
    return f"{size / 2**30:,.2f} GiB"


def one_device() -> jax.Device:
    """One of the devices of this process, which are alike."""
    return jax.local_devices()[0]


def device_memory() -> int | None:
    """Bytes that one device has for programs; None if it does not say. On a CPU, its share of what is free."""
    device = one_device()
    if device.platform != "cpu":
        return (device.memory_stats() or {}).get("bytes_limit") or None  # 0 is no limit
    free = host_memory()
    return None if free is None else free // jax.local_device_count()


def host_memory() -> int | None:
    """Bytes of this machine's memory that are free; None if it does not say."""
    try:
        with open("/proc/meminfo", encoding="utf-8") as file:
            sizes = dict(line.split(":", 1) for line in file)
        return int(sizes["MemAvailable"].split()[0]) * 1024
    except (OSError, KeyError, ValueError):
        return None


def in_chunks(program: Program, compiled: Compiled, count: int) -> Compiled:
    """The functions of a program for a group as functions of all seeds, whose states are trees on the host.

    Args:
        program: of one group.
        compiled: its functions.
        count: seeds in all.
    """
    width = program.count
    parts = [(start, min(start + width, count)) for start in range(0, count, width)]

    def each(function: Callable[..., Any], first: Any, env_params: TaskParams) -> Iterator[tuple[int, int, Any]]:
        """What a function gives for every group: its first seed, the one behind its last, and the result."""
        for start, end in parts:
            group = np.minimum(np.arange(start, start + width), count - 1)
            stacked = {name: _taken(getattr(env_params, name), group) for name in ("env", "numbers", "fault")}
            given = place(_taken(first, group), program.sharding)
            yield start, end, function(given, place_params(replace(env_params, **stacked), program.sharding))

    def init(keys: jax.Array, env_params: TaskParams) -> Any:
        state: Any = None
        for start, end, result in each(compiled.init, keys, env_params):
            state = _put(_room(result, count) if state is None else state, result, start, end)
        return state

    def iterate(state: Any, env_params: TaskParams) -> tuple[Any, Any]:
        metrics: Any = None
        for start, end, (after, own) in each(compiled.iterate, state, env_params):
            state = _put(state, after, start, end)
            metrics = _put(_room(own, count) if metrics is None else metrics, own, start, end)
        return state, metrics

    def restart(state: Any, env_params: TaskParams) -> Any:
        for start, end, after in each(compiled.restart, state, env_params):
            state = _put(state, after, start, end)
        return state

    return Compiled(init, iterate, restart, compiled.seconds)


def on_host(tree: Any) -> Any:
    """Arrays of the host that can be written to; those that are, and keys, stay what they are."""

    def own(x: Any) -> Any:
        return x if is_key(x) or (isinstance(x, np.ndarray) and x.flags.writeable) else np.array(x)

    return jax.tree.map(own, tree)


def _taken(tree: Any, index: np.ndarray) -> Any:
    return jax.tree.map(lambda x: x[index], tree)


def _room(tree: Any, count: int) -> Any:
    """For as many seeds, arrays like these."""

    def room(x: Any) -> Any:
        if not is_key(x):
            return np.empty((count, *x.shape[1:]), x.dtype)
        data = jax.random.key_data(x)
        nothing = jax.numpy.zeros((count, *data.shape[1:]), data.dtype)
        return jax.random.wrap_key_data(nothing, impl=jax.random.key_impl(x))

    return jax.tree.map(room, tree)


def _put(old: Any, new: Any, start: int, end: int) -> Any:
    """All seeds, with those of a group from the devices in their place, where they are written to."""

    def put(old: Any, new: Any) -> Any:
        if is_key(old):
            return old.at[start:end].set(jax.device_put(new[: end - start], jax.local_devices()[0]))
        old[start:end] = np.asarray(new)[: end - start]
        return old

    return jax.tree.map(put, old, new)
