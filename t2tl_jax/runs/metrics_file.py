"""``metrics.csv``: one row per iteration and seed. Holds no clock times, so that equal runs give equal files. Very long
runs have a row for several iterations, see `thinning.py`.

Columns go by their names: a file of another version, with fewer, more or other columns than are written today, is read
all the same, if it has those that every version has.
"""

import csv
import gzip
import itertools
import math
import os
import warnings
import zlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from t2tl_jax.runs.rows import Rows

EPISODE_COLUMNS = (
    "episodes",
    "success_rate",
    "violation_rate",
    "timeout_rate",
    "env_termination_rate",
    "discounted_return",
    "total_reward",
    "length",
    "success_length",
)
KEY_COLUMNS = ("iteration", "frames", "seed")
FIXED_COLUMNS = (*KEY_COLUMNS, *EPISODE_COLUMNS)
LATER_COLUMNS = ("env_termination_rate", "total_reward")
"""Of these, the ones that the first versions did not write."""


COMPRESSED = ".gz"
"""Added to the name of a file that is kept for good: it is read wherever the plain one is missing."""

MOST_BYTES = 2**31
"""Of a compressed file, unpacked; more is refused, since a small file can hold very much."""

AT_ONCE = 50_000
"""Lines that are read together."""

BYTES_OF_LINE = 64
"""What Python needs for a line beside its letters. The file is there three times while it is read: as bytes, as a text,
and in lines; its cells twice, as they are read and as curves."""


class MetricsFileError(ValueError):
    """A metrics file cannot be continued or read; the message says why."""


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
        cells = new_rows.cells if isinstance(new_rows, Rows) else _columns(new_rows)
        text = ""
        if self._header is None:
            self._header = list(cells)
            text = ",".join(self._header) + "\n"
        if more := [name for name in cells if name not in self._header]:
            self._widen(more)
        text += _lines([cells.get(name, [None] * len(new_rows)) for name in self._header])
        # One write for the rows of an iteration, so that a killed process hardly ever leaves half of them.
        self._file.write(text)
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
        data = _bytes(path)
        _check_memory(path, data)
        return data[: data.rfind(b"\n") + 1].decode("utf-8").splitlines(keepends=True)
    except (UnicodeDecodeError, gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise MetricsFileError(f"{path} is damaged: {error}") from error
    except OSError as error:
        raise MetricsFileError(f"cannot read {path}: {error.strerror}") from error


def _bytes(path: Path) -> bytes:
    compressed = path.with_name(path.name + COMPRESSED)
    if path.exists() or not compressed.exists():
        _check_fits(3 * path.stat().st_size, str(path))
        return path.read_bytes()
    with gzip.open(compressed) as file:
        data = file.read(MOST_BYTES + 1)
    if len(data) > MOST_BYTES:
        raise MetricsFileError(f"{compressed} holds more than {MOST_BYTES // 2**30} GiB; unpack it to read it")
    return data


def _check_memory(path: Path, data: bytes) -> None:
    """Refuse what does not fit: a small file can hold very many rows, and each of their cells takes eight bytes."""
    rows, columns = data.count(b"\n"), data[: data.find(b"\n") + 1].count(b",") + 1
    needed = 3 * len(data) + rows * (BYTES_OF_LINE + 2 * 8 * columns)
    _check_fits(needed, f"{path}, with {rows:,} rows of {columns} columns,")


def _check_fits(needed: int, what: str) -> None:
    if needed > (most := os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // 2):
        raise MetricsFileError(
            f"to read {what} takes some {needed / 2**30:,.1f} GiB, more than half of this machine's memory "
            f"({most / 2**30:,.1f} GiB): read it on another machine"
        )


def write_compressed(path: Path, text: str) -> None:
    """Write ``metrics.csv.gz`` for the file of that path.

    Equal texts give equal files where the same zlib compresses them; another version or build of it may differ.

    Args:
        path: of the plain file, which is not written.
        text: all of it.
    """
    path.with_name(path.name + COMPRESSED).write_bytes(gzip.compress(text.encode("utf-8"), mtime=0))


def _parse(path: Path, lines: Sequence[str]) -> dict[str, np.ndarray]:
    try:
        header = next(csv.reader(lines[:1], quoting=csv.QUOTE_NONE), [])
    except csv.Error as error:
        raise MetricsFileError(f"{path} is damaged: {error}") from error
    if len(lines) < 2:
        raise MetricsFileError(f"{path} holds no metrics yet")
    if not set(KEY_COLUMNS) <= set(header) or len(set(header)) < len(header):
        raise MetricsFileError(f"{path} is not a metrics file")
    if missing := [name for name in EPISODE_COLUMNS if name not in (*header, *LATER_COLUMNS)]:
        raise MetricsFileError(f"{path} has no column {missing[0]}, which every version writes: it was changed")
    keys = [header.index(name) for name in KEY_COLUMNS]
    cells = np.empty((len(lines) - 1, len(header)))
    for start in range(0, len(cells), AT_ONCE):
        part = lines[1 + start : 1 + start + AT_ONCE]
        values = _fast(part, len(header))
        if values is None or not np.isfinite(values[:, keys]).all():
            values = np.array([_line(path, start + k + 2, line, len(header), keys) for k, line in enumerate(part)])
        cells[start : start + AT_ONCE] = values
    return dict(zip(header, cells.T, strict=True))


def _fast(lines: Sequence[str], count: int) -> np.ndarray | None:
    """The cells of many lines, float64[lines, count]; None where something is wrong, which `_line` then tells."""
    if not all(line.count(",") == count - 1 for line in lines):
        return None
    text = "".join(lines).replace("\n", ",")
    text = f",{text}".replace(",,", ",nan,").replace(",,", ",nan,")[1:]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # how older versions of NumPy say it
            values = np.fromstring(text, sep=",")
    except (ValueError, DeprecationWarning):
        return None
    return values.reshape(len(lines), count) if values.size == len(lines) * count else None


def _line(path: Path, number: int, line: str, count: int, keys: Sequence[int]) -> list[float]:
    try:
        return _numbers(next(csv.reader([line], quoting=csv.QUOTE_NONE), []), count, keys)
    except (ValueError, csv.Error) as error:
        raise MetricsFileError(f"{path} is damaged in line {number}: {error}") from error


def _numbers(row: Sequence[str], count: int, keys: Sequence[int]) -> list[float]:
    if len(row) != count:
        raise ValueError(f"{len(row)} cells instead of {count}")
    numbers = [float(cell) if cell else np.nan for cell in row]
    if not all(math.isfinite(numbers[key]) for key in keys):
        raise ValueError(f"iteration, frames or seed is missing in {','.join(row[key] for key in keys)!r}")
    return numbers


def by_seed(columns: Mapping[str, np.ndarray], name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """One column as curves: ``(seeds int[S], frames float[points], values float[S, points])``, NaN where absent."""
    order, frames, curves = _curves(columns, [name])
    return order, frames, curves[name]


def as_curves(columns: Mapping[str, np.ndarray]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """All columns as curves: ``(seeds int[S], {name: float[S, points]})``, NaN where absent."""
    found, _, curves = _curves(columns, [name for name in columns if name not in ("iteration", "seed")])
    return found, curves


def _curves(
    columns: Mapping[str, np.ndarray], names: Iterable[str]
) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """The same for several columns."""
    seeds = columns["seed"].astype(np.int64)
    order = np.array(list(dict.fromkeys(seeds.tolist())))  # as in the run, which need not be sorted
    frames, column = np.unique(columns["frames"], return_inverse=True)
    names = list(names)
    _check_fits(8 * len(order) * len(frames) * len(names), f"curves of {len(order):,} seeds and {len(frames):,} frames")
    ascending = np.argsort(order)
    row = ascending[np.searchsorted(order, seeds, sorter=ascending)]
    curves = {}
    for name in names:
        values = curves[name] = np.full((len(order), len(frames)), np.nan)
        values[row, column] = columns[name]
    return order, frames, curves


def _columns(rows: Sequence[Mapping[str, Any]]) -> dict[str, list[Any]]:
    """Rows of equal names by column."""
    return {name: [row[name] for row in rows] for name in (rows[0] if rows else ())}


FORMATS = {frozenset({int}): "%d", frozenset({float}): "%.9g"}
"""Of the cells of a column that all have one type; nine digits restore a float32 exactly."""


def _lines(columns: Sequence[Sequence[float | int | None]]) -> str:
    """Columns as the lines of a file. All cells are written by one format, which a thousand seeds need."""
    formats = [FORMATS.get(frozenset(map(type, values)), "%s") for values in columns]
    texts = [map(_cell, values) if form == "%s" else values for form, values in zip(formats, columns, strict=True)]
    row = ",".join(formats) + "\n"
    return row * len(columns[0]) % tuple(itertools.chain.from_iterable(zip(*texts, strict=True)))


def _cell(value: float | int | None) -> str:
    if value is None:
        return ""
    return FORMATS[frozenset({int if isinstance(value, int) else float})] % value


def history(path: Path, seeds: Sequence[int] | None = None) -> dict[str, np.ndarray]:
    """All columns of a ``metrics.csv`` as curves, ``float64[seeds, iterations]``, NaN where a cell is empty.

    Args:
        path: of the file.
        seeds: those to return; by default all of the file, in its order.

    Raises:
        MetricsFileError: as `read_columns`, and if a seed has no rows.
    """
    found, curves = as_curves(read_columns(path))
    if seeds is None:
        return curves
    order = found.tolist()
    if missing := [seed for seed in seeds if seed not in order]:
        raise MetricsFileError(f"{path} has no rows of seed {missing[0]}; its seeds: {', '.join(map(str, order))}")
    places = [order.index(seed) for seed in seeds]
    return {name: values[places] for name, values in curves.items()}


def area(values: np.ndarray, weights: np.ndarray | None = None) -> np.ndarray:
    """Area under learning curves over their length, which is their average over all frames: float64[seeds].

    An iteration in which no episode ended has the value of the one before, and 0 at the start.

    Args:
        values: float[seeds, iterations], NaN where no episode ended.
        weights: how long each iteration counts, float[iterations]; None if they are equally long.
    """
    known = np.isfinite(values)
    latest = np.maximum.accumulate(np.where(known, np.arange(values.shape[1]), -1), axis=1)
    filled = np.take_along_axis(values, np.maximum(latest, 0), axis=1)
    return np.average(np.where(latest >= 0, filled, 0.0), axis=1, weights=weights)


def ending(curves: Mapping[str, np.ndarray], last: float) -> dict[str, np.ndarray]:
    """Average the last iterations of a run, every finished episode counting once.

    Args:
        curves: by name, float[seeds, iterations], as `history` gives them.
        last: share of the iterations, at the end, above 0.

    Returns:
        By name (success_rate, violation_rate, env_termination_rate, discounted_return, total_reward, length; those
        that there are), float64[seeds]; NaN for a seed of which no episode ended.
    """
    episodes = curves["episodes"]
    tail = slice(-max(1, round(last * episodes.shape[1])), None)
    # A seed may lack the last rows: those of an iteration are written seed by seed.
    ended = np.nansum(episodes[:, tail], axis=1)

    def average(values: np.ndarray) -> np.ndarray:
        weighted = np.nansum((values * episodes)[:, tail], axis=1)
        return np.where(ended > 0, weighted / np.maximum(ended, 1), np.nan)

    names = (
        "success_rate",
        "violation_rate",
        "env_termination_rate",
        "discounted_return",
        "total_reward",
        "length",
    )
    return {name: average(curves[name]) for name in names if name in curves}
