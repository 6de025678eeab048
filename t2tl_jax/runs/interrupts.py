"""Ctrl-C and SIGTERM as a request to stop, never as an exception in the middle of something."""

import os
import signal
import sys
import threading
from collections.abc import Callable
from types import FrameType
from typing import Any, Protocol, TypeVar

T = TypeVar("T")

SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interrupted(Exception):
    """The user asked to stop; the message says when that was, as in "while compiling"."""


class Stoppable(Protocol):
    """Who may ask a training to stop."""

    @property
    def requested(self) -> bool:
        """Whether to stop after this iteration."""

    def call(self, function: Callable[[], T], when: str) -> T:
        """Run something long that has nothing to save; Interrupted, saying `when`, if it is not to be waited for."""

    def abandon(self, thread: threading.Thread) -> None:
        """Nobody waits for the work of this thread any more."""


class NeverStop:
    """Nobody asks: for a training in the middle of a program, where Ctrl-C is that program's own affair."""

    requested = False

    def call(self, function: Callable[[], T], when: str) -> T:
        """Run it."""
        return function()

    def abandon(self, thread: threading.Thread) -> None:
        """Python waits for it at its own end."""


class StopRequest:
    """Catches SIGINT and SIGTERM for the length of a ``with`` block in the main thread.

    The first signal only sets ``requested``; the run then finishes the iteration at hand, saves and ends. The second
    one ends the process at once, with what the last checkpoint holds.
    """

    def __init__(self, notice: str = "stopping after this iteration; once more to stop at once") -> None:
        self._notice = notice
        self._event = threading.Event()
        self._previous: dict[int, Any] = {}
        self._abandoned: list[threading.Thread] = []

    def __enter__(self) -> "StopRequest":
        for number in SIGNALS:
            self._previous[number] = signal.signal(number, self._handle)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)

    @property
    def requested(self) -> bool:
        """Whether a signal has arrived."""
        return self._event.is_set()

    def call(self, function: Callable[[], T], when: str) -> T:
        """Run something long that has nothing to save (compilation, evaluation), and leave it when a signal arrives.

        It runs in a thread, because a signal cannot reach Python while XLA compiles or computes in the main one. What
        is left behind goes on unseen; ``leave`` then ends the process without waiting for it.

        Raises:
            Interrupted: saying `when`, if a signal has arrived before or during the call.
        """
        if self.requested:
            raise Interrupted(when)
        outcome: dict[str, Any] = {}

        def work() -> None:
            try:
                outcome["value"] = function()
            except BaseException as error:  # handed to the main thread, whatever it is
                outcome["error"] = error

        thread = threading.Thread(target=work, daemon=True)
        thread.start()
        while thread.is_alive():
            if self.requested:
                self._abandoned.append(thread)
                raise Interrupted(when)
            thread.join(timeout=0.1)
        if "error" in outcome:
            raise outcome["error"]
        return outcome["value"]

    def abandon(self, thread: threading.Thread) -> None:
        """Let `leave` end the process without waiting for this thread."""
        self._abandoned.append(thread)

    def leave(self, code: int) -> int:
        """Return an exit code, unless abandoned work is still running: then end the process with it here and now."""
        if any(thread.is_alive() for thread in self._abandoned):
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(code)  # the interpreter would otherwise tear down XLA underneath the thread, and crash
        return code

    def _handle(self, number: int, frame: FrameType | None) -> None:
        del frame
        if self.requested:
            os.write(2, b"\nstopped at once\n")
            os._exit(128 + number)
        self._event.set()
        # os.write, since a signal may arrive inside a buffered write, which must not be entered twice.
        os.write(2, f"\n{signal.Signals(number).name}: {self._notice}\n".encode())
