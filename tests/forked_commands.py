"""Commands as processes of their own that need not load JAX: each is forked from one that has, and computed nothing.

``python -m tests.forked_commands SOCKET`` waits for them; tests go through `Commands`.
"""

import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
import traceback
from pathlib import Path

ROOT = Path(__file__).parents[1]
LIMIT = 120
"""Seconds that anything here may take."""


class Command:
    """A process that runs `experiments.run`, with what tests need of `subprocess.Popen`."""

    def __init__(self, connection: socket.socket, output: int) -> None:
        self._connection, self._answers = connection, connection.makefile("r")
        self.stdout = open(output, encoding="utf-8")  # noqa: SIM115, closed with the process
        self.pid = int(self._answers.readline())
        self.returncode: int | None = None
        self._limit = threading.Timer(LIMIT, self.send_signal, [signal.SIGKILL])
        self._limit.daemon = True
        self._limit.start()

    def send_signal(self, number: int) -> None:
        os.kill(self.pid, number)

    def rest(self) -> str:
        """What it says until it ends."""
        with self.stdout, self._answers, self._connection:
            output = self.stdout.read()
            self.returncode = int(self._answers.readline())
        self._limit.cancel()
        return output


class Commands:
    """The process that they are forked from; it ends with the tests."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / "commands"
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.forked_commands", str(self._path)],
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        assert self._process.stdout is not None
        while line := self._process.stdout.readline():
            if line == b"ready\n":
                return
        raise RuntimeError("it ended before it was ready")

    def start(self, *flags: str, **environment: str) -> Command:
        ours, theirs = os.pipe()
        connection = socket.socket(socket.AF_UNIX)
        connection.settimeout(LIMIT)
        connection.connect(str(self._path))
        asked = json.dumps([flags, environment]).encode()
        socket.send_fds(connection, [asked], [theirs])
        os.close(theirs)
        return Command(connection, ours)

    def end(self) -> None:
        self._process.communicate(timeout=LIMIT)  # which closes its input


def _run(flags: list[str], environment: dict[str, str], output: int) -> int:
    """In the child: what ``python -m experiments.run`` does."""
    os.dup2(output, 1)
    os.dup2(output, 2)
    os.close(output)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    sys.stdout = open(1, "w", encoding="utf-8", buffering=1, closefd=False)  # noqa: SIM115, as long as the process
    sys.stderr = open(2, "w", encoding="utf-8", buffering=1, closefd=False)  # noqa: SIM115
    os.environ.update(environment)
    try:
        return run.main(flags)
    except BaseException:
        traceback.print_exc()
        return 1


def _serve(path: str) -> None:
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(path)
        server.listen()
        print("ready", flush=True)
        while server in select.select([server, sys.stdin], [], [])[0]:
            connection, _ = server.accept()
            asked, (output,), _, _ = socket.recv_fds(connection, 65536, 1)
            if os.fork() == 0:  # one that waits for the command, so that others can begin
                signal.signal(signal.SIGCHLD, signal.SIG_DFL)
                server.close()
                child = os.fork()
                if child == 0:
                    connection.close()
                    code = _run(*json.loads(asked), output)
                    sys.stdout.flush()
                    os._exit(code)
                os.close(output)
                connection.sendall(f"{child}\n".encode())
                connection.sendall(f"{os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])}\n".encode())
                os._exit(0)
            os.close(output)
            connection.close()


if __name__ == "__main__":
    import matplotlib.pyplot  # noqa: F401, what a command would load

    import t2tl_jax.runs.train  # noqa: F401
    import tests.fake_pretraining  # noqa: F401
    from experiments import run

    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # who waits for commands ends by itself
    _serve(sys.argv[1])
