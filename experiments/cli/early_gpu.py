"""Make the GPU ready while Python's modules load, which takes longer. Only entry points do this, never the library.

JAX takes half a second to find an H200, and two more for the first array that it puts there, probably since only then
it sets aside the memory of the GPU. What that saves says docs/performance.md. A process does not end before the thread
has: a mistake is told at once, but its exit code may come as much later as the GPU takes longer than the modules.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from experiments.cli.plugins import FLAG
from t2tl_jax.flags import HELP
from t2tl_jax.registry import others_declare_plugins

NOT_WITH = frozenset((FLAG, "--list", "--workers", *HELP))
"""Flags with which a command does not begin early: a user's module may choose devices, and the others need none."""


def begin_for(arguments: Sequence[str], alone: bool = True) -> Callable[[], Any]:
    """What `begin` does, for a command that trains; does nothing where something else has to come first.

    Args:
        arguments: of the command line.
        alone: False where the processes of a run have to find each other first.
    """
    if not alone or any(word.partition("=")[0] in NOT_WITH for word in arguments) or others_declare_plugins():
        return lambda: None
    from experiments.cli import cpu_devices

    cpu_devices.use()  # which cannot be done later
    return begin()


def begin() -> Callable[[], Any]:
    """Begin, in a thread of its own.

    Returns:
        A function that waits until the GPU is ready, or else the CPU, and raises what went wrong. To be called before
        anything is computed: where a GPU fails, JAX raises that once and then goes on with the CPU.
    """
    import jax
    import numpy as np

    from t2tl_jax.training.compiler_options import compiler_options

    def make_ready() -> None:
        jax.device_put(np.zeros(1)).block_until_ready()
        compiler_options()  # tries which of them its compiler knows, and remembers

    one = ThreadPoolExecutor(max_workers=1, thread_name_prefix="early GPU")
    ready = one.submit(make_ready)
    one.shutdown(wait=False)
    return ready.result
