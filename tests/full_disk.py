"""Write a checkpoint that is larger than a file may be, as on a full disk: ``python -m tests.full_disk FOLDER``.

The limit is the operating system's, and for a whole process; so this is one of its own.
"""

import resource
import signal
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from t2tl_jax.runs.checkpoints import CheckpointError, Checkpoints

LIMIT = 2**16
"""Bytes of a file."""


class State(NamedTuple):
    """Parameters alone."""

    params: dict[str, Any]


def state(size: int) -> State:
    """Numbers that cannot be compressed."""
    return State({"w": np.random.default_rng(size).normal(size=size).astype(np.float32)})


def main(folder: Path) -> None:
    """One checkpoint that fits, one that does not, and what can be read then."""
    with Checkpoints(folder) as checkpoints:
        checkpoints.save(1, state(100), {})
        checkpoints.wait()
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # the write fails, as on a full disk, and the process goes on
        resource.setrlimit(resource.RLIMIT_FSIZE, (LIMIT, LIMIT))
        checkpoints.save(2, state(LIMIT), {})
        try:
            checkpoints.wait()
        except CheckpointError as error:
            print(error)
        # Other items of the second one may still be under way, in a folder that the next training removes.
        print("complete:", *checkpoints.iterations())
        iteration, read = checkpoints.restore(state(100))
        print("read:", iteration, (read.params["w"] == state(100).params["w"]).all())


if __name__ == "__main__":
    main(Path(sys.argv[1]))
