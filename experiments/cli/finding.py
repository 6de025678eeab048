"""While the processes of a run over several hosts look for each other: what each waits for, and why that is in vain.

JAX looks for five minutes and then aborts the process, without a word on where it looked.
"""

import os
import socket
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from experiments.cli.errors import INVALID

SOON = 10.0
"""Seconds after which something is said."""


@contextmanager
def told() -> Iterator[None]:
    """Say on stderr where the first process is looked for, if the block, in which that is done, takes long.

    If that place has a name that leads nowhere, this process ends at once, with exit code 2.
    """
    found = threading.Event()
    threading.Thread(target=_tell, args=(found,), name="finding", daemon=True).start()
    try:
        yield
    finally:
        found.set()


def _tell(found: threading.Event) -> None:
    if found.wait(SOON):
        return
    from jax._src.distributed import global_state as state  # of which JAX shows no more than whether it is done

    address, index, count = state.coordinator_address, state.process_id, state.num_processes
    if not address:  # who is who is not known yet
        return
    host, _, port = address.rpartition(":")
    problem = unknown(host.strip("[]"), port)
    if problem:
        words = (
            f"error: process {index} looks for the first one at {address}, and this host knows no such name: {problem}"
        )
        print(words, file=sys.stderr, flush=True)
        os._exit(INVALID)
    print(
        f"process {index} of {count or 'several'} waits for the others, up to five minutes; the first one is looked "
        f"for at {address}, which has to be its host for all of them, with a port that is free there",
        file=sys.stderr,
        flush=True,
    )


def unknown(host: str, port: str) -> str:
    """Why a name leads nowhere; '' for one that leads somewhere."""
    try:
        socket.getaddrinfo(host, port)
    except OSError as error:
        return str(error)
    return ""
