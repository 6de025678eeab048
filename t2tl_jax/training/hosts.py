"""Several processes that train as one, each with its own devices: what they have to agree on, and who writes.

All of them run the same program on the same values (`jax.distributed`), and decide alike, since what they decide by is
computed alike. What is not, such as clocks and signals, they tell each other here, through the store of names that
`jax.distributed` has for its own purposes. With a single process nothing here does anything.

Those that say or ask something must be called by all processes, in the same order, and by one thread of each.
"""

import itertools
from typing import Any

from jax._src import distributed  # the store has no public name; Orbax reaches for it in the same way

PREFIX = "t2tl_jax"
"""Of our names in the store."""

PATIENCE = 7 * 24 * 3600
"""Seconds to wait for another process, which may be evaluating. Whether it is alive is watched elsewhere."""

_rounds = itertools.count()


def are_several() -> bool:
    """Whether there are other processes."""
    return count() > 1


def is_first() -> bool:
    """Whether this process is the one that writes and prints."""
    return index() == 0


def count() -> int:
    """How many processes there are, which devices need not be looked for to know."""
    return distributed.global_state.num_processes or 1


def index() -> int:
    """Which one this is."""
    return distributed.global_state.process_id


def store() -> Any:
    """The store of names, which the processes share."""
    client = distributed.global_state.client
    assert client is not None  # as jax.distributed.initialize was called
    return client


def exchanged(word: str) -> list[str]:
    """What every process says, by its index."""
    if not are_several():
        return [word]
    number, own = next(_rounds), index()
    store().key_value_set(f"{PREFIX}/said/{number}/{own}", word)
    # Who says something has read all that was said in the round before: what is two rounds old, nobody needs any more.
    if number > 1:
        store().key_value_delete(f"{PREFIX}/said/{number - 2}/{own}")
    return [store().blocking_key_value_get(f"{PREFIX}/said/{number}/{i}", PATIENCE * 1000) for i in range(count())]


def meet() -> None:
    """Wait until all processes are here."""
    exchanged("")


def any_of(fact: bool) -> bool:
    """Whether it holds in any process."""
    return fact if not are_several() else "1" in exchanged("1" if fact else "0")


def least_of(number: int) -> int:
    """The least of the processes' numbers."""
    return min(int(word) for word in exchanged(str(number)))


def of_first(word: str) -> str:
    """What the first process says."""
    return exchanged(word)[0]
