"""How long compiling a task takes: `python -m experiments.benchmarks.ltl`.

Each time is one whole `compile_tasks` call, from a parsed formula to arrays on the device, without imports.
"""

import os
import platform
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from typing import Literal

import numpy as np

from experiments.cli.errors import guarded
from t2tl_jax import checks
from t2tl_jax.errors import explained
from t2tl_jax.flags import parse
from t2tl_jax.ltl import WATER_PROPOSITIONS, Formula, named_task, sample

LETTERS = tuple("abcdefghijkl")


@dataclass(frozen=True)
class Arguments:
    """Time the compiler on task families and on the paper's waterworld task."""

    families: tuple[str, ...] = ("phi_water", "Default", "Until_1_3_1_2", "Sequence_2_4", "Eventually_1_5_1_4")
    """Names of families (over twelve propositions) or of the paper's waterworld tasks."""
    draws: int = 200
    """Formulas per family; a named task is compiled as often."""
    alphabet: Literal["every_subset", "at_most_one"] = "every_subset"
    """Which letters exist: every set of propositions, or at most one proposition at a time."""
    seed: int = 0
    """Seed of the first draw."""

    def __post_init__(self) -> None:
        if not self.families:
            raise ValueError("families are one or more names, got none")
        checks.counts(self, "draws")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0 done, 2 for input that cannot be used."""
    return guarded(lambda: _main(sys.argv[1:] if arguments is None else list(arguments)))


def _main(texts: list[str]) -> int:
    arguments = parse(Arguments, texts, prog="python -m experiments.benchmarks.ltl", description=Arguments.__doc__)
    with explained():
        for family in arguments.families:
            _draw(family, arguments.seed)  # a mistake is answered before JAX is loaded
        _report(arguments)
    return 0


def _report(arguments: Arguments) -> None:
    from t2tl_jax.ltl import compile_tasks

    print(f"{_processor()}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}")
    print(", ".join(f"{name} {version(name)}" for name in ("jax", "flax", "numpy")))
    print(f"{arguments.draws} draws each, seeds from {arguments.seed}, alphabet {arguments.alphabet}; times in ms\n")
    compile_tasks("F a", LETTERS, arguments.alphabet)  # the first call also starts the JAX backend
    print(f"{'task':<22}{'rows mean':>10}{'rows max':>10}{'mean':>9}{'median':>9}{'p95':>9}{'max':>9}")
    for family in arguments.families:
        rows, times = zip(*(_time(family, arguments.seed + i, arguments.alphabet) for i in range(arguments.draws)))  # noqa: B905
        values = [np.mean(times), np.median(times), np.percentile(times, 95), np.max(times)]
        print(f"{family:<22}{np.mean(rows):>10.1f}{np.max(rows):>10d}" + "".join(f"{1e3 * v:>9.2f}" for v in values))


def _draw(family: str, seed: int) -> tuple[Formula, tuple[str, ...]]:
    """Return a formula, and the propositions that it is compiled over."""
    if family.startswith("phi_"):
        return named_task(family), WATER_PROPOSITIONS
    return sample(family, LETTERS, seed), LETTERS


def _time(family: str, seed: int, alphabet: str) -> tuple[int, float]:
    """Return the rows of one table and the seconds that it took."""
    from t2tl_jax.ltl import compile_tasks

    formula, propositions = _draw(family, seed)
    start = time.perf_counter()
    table = compile_tasks(formula, propositions, alphabet)
    table.verdict.block_until_ready()
    return table.num_rows, time.perf_counter() - start


def _processor() -> str:
    try:
        with open("/proc/cpuinfo") as lines:
            return next(line.split(":")[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


if __name__ == "__main__":
    sys.exit(main())
