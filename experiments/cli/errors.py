"""How a command of this package ends: a message that fits on one screen instead of a traceback."""

import atexit
import gc
import sys
import warnings
from collections.abc import Callable
from typing import Any

from experiments.cli.plugins import FLAG
from t2tl_jax.errors import Note, NotRegistered, UserError

INVALID = 2
"""Exit code for input that cannot be used."""

EXHAUSTED = ("RESOURCE_EXHAUSTED", "Out of memory")
"""What JAX says, one or the other, where the memory of a device is too small."""

SMALLER = "some number of the configuration is too large for this machine, of environments, seeds, layers or maps say"


def guarded(command: Callable[[], int]) -> int:
    """Run a command and turn expected errors into a message and an exit code.

    At the end of its process Python looks for garbage no more: among what JAX holds that takes a part of a second.

    Returns:
        What the command returns, ``INVALID`` after a ``UserError`` or where memory is too small, 130 after Ctrl-C
        outside of training.
    """
    atexit.register(gc.freeze)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("always", Note)
            warnings.showwarning = _show
            return command()
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        if isinstance(error, NotRegistered):
            print(f"{FLAG} MODULE imports a module of yours", file=sys.stderr)
        return INVALID
    except (MemoryError, RuntimeError) as error:
        said = str(error).partition("\n")[0][:200]
        if not isinstance(error, MemoryError) and not any(words in said for words in EXHAUSTED):
            raise
        print(f"error: there is not enough memory{f' ({said})' if said else ''}: {SMALLER}", file=sys.stderr)
        return INVALID
    except KeyboardInterrupt:
        print("\nstopped", file=sys.stderr)
        return 130
    except BrokenPipeError:  # the reader of a pipe, such as `head`, has seen enough
        sys.stderr.close()
        return 0


def _show(
    message: Warning | str, category: type[Warning], filename: str, lineno: int, file: Any = None, line: Any = None
) -> None:
    if issubclass(category, Note):
        print(f"note: {message}", flush=True)
    else:
        print(warnings.formatwarning(message, category, filename, lineno), file=sys.stderr, end="")
