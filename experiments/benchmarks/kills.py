"""Whether a run survives kill -9: ``python -m experiments.benchmarks.kills --kills 20 -- --config zone_ppo ...``.

Makes a run as ``experiments.run`` does, and a second one that is killed at random moments and resumed each time. When
that one comes to its end it must equal the first one bit for bit, and another one begins, until there were enough
kills. What follows ``--`` are options of ``experiments.run``.

Every kill aims at the phase that was hit least so far (`phases.PHASES`: starting or compiling, pre-training, training,
writing a checkpoint, evaluating; those that the run has). It waits until the run comes into that phase, for a
checkpoint until the first, second or third one of this start, as is drawn; then for a random share of the time that the
phase took let alone. What was hit is read off the folder after the kill, so it is what it is even if the phase was over
by then. A run that ends before it comes into the phase is compared, and the next one is aimed at the same.
"""

import itertools
import json
import math
import os
import random
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from experiments.benchmarks import json_file, phases
from experiments.cli.errors import guarded
from t2tl_jax import checks
from t2tl_jax.errors import UserError, explained
from t2tl_jax.flags import parse
from t2tl_jax.quiet import quiet_imports


@dataclass(frozen=True)
class Aim:
    """When to kill: so long after a process comes into a phase for the so-and-so-many-th time."""

    phase: str
    number: int
    wait: float


@dataclass(frozen=True)
class Kill:
    """What a kill hit, and how many seconds after the start of the process; None for a process that ended before."""

    phase: str
    after: float


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
        # After the children: it asks JAX for its devices.
        where = json_file.where(["python", "-m", "experiments.benchmarks.kills", *texts])
        json_file.write(arguments.json, {"where": where, "flags": flags, "seed": arguments.seed, **found})
        print(f"written: {arguments.json}")
    return int(found["differing"] > 0)


def _check(arguments: Arguments, flags: list[str], base: Path) -> dict[str, Any]:
    """Kill and resume; how long the run takes let alone, after how many seconds each kill came, how many runs came to
    their end, and how many of them differ."""
    moments = random.Random(arguments.seed)
    for name in ("whole", "again"):  # the second one finds its programs compiled, as all others will
        watch = phases.Watch()
        _start([*flags, "--run.folder", str(base / name)], base / name, watch, None)
    lengths, seconds = watch.lengths(), watch.entered
    whole, again = _run_in(base / "whole"), _run_in(base / "again")
    if whole is None or again is None:
        raise UserError(f"the run came to nothing; see\n{(base / 'whole.log').read_text()}")
    if differing := _differences(whole, again):
        raise UserError(f"two runs that were let alone differ in {', '.join(differing)}: there is nothing to compare")
    shown = ", ".join(f"{phase} {length:.2f} s" for phase, length in lengths.items())
    print(f"let alone it takes {seconds:.1f} s, and gives the same twice: {shown}", flush=True)
    modules = [word for flag, name in itertools.pairwise(flags) if flag == "--import" for word in (flag, name)]
    kills: list[Kill] = []
    ends, wrong = 0, 0
    while len(kills) < arguments.kills or _run_in(base / f"killed{ends}") is not None:
        place = base / f"killed{ends}"
        run = _run_in(place)
        words = [*modules, "--resume", str(run)] if run else [*flags, "--run.folder", str(place)]
        aim = _aim(moments, lengths, kills) if len(kills) < arguments.kills else None
        kill = _start(words, place, phases.Watch(), aim)
        if kill is not None:
            kills.append(kill)
            print(f"kill {len(kills):2} after {kill.after:5.1f} s, {kill.phase}: {_last_line(_log(place))}", flush=True)
            continue
        ends += 1
        differing = _differences(whole, _run_in(place) or place)
        wrong += bool(differing)
        said = f"differs in {', '.join(differing)}" if differing else "equal bit for bit"
        print(f"end  {ends:2}: {said}", flush=True)
    print(f"{len(kills)} kills, {ends} runs that came to their end, {wrong} of them differ")
    found = {"seconds": round(seconds, 2), "phases": {name: round(length, 3) for name, length in lengths.items()}}
    return found | {"kills": [asdict(kill) for kill in kills], "ends": ends, "differing": wrong}


def _aim(moments: random.Random, lengths: Mapping[str, float], kills: Sequence[Kill]) -> Aim:
    """At a random moment of the phase that was hit least, the first of several such."""
    hit = Counter(kill.phase for kill in kills)
    phase = min(lengths, key=lambda name: hit[name])
    number = moments.randint(1, 3) if phase == phases.CHECKPOINT else 1
    return Aim(phase, number, moments.uniform(0, lengths[phase]))


def _log(place: Path) -> Path:
    """Of the runs in a folder."""
    return place.with_name(f"{place.name}.log")


def _start(words: list[str], place: Path, watch: phases.Watch, aim: Aim | None) -> Kill | None:
    """Run a command in a child, whose run lies in `place`; what a kill hit, None if the child came to its end."""
    log = _log(place)
    log.parent.mkdir(parents=True, exist_ok=True)
    before, since = log.stat().st_size if log.exists() else 0, time.time()
    child = os.fork()
    if child == 0:
        file = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        os.dup2(file, 1)
        os.dup2(file, 2)
        sys.stdout.reconfigure(line_buffering=True)  # type: ignore[union-attr]
        import experiments.run

        os._exit(experiments.run.main(words))

    def phase() -> str:
        said = log.read_bytes()[before:] if log.exists() else b""
        return phases.phase(_run_in(place), said.decode(errors="replace"), since)

    due = math.inf
    while True:
        after = watch.see(phase())
        if aim and due == math.inf and watch.now == aim.phase and watch.times[aim.phase] >= aim.number:
            due = after + aim.wait
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            if os.waitstatus_to_exitcode(status):
                raise UserError(f"{' '.join(words)} failed:\n{log.read_text()[-2000:]}")
            return None
        if after >= due:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            return Kill(phase(), round(after, 2))
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
