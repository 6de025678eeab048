"""Compiling beside other work: XLA leaves Python free, so that tracing and training can go on meanwhile."""

import threading
import time
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

from t2tl_jax.training.program import Program


@dataclass(frozen=True)
class Compiled:
    """The functions of a `Program`, compiled; `init` and `restart` only where they are needed."""

    init: Any
    iterate: Any
    restart: Any
    seconds: float


class Compilation:
    """A program that compiles in a thread of its own, its functions side by side."""

    def __init__(self, program: Program, fresh: bool) -> None:
        """Begin; `init` is compiled only for a training that is `fresh`."""
        self.program, self.fresh = program, fresh
        self._future: Future[Compiled] = Future()
        self.thread = threading.Thread(target=self._work, args=(program,), name="compilation")
        self.thread.start()

    def result(self) -> Compiled:
        """Wait for it; raises what compiling raised."""
        return self._future.result()

    def _work(self, program: Program) -> None:
        begin = time.monotonic()
        lowered = (program.lowered_init if self.fresh else None, program.lowered_iterate, program.lowered_restart)
        try:
            with ThreadPoolExecutor(max_workers=len(lowered)) as threads:
                init, iterate, restart = threads.map(lambda one: None if one is None else one.compile(), lowered)
            self._future.set_result(Compiled(init, iterate, restart, time.monotonic() - begin))
        except BaseException as error:  # handed to whoever waits, whatever it is
            self._future.set_exception(error)
