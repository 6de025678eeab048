"""What writing and reading metrics takes: ``python -m experiments.benchmarks.recording --json FILE``.

Rows of made-up numbers, as many as the file of a run has at most, are written as a run writes them, and read again.
Nothing is trained; a run writes while its next iterations are computed.
"""

import statistics
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
from t2tl_jax.errors import explained
from t2tl_jax.flags import parse


@dataclass(frozen=True)
class Arguments:
    """Time the file of metrics of many seeds."""

    seeds: int = 1000
    """Rows of an iteration."""
    iterations: int = 1000
    """Of the run: with the seeds, as many rows as a file has before they stand for several iterations."""
    scalars: int = 10
    """Numbers of a row beside the counts and averages of its episodes."""
    json: Path | None = None
    """Also write the results to this file."""

    def __post_init__(self) -> None:
        checks.counts(self, "seeds", "iterations", "scalars")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0 done, 2 for input that cannot be used."""
    return guarded(lambda: _main(sys.argv[1:] if arguments is None else list(arguments)))


def _main(texts: list[str]) -> int:
    arguments = parse(Arguments, texts, prog="python -m experiments.benchmarks.recording", description=__doc__)
    json_file.check(arguments.json)
    with explained():
        found = measure(arguments)
    print(found)
    json_file.store(arguments, "experiments.benchmarks.recording", texts, results=found)
    return 0


def measure(arguments: Arguments) -> dict[str, Any]:
    """Milliseconds of writing an iteration of all seeds, MiB of the file, and seconds of reading it."""
    import numpy as np

    from t2tl_jax.runs.metrics_file import MetricsFile, history
    from t2tl_jax.runs.rows import make_rows
    from t2tl_jax.training.types import EpisodeTotals, Metrics

    rng, seeds = np.random.default_rng(0), tuple(range(arguments.seeds))

    def drawn() -> Metrics:
        totals = {name: rng.random(arguments.seeds, np.float32) for name in EpisodeTotals.__dataclass_fields__}
        totals |= {"episodes": np.ones(arguments.seeds, np.float32)}
        scalars = {f"scalar_{k}": rng.random(arguments.seeds, np.float32) for k in range(arguments.scalars)}
        return Metrics(EpisodeTotals(**totals), scalars)  # type: ignore[arg-type]

    with tempfile.TemporaryDirectory() as folder:
        path, spent = Path(folder) / "metrics.csv", []
        file = MetricsFile(path)
        for iteration in range(1, arguments.iterations + 1):
            metrics = drawn()
            began = time.perf_counter()
            file.append(make_rows(metrics, iteration, 1000 * iteration, seeds))
            spent.append(1e3 * (time.perf_counter() - began))
        file.close()
        size = path.stat().st_size
        began = time.perf_counter()
        curves = history(path)
        reading = time.perf_counter() - began
    return {
        "rows": curves["scalar_0"].size,
        "iteration_ms": {"median": statistics.median(spent), "slowest": max(spent)},
        "file_mib": size / 2**20,
        "reading_s": reading,
    }


if __name__ == "__main__":
    sys.exit(main())
