"""Whether a run survives kill -9: ``python -m experiments.benchmarks.kills --kills 20 -- --config zone_ppo ...``.

Makes a run as ``experiments.run`` does, and a second one that is killed at random moments, whatever it is doing, and
resumed each time. When that one comes to its end it must equal the first one bit for bit, and another one begins, until
there were enough kills. What follows ``--`` are options of ``experiments.run``.
"""

import itertools
import json
import os
import random
import signal
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from experiments.benchmarks import json_file
from experiments.cli.errors import guarded
from t2tl_jax import checks
from t2tl_jax.errors import UserError, explained
from t2tl_jax.flags import parse
from t2tl_jax.quiet import quiet_imports


@dataclass(frozen=True)
class Arguments:
    """Kill a run again and again, and compare it with one that was let alone."""

    kills: int = 20
    """How often to kill."""
    seed: int = 0
    """Of the moments."""
    folder: str = ""
    """Where the runs lie, which are to stay; by default nowhere."""
    json: Path | None = None
    """Also write what came out to this file."""

    def __post_init__(self) -> None:
        checks.counts(self, "kills")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0 all equal, 1 a run differs, 2 for input that cannot be used."""
    return guarded(lambda: _main(sys.argv[1:] if arguments is None else list(arguments)))


def _main(texts: list[str]) -> int:
    own, flags = (texts[: texts.index("--")], texts[texts.index("--") + 1 :]) if "--" in texts else (texts, [])
    with explained():
        arguments = parse(Arguments, own, prog="python -m experiments.benchmarks.kills", description=Arguments.__doc__)
    json_file.check(arguments.json)
    if not flags:
        raise UserError("say what to run behind --, as in: --kills 20 -- --config zone_ppo_closed_form --frames 2e5")
    with quiet_imports():  # once, before any child is made; JAX computes in the children only
        import experiments.run  # noqa: F401
        from t2tl_jax.runs import train  # noqa: F401
    with tempfile.TemporaryDirectory() as temporary:
        found = _check(arguments, flags, Path(arguments.folder or temporary))
    if arguments.json is not None:
        from t2tl_jax.runs import provenance  # after the children: it asks JAX for its devices

        where = provenance.describe(["python", "-m", "experiments.benchmarks.kills", *texts])
        json_file.write(arguments.json, {"where": where, "flags": flags, "seed": arguments.seed, **found})
        print(f"written: {arguments.json}")
    return int(found["differing"] > 0)


def _check(arguments: Arguments, flags: list[str], base: Path) -> dict[str, Any]:
    """Kill and resume; how long the run takes let alone, after how many seconds each kill came, how many runs came to
    their end, and how many of them differ."""
    moments = random.Random(arguments.seed)
    for name in ("whole", "again"):  # the second one finds its programs compiled, as all others will
        begin = time.monotonic()
        _start([*flags, "--run.folder", str(base / name)], base / f"{name}.log", None)
        seconds = time.monotonic() - begin
    whole, again = _run_in(base / "whole"), _run_in(base / "again")
    if whole is None or again is None:
        raise UserError(f"the run came to nothing; see\n{(base / 'whole.log').read_text()}")
    if differing := _differences(whole, again):
        raise UserError(f"two runs that were let alone differ in {', '.join(differing)}: there is nothing to compare")
    print(f"let alone it takes {seconds:.1f} s, and gives the same twice", flush=True)
    modules = [word for flag, name in itertools.pairwise(flags) if flag == "--import" for word in (flag, name)]
    kills, ends, wrong = 0, 0, 0
    killed_after: list[float] = []
    while kills < arguments.kills or _run_in(base / f"killed{ends}") is not None:
        place, log = base / f"killed{ends}", base / f"killed{ends}.log"
        run = _run_in(place)
        words = [*modules, "--resume", str(run)] if run else [*flags, "--run.folder", str(place)]
        after = moments.uniform(0, seconds) if kills < arguments.kills else None
        if not _start(words, log, after):
            kills += 1
            killed_after.append(round(after or 0.0, 2))
            print(f"kill {kills:2} after {after or 0:5.1f} s: {_last_line(log)}", flush=True)
            continue
        ends += 1
        differing = _differences(whole, _run_in(place) or place)
        wrong += bool(differing)
        said = f"differs in {', '.join(differing)}" if differing else "equal bit for bit"
        print(f"end  {ends:2}: {said}", flush=True)
    print(f"{kills} kills, {ends} runs that came to their end, {wrong} of them differ")
    return {"seconds": round(seconds, 2), "killed_after": killed_after, "ends": ends, "differing": wrong}


def _start(words: list[str], log: Path, kill_after: float | None) -> bool:
    """Run a command in a child; whether it came to its end before it was killed."""
    log.parent.mkdir(parents=True, exist_ok=True)
    child = os.fork()
    if child == 0:
        file = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        os.dup2(file, 1)
        os.dup2(file, 2)
        sys.stdout.reconfigure(line_buffering=True)  # type: ignore[union-attr]
        import experiments.run

        os._exit(experiments.run.main(words))
    end = None if kill_after is None else time.monotonic() + kill_after
    while True:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            if os.waitstatus_to_exitcode(status):
                raise UserError(f"{' '.join(words)} failed:\n{log.read_text()[-2000:]}")
            return True
        if end is not None and time.monotonic() >= end:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            return False
        time.sleep(0.005)


def _run_in(base: Path) -> Path | None:
    """The one run below a folder; None if there is none yet."""
    return next((found.parent for found in base.glob("*/[!.]*/config.json")), None)


def _differences(one: Path, other: Path) -> list[str]:
    """Which results of two runs are not the same."""
    names = ["metrics.csv", "pretraining/metrics.csv", "evaluation.json"]
    differing = [name for name in names if _bytes(one / name) != _bytes(other / name)]
    for checkpoints in ("checkpoints", "pretraining/checkpoints"):
        if _newest(one / checkpoints) != _newest(other / checkpoints):
            differing.append(checkpoints)
    return differing


def _newest(checkpoints: Path) -> object:
    """The newest checkpoint's number and what is known of it, with a checksum of every array."""
    steps = sorted(int(step.name) for step in checkpoints.glob("*") if step.name.isdigit())
    return (steps[-1], json.loads((checkpoints / str(steps[-1]) / "info" / "metadata").read_text())) if steps else None


def _bytes(path: Path) -> bytes | None:
    return path.read_bytes() if path.exists() else None


def _last_line(log: Path) -> str:
    lines = log.read_text(errors="replace").replace("\r", "\n").split("\n") if log.exists() else []
    return next((line.strip()[:100] for line in reversed(lines) if line.strip()), "nothing said yet")


if __name__ == "__main__":
    sys.exit(main())
