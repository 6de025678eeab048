"""Work for the host, done ahead of time in a thread, or in several processes, while the device trains."""

from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from typing import Generic, TypeVar

from t2tl_jax.errors import UserError

T = TypeVar("T")


class Prefetch(Generic[T]):
    """``make(0)``, ``make(1)``, ...: after one has been asked for, the next ones are made. Use as a context manager.

    Where that is not known yet, `knows(number)` says so, and `prepare` begins it later.
    """

    def __init__(
        self,
        make: Callable[[int], T],
        knows: Callable[[int], bool] = lambda number: True,
        executor: Executor | None = None,
        ahead: int = 1,
    ) -> None:
        """By `executor`, which ends with this, `ahead` of them at a time; by default in a thread, one at a time."""
        self._make, self._knows, self._most = make, knows, ahead
        self._executor = executor or ThreadPoolExecutor(max_workers=1)
        self._ahead: dict[int, Future[T]] = {}

    def __enter__(self) -> "Prefetch[T]":
        return self

    def __exit__(self, *_: object) -> None:
        self._executor.shutdown(wait=True, cancel_futures=True)

    def get(self, number: int) -> T:
        """What ``make(number)`` returns or raises.

        Raises:
            UserError: if a process of the executor has ended, so that no more is made.
        """
        try:
            value = self._start(number).result()
            last = number + self._most
            self._ahead = {ahead: made for ahead, made in self._ahead.items() if number < ahead <= last}
            for ahead in range(number + 1, last + 1):
                self.prepare(ahead)  # which a process that ended after its work refuses as well
        except BrokenExecutor as error:
            raise UserError(
                "a process that draws random tasks has ended before its work was done: for lack of memory maybe, or "
                'because the script that trains does not do so under `if __name__ == "__main__":`. The run can be '
                "resumed from its last checkpoint with another number of processes (run.pool_processes; 0 for none)"
            ) from error
        return value

    def prepare(self, number: int) -> None:
        """Begin to make one, if it is known what it is."""
        if self._knows(number):
            self._ahead[number] = self._start(number)

    def _start(self, number: int) -> "Future[T]":
        return self._ahead.get(number) or self._executor.submit(self._make, number)
