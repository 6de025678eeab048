"""Keep the output to what was asked for.

MuJoCo prints two lines when it is imported without its optional `warp`. On a CPU, XLA writes lines of a thousand
characters for each program that it reads from the compilation cache: it finds features of the processor missing
(`prefer-no-gather`) that are its own preferences, which no processor has.
"""

import contextlib
import io
import os
from collections.abc import Iterator

XLA_LOG_LEVEL = "TF_CPP_MIN_LOG_LEVEL"
"""Read by XLA when it is loaded; 3 leaves what ends the process. Errors of a program are exceptions in any case."""

NOISE = ("Failed to import warp", "Failed to import mujoco_warp")


@contextlib.contextmanager
def quiet_imports() -> Iterator[None]:
    """Drop those lines inside the block, which is the first to load JAX; whatever else is printed appears at its end.

    Who chose a level of XLA's messages keeps it.
    """
    os.environ.setdefault(XLA_LOG_LEVEL, "3")
    heard = io.StringIO()
    try:
        with contextlib.redirect_stdout(heard):
            yield
    finally:
        for line in heard.getvalue().splitlines():
            if not line.startswith(NOISE):
                print(line)
