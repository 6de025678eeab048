"""While the processes of a run over several hosts look for each other: where each looks, and whether that is known.

JAX looks for five minutes and then aborts the process, without a word on where it looked.
"""

import socket
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

SOON = 10.0
"""Seconds after which something is said."""


@contextmanager
def told() -> Iterator[None]:
    """Say on stderr where the first process is looked for, if the block, in which that is done, takes long."""
    found, speaks = threading.Event(), threading.Lock()
    threading.Thread(target=_tell, args=(found, speaks), name="finding", daemon=True).start()
    try:
        yield
    finally:
        with speaks:
            found.set()


def _tell(found: threading.Event, speaks: threading.Lock) -> None:
    from jax._src import distributed  # JAX shows no more of this than whether it is done

    while not found.wait(SOON):
        state = distributed.global_state
        if not state.coordinator_address:  # who is who is not known yet
            continue
        address, index, count = state.coordinator_address, state.process_id, state.num_processes
        problem = unknown(address)
        with speaks:
            if found.is_set() or sys.stderr is None:
                return
            print(
                f"process {index} of {count or 'several'} waits for the others, up to five minutes. It looks for the "
                f"first one at {address}, where every host must reach it; the port must be free there."
                + (f" This host does not know that name: {problem}" if problem else ""),
                file=sys.stderr,
                flush=True,
            )
        return


def unknown(address: str) -> str:
    """Why this host cannot tell where an address is; '' if it can, or if the address is of another kind than
    HOST:PORT."""
    host, _, port = address.rpartition(":")
    if "/" in host or host.startswith(("dns:", "ipv4:", "ipv6:")):
        return ""
    try:
        socket.getaddrinfo(host.strip("[]"), port)
    except (OSError, UnicodeError) as error:
        return str(error)
    return ""
