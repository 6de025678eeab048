"""Start the GPU while Python loads its modules: finding it and taking its memory leaves the interpreter free.

Only entry points do this, and only those that are about to train. What fails here fails again, and is told, where the
device is first needed.
"""

import threading
from collections.abc import Sequence
from contextlib import suppress

from experiments.cli import hosts, plugins

NOT_WITH = (hosts.FLAG, plugins.FLAG, "--help", "-h", "--list")
"""Who only asks needs no GPU; hosts meet before they have one, and a module of the user's may choose another."""


def begin(words: Sequence[str], several: bool = False) -> threading.Thread | None:
    """Start it in a thread of its own, which is returned; None where this is to wait.

    Args:
        words: of the command line.
        several: whether this process is one of several.
    """
    if several or any(word.partition("=")[0] in NOT_WITH for word in words):
        return None
    from experiments.cli import cpu_devices

    cpu_devices.use()  # of which a number can be asked for only until they are there
    thread = threading.Thread(target=_start, name="early-start")
    thread.start()
    return thread


def _start() -> None:
    import jax
    import numpy as np

    with suppress(Exception):
        jax.device_put(np.zeros(1)).block_until_ready()  # takes the GPU's memory; nothing is compiled
