"""``metrics.csv``: one row per iteration and seed. Holds no clock times, so that equal runs give equal files.

Columns go by their names: a file of another version, with fewer, more or other columns than are written today, is read
all the same.
"""

import csv
import io
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from t2tl_jax.training.types import EpisodeTotals, Metrics

EPISODE_COLUMNS = (
    "episodes",
    "success_rate",
    "violation_rate",
    "timeout_rate",
    "env_termination_rate",
    "discounted_return",
    "length",
    "success_length",
)
KEY_COLUMNS = ("iteration", "frames", "seed")
FIXED_COLUMNS = (*KEY_COLUMNS, *EPISODE_COLUMNS)


class MetricsFileError(ValueError):
    """A metrics file cannot be continued or read; the message says why."""


def rows(metrics: Metrics, iteration: int, frames: int, seeds: Sequence[int]) -> list[dict[str, float | int | None]]:
    """One row per seed: averages over the episodes that finished in this iteration, then the learner's scalars.

    Args:
        metrics: on the host, every array with a leading axis [seeds].
        iteration: counted from 1.
        frames: environment steps so far, of each seed.
        seeds: their numbers.

    An average over no episodes is None.
    """
    return [
        {
            "iteration": iteration,
            "frames": frames,
            "seed": seed,
            **_averages(metrics.episodes, index),
            **{name: float(values[index]) for name, values in sorted(metrics.scalars.items())},
        }
        for index, seed in enumerate(seeds)
    ]


def _averages(totals: EpisodeTotals, index: int) -> dict[str, float | int | None]:
    episodes, successes = int(totals.episodes[index]), int(totals.successes[index])

    def over(count: int, total: Any) -> float | None:
        return float(total[index]) / count if count else None

    return {
        "episodes": episodes,
        "success_rate": over(episodes, totals.successes),
        "violation_rate": over(episodes, totals.violations),
        "timeout_rate": over(episodes, totals.timeouts),
        "env_termination_rate": over(episodes, totals.env_terminations),
        "discounted_return": over(episodes, totals.discounted_return),
        "length": over(episodes, totals.length),
        "success_length": over(successes, totals.success_length),
    }


class MetricsFile:
    """Appends rows to a ``metrics.csv`` and can drop the rows that are newer than a checkpoint."""

    def __init__(self, path: Path, after: int = 0) -> None:
        """Open for appending.

        Args:
            path: the file, created if missing.
            after: rows of later iterations are removed first, and those up to it must be there.

        Raises:
            MetricsFileError: if the file lacks rows up to ``after``, or is damaged.
        """
        self.path = Path(path)
        self._header: list[str] | None = None
        if after:
            self._rewind(after)
        elif self.path.exists():
            self.path.unlink()
        self._file = open(self.path, "a", newline="", encoding="utf-8")  # noqa: SIM115, open for the whole run

    def append(self, new_rows: Sequence[Mapping[str, float | int | None]]) -> None:
        """Write rows, and the header before the first of them. A new column is empty in the rows so far."""
        buffer = io.StringIO()
        writer = csv.writer(buffer, lineterminator="\n")
        for row in new_rows:
            if self._header is None:
                self._header = list(row)
                writer.writerow(self._header)
            if not set(row) <= set(self._header):
                self._widen([name for name in row if name not in self._header])
            writer.writerow([_cell(row.get(name)) for name in self._header])
        # One write for the rows of an iteration, so that a killed process hardly ever leaves half of them.
        self._file.write(buffer.getvalue())
        self._file.flush()

    def sync(self) -> None:
        """Force the rows to the disk, before a checkpoint that counts on them is written."""
        self._file.flush()
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """Close the file; nothing can be appended afterwards."""
        self._file.close()

    def _widen(self, names: Sequence[str]) -> None:
        """Put further columns at the end of the file, as a run that goes on with more metrics brings them."""
        assert self._header is not None
        self._file.close()
        header, *lines = self.path.read_text(encoding="utf-8").splitlines()
        self._header += names
        wider = [",".join([header, *names]), *(line + "," * len(names) for line in lines)]
        temporary = self.path.with_suffix(".csv.tmp")
        temporary.write_text("\n".join(wider) + "\n", encoding="utf-8", newline="")
        os.replace(temporary, self.path)
        self._file = open(self.path, "a", newline="", encoding="utf-8")  # noqa: SIM115, open for the whole run

    def _rewind(self, iteration: int) -> None:
        lines = lines_up_to(self.path, iteration)
        self._header = next(csv.reader(lines[:1]))
        temporary = self.path.with_suffix(".csv.tmp")
        temporary.write_text("".join(lines), encoding="utf-8", newline="")
        os.replace(temporary, self.path)


def lines_up_to(path: Path, iteration: int) -> list[str]:
    """The header and the rows of the first iterations of a ``metrics.csv``, for a run that goes on from there.

    Raises:
        MetricsFileError: if they are not all there, or damaged.
    """
    if not path.exists():
        raise MetricsFileError(f"{path} is missing, but the checkpoint stands at iteration {iteration}")
    lines = _complete_lines(path)
    iterations = _parse(path, lines)["iteration"]
    kept = [line for line, at in zip(lines[1:], iterations, strict=True) if at <= iteration]
    last = int(iterations[iterations <= iteration].max(initial=0))
    if last != iteration:
        raise MetricsFileError(f"{path} ends at iteration {last}, but the checkpoint stands at {iteration}")
    return [lines[0], *kept]


def read_columns(path: Path) -> dict[str, np.ndarray]:
    """All columns of a ``metrics.csv`` as ``float64[rows]``, NaN where a cell is empty.

    Raises:
        MetricsFileError: if the file is missing, empty or not such a file.
    """
    return _parse(path, _complete_lines(path))


def _complete_lines(path: Path) -> list[str]:
    """All lines but a last one that was cut off in the middle, as a killed process may leave it."""
    try:
        data = path.read_bytes()
        return data[: data.rfind(b"\n") + 1].decode("utf-8").splitlines(keepends=True)
    except OSError as error:
        raise MetricsFileError(f"cannot read {path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise MetricsFileError(f"{path} is damaged: {error}") from error


def _parse(path: Path, lines: Sequence[str]) -> dict[str, np.ndarray]:
    try:
        header, *table = list(csv.reader(lines, quoting=csv.QUOTE_NONE)) or [[]]  # so one line is one row
    except csv.Error as error:
        raise MetricsFileError(f"{path} is damaged: {error}") from error
    if not table:
        raise MetricsFileError(f"{path} holds no metrics yet")
    if not set(KEY_COLUMNS) <= set(header) or len(set(header)) < len(header):
        raise MetricsFileError(f"{path} is not a metrics file")
    keys = [header.index(name) for name in KEY_COLUMNS]
    cells = np.empty((len(table), len(header)))
    for index, row in enumerate(table):
        try:
            cells[index] = _numbers(row, len(header), keys)
        except ValueError as error:
            raise MetricsFileError(f"{path} is damaged in line {index + 2}: {error}") from error
    return dict(zip(header, cells.T, strict=True))


def _numbers(row: Sequence[str], count: int, keys: Sequence[int]) -> list[float]:
    if len(row) != count:
        raise ValueError(f"{len(row)} cells instead of {count}")
    numbers = [float(cell) if cell else np.nan for cell in row]
    if not all(math.isfinite(numbers[key]) for key in keys):
        raise ValueError(f"iteration, frames or seed is missing in {','.join(row[key] for key in keys)!r}")
    return numbers


def by_seed(columns: Mapping[str, np.ndarray], name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """One column as curves: ``(seeds int[S], frames float[points], values float[S, points])``, NaN where absent."""
    seeds = columns["seed"].astype(np.int64)
    order = list(dict.fromkeys(seeds.tolist()))  # as in the run, which need not be sorted
    frames = np.unique(columns["frames"])
    values = np.full((len(order), len(frames)), np.nan)
    for index, seed in enumerate(order):
        of_seed = seeds == seed
        values[index, np.searchsorted(frames, columns["frames"][of_seed])] = columns[name][of_seed]
    return np.array(order), frames, values


def _cell(value: float | int | None) -> str:
    if value is None:
        return ""
    return str(value) if isinstance(value, int) else f"{value:.9g}"  # nine digits restore a float32 exactly


def history(path: Path, seeds: Sequence[int] | None = None) -> dict[str, np.ndarray]:
    """All columns of a ``metrics.csv`` as curves, ``float64[seeds, iterations]``, NaN where a cell is empty.

    Args:
        path: of the file.
        seeds: those to return; by default all of the file, in its order.

    Raises:
        MetricsFileError: as `read_columns`, and if a seed has no rows.
    """
    columns = read_columns(path)
    curves = {name: by_seed(columns, name) for name in columns if name not in ("iteration", "seed")}
    if seeds is None:
        return {name: values for name, (_, _, values) in curves.items()}
    order = by_seed(columns, "frames")[0].tolist()
    if missing := [seed for seed in seeds if seed not in order]:
        raise MetricsFileError(f"{path} has no rows of seed {missing[0]}; its seeds: {', '.join(map(str, order))}")
    places = [order.index(seed) for seed in seeds]
    return {name: values[places] for name, (_, _, values) in curves.items()}


def area(values: np.ndarray) -> np.ndarray:
    """Area under learning curves over their length, which is their average over all frames: float64[seeds].

    Iterations are equally long. One in which no episode ended has the value of the one before, and 0 at the start.

    Args:
        values: float[seeds, iterations], NaN where no episode ended.
    """
    known = np.isfinite(values)
    latest = np.maximum.accumulate(np.where(known, np.arange(values.shape[1]), -1), axis=1)
    filled = np.take_along_axis(values, np.maximum(latest, 0), axis=1)
    return np.where(latest >= 0, filled, 0.0).mean(axis=1)


def ending(curves: Mapping[str, np.ndarray], last: float) -> dict[str, np.ndarray]:
    """Average the last iterations of a run, every finished episode counting once.

    Args:
        curves: by name, float[seeds, iterations], as `history` gives them.
        last: share of the iterations, at the end, above 0.

    Returns:
        By name (success_rate, violation_rate, env_termination_rate, discounted_return, length; those that there are),
        float64[seeds]; NaN for a seed of which no episode ended.
    """
    episodes = curves["episodes"]
    tail = slice(-max(1, round(last * episodes.shape[1])), None)
    # A seed may lack the last rows: those of an iteration are written seed by seed.
    ended = np.nansum(episodes[:, tail], axis=1)

    def average(values: np.ndarray) -> np.ndarray:
        weighted = np.nansum((values * episodes)[:, tail], axis=1)
        return np.where(ended > 0, weighted / np.maximum(ended, 1), np.nan)

    names = ("success_rate", "violation_rate", "env_termination_rate", "discounted_return", "length")
    return {name: average(curves[name]) for name in names if name in curves}
