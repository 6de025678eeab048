"""Pools that are drawn by several processes, for those that change faster than one core can draw them.

They are the same pools: which formulas one holds depends on its number and the configuration alone.
"""

import os
import signal
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from importlib import import_module
from multiprocessing import connection, get_context, parent_process
from threading import Thread

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
    ends."""
    sent = Sent(tuple(env.propositions), env.alphabet, named_families(), modules_of_families())
    return ProcessPoolExecutor(
        max_workers=config.run.pool_processes,
        mp_context=get_context("spawn"),  # a fork would take locks along that other threads of this process hold
        initializer=ImportedQuietly(__name__, _begin.__name__),
        initargs=(config, sent),
    )


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
