"""How long compiling a task takes: `python -m experiments.benchmark_ltl`.

Each time is one whole `compile_tasks` call, from a parsed formula to arrays on the device, without imports.
"""

import os
import platform
import time
from dataclasses import dataclass
from importlib.metadata import version

import numpy as np
import tyro

from t2tl_jax.ltl import WATER_PROPOSITIONS, compile_tasks, named_task, sample

LETTERS = tuple("abcdefghijkl")


@dataclass(frozen=True)
class Arguments:
    """Time the compiler on task families and on the paper's waterworld task."""

    families: tuple[str, ...] = ("phi_water", "Default", "Until_1_3_1_2", "Sequence_2_4", "Eventually_1_5_1_4")
    """Names of families (over twelve propositions) or of the paper's waterworld tasks."""
    draws: int = 200
    """Formulas per family; a named task is compiled as often."""
    alphabet: str = "every_subset"
    """Which letters exist: every_subset or at_most_one."""
    seed: int = 0
    """Seed of the first draw."""


def main(arguments: Arguments) -> None:
    """Print the table."""
    print(f"{_processor()}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}")
    print(", ".join(f"{name} {version(name)}" for name in ("jax", "flax", "numpy")))
    print(f"{arguments.draws} draws each, seeds from {arguments.seed}, alphabet {arguments.alphabet}; times in ms\n")
    compile_tasks("F a", LETTERS, arguments.alphabet)  # the first call also starts the JAX backend
    print(f"{'task':<22}{'rows mean':>10}{'rows max':>10}{'mean':>9}{'median':>9}{'p95':>9}{'max':>9}")
    for family in arguments.families:
        rows, times = zip(*(_time(family, arguments.seed + i, arguments.alphabet) for i in range(arguments.draws)))  # noqa: B905
        values = [np.mean(times), np.median(times), np.percentile(times, 95), np.max(times)]
        print(f"{family:<22}{np.mean(rows):>10.1f}{np.max(rows):>10d}" + "".join(f"{1e3 * v:>9.2f}" for v in values))


def _time(family: str, seed: int, alphabet: str) -> tuple[int, float]:
    """Return the rows of one table and the seconds that it took."""
    named = family.startswith("phi_")
    formula = named_task(family) if named else sample(family, LETTERS, seed)
    propositions = WATER_PROPOSITIONS if named else LETTERS
    start = time.perf_counter()
    table = compile_tasks(formula, propositions, alphabet)
    table.next_row.block_until_ready()
    return table.num_rows, time.perf_counter() - start


def _processor() -> str:
    try:
        with open("/proc/cpuinfo") as lines:
            return next(line.split(":")[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


if __name__ == "__main__":
    main(tyro.cli(Arguments, prog="python -m experiments.benchmark_ltl", description=Arguments.__doc__))
