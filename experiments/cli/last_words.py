"""What JAX says as it aborts a process, in plain words: of a run over several hosts that lost its first process.

JAX aborts every process that cannot reach the first one. It writes a stack trace to the file descriptor of stderr, of
which Python is told nothing. `guard` leads this descriptor through a process of its own, which runs this file: it
passes on what comes, and says in words what such an abort means. What Python prints goes where it went before.
"""

import ctypes
import faulthandler
import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Iterable, Iterator
from contextlib import suppress

ABORTED = re.compile(rb"F\d{4} .*JAX distributed service")
"""How JAX begins when it aborts a process that lost the first one; a stack trace follows."""

SPOKE = 3
"""Exit code of the other process if it saw that."""

EXIT = 1
"""Exit code of a process that ends because another one did."""

WAY_OUT = "The others end with it. The run goes on from its last checkpoint with --resume RUN, on any number of hosts."

LOST = f"error: another process of this run ended, most likely process 0, which the others cannot reach\n{WAY_OUT}\n"

NEVER_MET = """error: the processes of this run did not find each other
All of them have to be started, with one address of the first one, which every host can reach, and a port that is free.
"""
"""Of an abort before they had."""

MET = b"\0met\n"
"""What this process writes to the descriptor, for the other one alone, once they have."""

_other: subprocess.Popen[bytes] | None = None


def guard() -> None:
    """Lead what is written to the file descriptor of stderr through another process, until this one ends."""
    global _other
    if _other is not None or sys.stderr is None:  # which is closed: there is nothing to lead anywhere
        return
    here = [sys.executable, "-I", "-S", __file__]
    _other = subprocess.Popen(here, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, start_new_session=True)
    assert _other.stdin is not None
    sys.stderr.flush()
    sys.stderr = open(os.dup(2), "w", buffering=1, encoding="utf-8", errors="backslashreplace")  # noqa: SIM115
    os.dup2(_other.stdin.fileno(), 2)
    _other.stdin.close()
    threading.Thread(target=_end_if_lost, name="last words", daemon=True).start()
    if faulthandler.is_enabled():  # whose own handler tells more
        return
    # An abort then sleeps for as many seconds as SIGABRT's number, 6, in which the thread ends this process: without a
    # core file of all its memory. A SIGABRT from outside is slept through; SIGTERM stops a run.
    library = ctypes.CDLL(None)
    library.signal.argtypes, library.signal.restype = (ctypes.c_int, ctypes.c_void_p), ctypes.c_void_p
    library.signal(signal.SIGABRT, ctypes.cast(library.sleep, ctypes.c_void_p))


def _end_if_lost() -> None:
    assert _other is not None
    if _other.wait() == SPOKE:
        os._exit(EXIT)


def met() -> None:
    """The processes of the run have found each other: an abort means another thing from now on."""
    if _other is not None:
        with suppress(OSError):  # without it, only the words of a later abort are others
            os.write(2, MET)


def close() -> bool:
    """Nothing is shown any more of what is written to the descriptor; returns whether there was talk of an abort."""
    if _other is None:
        return False
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    os.close(nowhere)
    with suppress(subprocess.TimeoutExpired):  # where a child of this process holds the descriptor
        return _other.wait(timeout=2) == SPOKE
    return False


def readable(lines: Iterable[bytes]) -> Iterator[bytes]:
    """The same lines, up to an abort for want of the first process; in its place, what it means."""
    found = False
    for line in lines:
        if MET in line:  # perhaps behind the beginning of another one
            found, line = True, line.replace(MET, b"")
        if ABORTED.match(line):
            yield (LOST if found else NEVER_MET).encode()
            return
        if line:
            yield line


def main() -> int:
    """Pass on what comes in until it ends. Signals are for the process that writes it."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    with suppress(OSError):
        os.set_blocking(2, True)  # who writes too much for a pipe waits, and loses nothing
    text = b""
    for text in readable(sys.stdin.buffer):
        with suppress(OSError):  # nobody reads
            os.write(2, text)
    return SPOKE if text in (LOST.encode(), NEVER_MET.encode()) else 0


if __name__ == "__main__":
    sys.exit(main())
