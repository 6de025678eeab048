"""Keep the output to what was asked for.

MuJoCo prints two lines when it is imported without its optional `warp`. On a CPU, XLA writes lines of a thousand
characters for each program that it reads from the compilation cache: it finds features of the processor missing
(`prefer-no-gather`) that are its own preferences, which no processor has. Where a checkpoint cannot be written or
read, Orbax leaves the loop in which it waits, and TensorStore tells that loop of every other array, each with a
traceback.
"""

import contextlib
import io
import logging
import os
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from t2tl_jax.garbage import garbage_kept

XLA_LOG_LEVEL = "TF_CPP_MIN_LOG_LEVEL"
"""Read by XLA when it is loaded; 3 leaves what ends the process. Errors of a program are exceptions in any case."""

NOISE = ("Failed to import warp", "Failed to import mujoco_warp")

LEFT_LOOP = "Event loop is closed"
"""What asyncio says to whoever calls a loop that is closed."""


@contextlib.contextmanager
def quiet_imports() -> Iterator[None]:
    """Drop those lines inside the block, which is the first to load JAX; whatever else is printed appears at its end.

    Who chose a level of XLA's messages keeps it. Python looks for no garbage meanwhile, which saves some of the time.
    """
    os.environ.setdefault(XLA_LOG_LEVEL, "3")
    heard = io.StringIO()
    try:
        with contextlib.redirect_stdout(heard), garbage_kept():
            yield
    finally:
        for line in heard.getvalue().splitlines():
            if not line.startswith(NOISE):
                print(line)


@contextlib.contextmanager
def quiet_left_loops() -> Iterator[None]:
    """Drop what is said of arrays whose loop was left; also after the block, if it ends with the error that says why,
    since threads go on to say it."""
    before, loops = sys.unraisablehook, logging.getLogger("asyncio")
    ours = before if isinstance(before, _WithoutLeftLoops) else _WithoutLeftLoops(before)
    level = loops.level
    sys.unraisablehook = ours
    loops.setLevel(logging.CRITICAL)  # it says of each array what the error says
    yield
    loops.setLevel(level)
    if sys.unraisablehook is ours:
        sys.unraisablehook = before


@dataclass(frozen=True)
class _WithoutLeftLoops:
    """What is told of errors that nobody can catch, but for that one."""

    others: Callable[[Any], Any]

    def __call__(self, unraisable: Any) -> None:
        if not (isinstance(unraisable.exc_value, RuntimeError) and str(unraisable.exc_value) == LEFT_LOOP):
            self.others(unraisable)


@dataclass(frozen=True)
class ImportedQuietly:
    """What another process is sent in place of a function of a module: there it becomes this function, and the module
    is imported without those lines. What is sent after it may be of any module that this one imports."""

    module: str
    name: str

    def __reduce__(self) -> tuple[Callable[[str, str], Any], tuple[str, str]]:
        return _imported, (self.module, self.name)

    def __call__(self, *arguments: Any) -> Any:
        """The same where nothing was sent."""
        return _imported(self.module, self.name)(*arguments)


def _imported(module: str, name: str) -> Any:
    with quiet_imports():
        return getattr(import_module(module), name)
