"""What large tables and replays take: ``python -m experiments.benchmarks.room --json FILE``.

A table is compiled by ``python -m t2tl_jax.ltl`` in a process of its own: n goals in any order, letters being every
subset of them, have 2^n + 1 rows. What a replay takes is the sum over the shapes of its arrays; nothing is trained.
"""

import math
import resource
import subprocess
import sys
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
    """Measure the room that large tables take, and count that of replays."""

    goals: int = 17
    """Of the table."""
    config: str = "waterworld_dqn"
    """Whose replay is counted."""
    methods: tuple[str, ...] = ("t1tl", "t2tl")
    """With which methods."""
    seeds: int = 12
    """Of the replays."""
    json: Path | None = None
    """Also write what came out to this file."""

    def __post_init__(self) -> None:
        checks.counts(self, "goals", "seeds")
        if self.goals > 20:
            raise ValueError(f"goals are 20 at most, got {self.goals}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0 done, 2 for input that cannot be used."""
    return guarded(lambda: _main(sys.argv[1:] if arguments is None else list(arguments)))


def _main(texts: list[str]) -> int:
    with explained():
        arguments = parse(Arguments, texts, prog="python -m experiments.benchmarks.room", description=__doc__)
    json_file.check(arguments.json)
    of_table = table(arguments.goals)
    print(of_table, flush=True)
    replays = [replay(arguments.config, method, arguments.seeds) for method in arguments.methods]
    for one in replays:
        print(one, flush=True)
    if arguments.json is not None:
        where = json_file.where(["python", "-m", "experiments.benchmarks.room", *texts])
        json_file.write(arguments.json, {"where": where, "table": of_table, "replays": replays})
        print(f"written: {arguments.json}")
    return 0


def table(goals: int) -> dict[str, Any]:
    """Seconds and memory of a process that compiles so many goals in any order, and describes the table."""
    formula = " & ".join(f"F p{number}" for number in range(goals))
    command = [sys.executable, "-m", "t2tl_jax.ltl", formula, "--max-rows", str(2**goals + 1), "--show-rows", "1"]
    begin = time.monotonic()
    answer = subprocess.run(command, capture_output=True, text=True, check=False)
    seconds = time.monotonic() - begin
    if answer.returncode:
        raise UserError(f"the table did not compile: {answer.stderr}")
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    in_bytes = used.ru_maxrss * (1 if sys.platform == "darwin" else 1024)
    return {
        "goals": goals,
        "rows": int(answer.stdout.split()[0].replace(",", "")),
        "seconds": round(seconds, 2),
        "processor_seconds": round(used.ru_utime + used.ru_stime, 2),
        "memory_mib": round(in_bytes / 2**20, 1),
    }


def replay(config: str, method: str, seeds: int) -> dict[str, Any]:
    """The bytes of the replay of a configuration, for all seeds together."""
    with quiet_imports():
        import jax

        from experiments.cli import request
        from t2tl_jax.runs import experiment

    asked = request.read(["--config", config, "--method", method, "--seeds", str(seeds)])
    built = experiment.build(request.configuration(asked, "", "python -m experiments.benchmarks.room")[0])
    if built.agent.replay is None:
        raise UserError(f"{config} has no replay; name a configuration of DQN")
    arrays = jax.tree.leaves(getattr(built.program.stored, built.agent.replay))
    taken = sum(math.prod(array.shape) * array.dtype.itemsize for array in arrays)
    return {"config": config, "method": method, "seeds": seeds, "bytes": taken}


if __name__ == "__main__":
    sys.exit(main())
