"""``--hosts``: the same command on several hosts, or several times on one, as one run over all of their devices.

    --hosts slurm                     started by srun, one process a GPU: SLURM says who is who
    --hosts HOST:PORT,COUNT,INDEX     the address of the first process, how many there are, and which one this is

Without the flag, the variables JAX_COORDINATOR_ADDRESS, JAX_NUM_PROCESSES and JAX_PROCESS_ID say the same. The first
process writes and prints. Each tells the others that it lives, and why it ends: a process that is gone ends them all.
"""

import contextlib
import os
import re
import sys
import threading
import time
import traceback
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

from experiments.cli import finding, last_words
from t2tl_jax.errors import UserError

FLAG = "--hosts"

SLURM = "slurm"

VARIABLES = ("JAX_COORDINATOR_ADDRESS", "JAX_NUM_PROCESSES", "JAX_PROCESS_ID")
"""What the environment says of plain hosts."""

POLL = 0.5
"""Seconds between two signs of life."""

PATIENCE = 20.0
"""Seconds without one after which a process is taken for dead."""

RUNTIME = re.compile(r"(UNKNOWN|INTERNAL|UNAVAILABLE|ABORTED|CANCELLED|DEADLINE_EXCEEDED|FAILED_PRECONDITION): ")
"""How errors of XLA begin."""

LOST = last_words.EXIT
"""Exit code of a process that ends because another one did."""


@dataclass(frozen=True)
class Hosts:
    """Which process this is of how many."""

    address: str
    """Of the first one, or `SLURM`."""
    count: int = 0
    """How many there are; 0 where SLURM says so."""
    index: int = 0
    """Which one this is."""


def read(arguments: Sequence[str], environment: Mapping[str, str] = os.environ) -> tuple[list[str], Hosts | None]:
    """The other arguments, and what ``--hosts`` or the environment say; None where this process is alone.

    Raises:
        UserError: for what names no hosts.
    """
    rest, words, text = [], iter(arguments), None
    for word in words:
        name, equals, value = word.partition("=")
        if name == FLAG:
            text = value if equals else next(words, "")
        else:
            rest.append(word)
    if text == SLURM:
        return rest, Hosts(SLURM)
    if text is None:
        given = [environment.get(name, "") for name in VARIABLES]
        if not given[0] or not (given[1] or given[2]):
            return rest, None
        text = ",".join(given)
    address, *numbers = [part.strip() for part in text.split(",")]
    host, _, port = address.rpartition(":")
    whole = all(part.isascii() and part.isdecimal() for part in (*numbers, port))
    if not host or len(numbers) != 2 or not whole or int(numbers[1]) >= int(numbers[0]) or not 0 < int(port) < 2**16:
        raise UserError(
            f"{FLAG} takes {SLURM}, or HOST:PORT,COUNT,INDEX with indices from 0, such as node1:1234,2,0, with "
            f"ports from 1 to {2**16 - 1}; got {text!r}"
        )
    return rest, Hosts(address, int(numbers[0]), int(numbers[1]))


@contextlib.contextmanager
def joined(hosts: Hosts | None) -> Iterator[None]:
    """Be one of several processes for as long as the block lasts; an error in it ends all of them.

    Raises:
        UserError: if the others cannot be reached.
    """
    if hosts is None:
        yield
        return
    last_words.guard()
    _join(hosts)
    watch = Watch()
    try:
        with ExitStack() as stack:
            if watch.index:
                nowhere = stack.enter_context(open(os.devnull, "w", encoding="utf-8"))
                stack.enter_context(contextlib.redirect_stdout(nowhere))
            yield
    except BaseException as error:
        watch.fail(error)
    watch.end()


def _join(hosts: Hosts) -> None:
    import jax

    options: dict[str, Any] = {"heartbeat_timeout_seconds": 100}
    if hosts.address == SLURM:
        options |= {"cluster_detection_method": SLURM}
    else:
        options |= {"coordinator_address": hosts.address, "num_processes": hosts.count, "process_id": hosts.index}
        options |= {"cluster_detection_method": "deactivate"}
    jax.config.update("jax_cpu_collectives_implementation", "gloo")
    try:
        with finding.told():
            jax.distributed.initialize(**options)
    except (RuntimeError, ValueError, KeyError) as error:
        raise UserError(f"{FLAG} {hosts.address}: the processes do not find each other: {error}") from error
    last_words.met()


class Watch:
    """Signs of life: this process gives its own, and looks at those of the others, in a thread."""

    def __init__(self) -> None:
        """Begin."""
        from t2tl_jax.training.hosts import PREFIX, count, index, store

        self.index, self._count, self._store = index(), count(), store()
        self._alive, self._gone, self._left = (f"{PREFIX}/{name}" for name in ("alive", "gone", "left"))
        self._speaks = threading.Lock()  # by the first that has a reason to end, and never given back
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._look, name="hosts", daemon=True)
        self._thread.start()

    def end(self) -> None:
        """All is done; the others are here, too.

        All leave together. A process whose store of names is gone is aborted by JAX, and the first process has it.
        """
        import jax

        from t2tl_jax.training.hosts import meet

        meet()
        self._over.set()
        self._thread.join()
        jax.distributed.shutdown()

    def fail(self, error: BaseException) -> None:
        """End this process, and all others, because of an error. Does not return."""
        from experiments.cli.errors import INVALID

        refused = isinstance(error, UserError) and not _is_of_runtime(error)
        if isinstance(error, Exception) and not refused:
            # A process that is lost breaks whatever the others do with it. Who it was, the watch knows in a moment.
            time.sleep(PATIENCE + 4 * POLL)
        self._speaks.acquire()
        last_words.close()
        if refused:
            print(f"error: {error}", file=sys.stderr)
        else:
            traceback.print_exception(error)
        code, said = INVALID if refused else LOST, str(error) or type(error).__name__
        words = said if refused else said.splitlines()[0]
        with contextlib.suppress(Exception):
            self._store.key_value_set(f"{self._gone}/{self.index}", f"{code} {words}")
        self._leave(code)

    def _lost(self, process: str, reason: str) -> None:
        """End this process because another one ended. Does not return."""
        self._speaks.acquire()
        if not last_words.close():
            words = f"error: process {process} of this run ended: {reason[:500]}"
            print(f"{words}\n{last_words.WAY_OUT}", file=sys.stderr)
        self._leave(LOST, process)

    def _told(self, process: str, text: str) -> None:
        """End this process because of an error in another one, which says its exit code and its words."""
        code, _, reason = text.partition(" ")
        if int(code) == LOST:
            self._lost(process, reason)
        self._speaks.acquire()
        last_words.close()
        print(f"error: {reason}", file=sys.stderr)
        self._leave(int(code))

    def _leave(self, code: int, lost: str = "") -> None:
        """End this process: the first one last, as JAX aborts the others without it, but not for one that is lost."""
        with contextlib.suppress(Exception):
            if self.index:
                self._store.key_value_set(f"{self._left}/{self.index}", "")
            until = time.monotonic() + PATIENCE
            while not self.index and time.monotonic() < until:
                left = {name.rpartition("/")[2] for name, _ in self._store.key_value_dir_get(f"{self._left}/")}
                if len(left | ({lost} - {""})) >= self._count - 1:
                    break
                time.sleep(POLL / 5)
            time.sleep(0 if self.index else POLL)  # who has said so, leaves in a moment
        _leave(code)

    def _look(self) -> None:
        """The work of the thread."""
        seen: dict[str, tuple[str, float]] = {}
        beat = 0
        while not self._over.wait(POLL):
            try:
                beat += 1
                self._store.key_value_set(f"{self._alive}/{self.index}", str(beat), allow_overwrite=True)
                gone = dict(self._store.key_value_dir_get(f"{self._gone}/"))
                alive = dict(self._store.key_value_dir_get(f"{self._alive}/"))
            except Exception as error:  # of whatever kind the store raises
                if not self._over.is_set():
                    self._lost("0", f"its store of names cannot be reached ({str(error).splitlines()[0][:200]})")
                return
            for name, reason in gone.items():
                if (other := name.rpartition("/")[2]) != str(self.index):
                    self._told(other, reason)
            now = time.monotonic()
            for name, sign in alive.items():
                if seen.get(name, ("", now))[0] != sign:
                    seen[name] = sign, now
                elif now - seen[name][1] > PATIENCE:
                    self._lost(name.rpartition("/")[2], f"no sign of life for {PATIENCE:.0f} seconds")


def _is_of_runtime(error: BaseException | None) -> bool:
    """Whether an error comes from what the processes compute together; in JAX it may be of any kind."""
    while error is not None:
        if RUNTIME.match(str(error)):
            return True
        error = error.__cause__ or error.__context__
    return False


def _leave(code: int) -> None:
    """At once: to part in an orderly way, `jax.distributed` would wait for those that are gone."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
