"""How long a training takes to start, for the first time and once more: ``python -m experiments.benchmarks.starts``.

Each start is a process of its own that trains for one iteration. The first finds no programs on disk, the second those
that the first left there, traced and compiled, as runs leave them to later ones. Pre-training does not count.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from experiments.benchmarks import json_file
from experiments.cli.errors import guarded
from t2tl_jax import checks
from t2tl_jax.errors import UserError, explained
from t2tl_jax.flags import parse
from t2tl_jax.quiet import quiet_imports

STARTED = time.perf_counter()
WHICH = ("first", "second")
"""The starts."""


@dataclass(frozen=True)
class Arguments:
    """Start trainings twice, each time in a process of its own."""

    trainings: tuple[str, ...] = ("zone_ppo_long:t1tl", "zone_ppo_long:t2tl")
    """Trainings as CONFIG, CONFIG:METHOD, CONFIG:METHOD:PHYSICS or CONFIG:METHOD:PHYSICS:ENVIRONMENTS."""
    seeds: int = 12
    """How many seeds at once."""
    traces: bool = True
    """Keep traced programs on disk too, as runs do, and not only compiled ones."""
    here: bool = False
    """Start the first training once, in this process, with programs kept in JAX_COMPILATION_CACHE_DIR, and print
    JSON: this is what the processes do."""
    json: Path | None = None
    """Also write the results to this file."""

    def __post_init__(self) -> None:
        checks.counts(self, "seeds")
        if not self.trainings:
            raise ValueError("trainings needs one training or more")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0 done, 2 for input that cannot be used."""
    return guarded(lambda: _main(sys.argv[1:] if arguments is None else list(arguments)))


def _main(texts: list[str]) -> int:
    arguments = parse(Arguments, texts, prog="python -m experiments.benchmarks.starts", description=__doc__)
    json_file.check(arguments.json)
    with quiet_imports():
        from experiments.cli import early_gpu

        wait_for_gpu = early_gpu.begin() if arguments.here else None
        from experiments.benchmarks.trainings import training
    with explained():
        configs = {text: replace(training(text), seeds=str(arguments.seeds)) for text in arguments.trainings}
    if wait_for_gpu is not None:
        print(json.dumps(start(configs[arguments.trainings[0]], arguments.traces, wait_for_gpu)))
        return 0
    found: dict[str, dict[str, Any]] = {}
    for text in configs:
        found[text] = {}
        with tempfile.TemporaryDirectory() as folder:
            for which in WHICH:
                found[text][which] = in_a_process(text, arguments, folder)
                print(f"{text}, {which} start: {_said(found[text][which])}", flush=True)
                json_file.store_so_far(arguments, "experiments.benchmarks.starts", texts, starts=found)
    json_file.store(arguments, "experiments.benchmarks.starts", texts, starts=found)
    return 0


def _said(one: dict[str, float]) -> str:
    return ", ".join(f"{name} {seconds:.1f} s" for name, seconds in one.items())


def in_a_process(text: str, arguments: Arguments, folder: str) -> dict[str, float]:
    """Start a training in a new process, whose programs lie in a folder; `start`, and ``process``, the seconds
    of the whole process.

    Raises:
        UserError: if the process fails; its output is in the message.
    """
    command = [sys.executable, "-m", "experiments.benchmarks.starts", "--here", "True", "--trainings", text]
    command += ["--seeds", str(arguments.seeds), "--traces", str(arguments.traces)]
    begin = time.perf_counter()
    done = subprocess.run(
        command,
        env=os.environ | {"JAX_COMPILATION_CACHE_DIR": folder},
        capture_output=True,
        text=True,
    )
    took = time.perf_counter() - begin
    try:
        told = json.loads(done.stdout.splitlines()[-1])
    except (IndexError, ValueError):
        told = None
    if done.returncode or not isinstance(told, dict):
        raise UserError(f"{text}: a process that should start it ended with {done.returncode}: {done.stderr[-2000:]}")
    return told | {"process": took}


def start(config: Any, traces: bool, wait_for_gpu: Callable[[], Any]) -> dict[str, float]:
    """Build, compile and run one iteration of a training, as a run does, with what `early_gpu.begin` gave; seconds
    since this module was loaded until it was traced (``traced``), of compiling, and until the iteration was done
    (``done``)."""
    import jax

    from experiments.cli import compilation_cache
    from t2tl_jax.runs.compilation import Compilation
    from t2tl_jax.runs.experiment import build

    if traces:
        compilation_cache.use(config.run.compilation_cache)
    wait_for_gpu()
    program = build(config).program
    traced = time.perf_counter() - STARTED
    compiled = Compilation(program, fresh=True).result()
    state = compiled.init(program.keys, program.env_params)
    jax.block_until_ready(compiled.iterate(state, program.env_params))
    return {"traced": traced, "compiling": compiled.seconds, "done": time.perf_counter() - STARTED}


if __name__ == "__main__":
    sys.exit(main())
