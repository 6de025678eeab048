"""Pools that are drawn by several processes, for those that change faster than one core can draw them.

They are the same pools: which formulas one holds depends on its number and the configuration alone.
"""

import os
import signal
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib import import_module
from multiprocessing import connection, get_context, parent_process
from threading import Thread, current_thread, main_thread

import jax
import numpy as np

from t2tl_jax.ltl import TaskFamily, TaskTable, name_family, named_families
from t2tl_jax.ltl.families import modules_of_families
from t2tl_jax.quiet import ImportedQuietly
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.pools import Letters, Pools


@dataclass(frozen=True)
class Sent:
    """What a process is told of the environment, and of the families that this one knows."""

    propositions: tuple[str, ...]
    alphabet: str
    families: dict[str, TaskFamily]
    modules: tuple[str, ...]


def executor(config: Config, env: Letters) -> ProcessPoolExecutor:
    """As many processes as `config.run.pool_processes` says, for `draw`. They end with this process, however it
    ends, and Ctrl-C is nothing to them."""
    sent = Sent(tuple(env.propositions), env.alphabet, named_families(), modules_of_families())
    workers = ProcessPoolExecutor(
        max_workers=config.run.pool_processes,
        mp_context=get_context("spawn"),  # a fork would take locks along that other threads of this process hold
        initializer=ImportedQuietly(__name__, _begin.__name__),
        initargs=(config, sent),
    )
    # A submission starts a process where all are busy, and the first ones are, with their imports. One that fails
    # already is told by whoever asks for a pool.
    with _interrupts_ignored(), suppress(BrokenExecutor):
        for _ in range(config.run.pool_processes):
            workers.submit(os.getpid)
    return workers


@contextmanager
def _interrupts_ignored() -> Iterator[None]:
    """Processes that start within ignore SIGINT from their first moment on, since Python leaves that as it was; those
    of other threads than the main one, which may set no handler, once they `_begin`."""
    handler = signal.getsignal(signal.SIGINT)
    if current_thread() is not main_thread() or handler is None:  # None cannot be put back
        yield
        return
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)


def draw(number: int) -> TaskTable:
    """The pool that training has by this number, of NumPy arrays. Called in a process of `executor`."""
    table: TaskTable = jax.tree.map(np.asarray, _pools[0].training(number))
    return table


_pools: list[Pools] = []


def _begin(config: Config, sent: Sent) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever interrupts the run means the process that trains
    Thread(target=_end_with_parent, daemon=True).start()
    jax.config.update("jax_platforms", "cpu")  # accelerators are for the process that trains
    for module in sent.modules:
        if module != "__main__":  # which every process of a script begins with
            import_module(module)
    for name, family in sent.families.items():
        name_family(name, family)
    _pools.append(Pools(config, sent))


def _end_with_parent() -> None:
    parent = parent_process()
    assert parent is not None  # this runs in a child
    connection.wait([parent.sentinel])
    os._exit(1)
