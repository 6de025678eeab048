"""What the benchmark of everything measured: a flat list of rows, as a file, as tables, and beside an earlier one."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from experiments.benchmarks import json_file
from experiments.benchmarks.timing import Costs, Rate
from t2tl_jax.errors import UserError

PEERS = Path(__file__).with_name("peers.json")
"""What others say of themselves."""

VERSION = 1


@dataclass(frozen=True)
class Row:
    """One measurement. What, size and unit say which; everything else is what came of it."""

    part: str
    """Part of the benchmark."""
    what: str
    """What was timed."""
    size: str
    """How much of it at a time."""
    unit: str
    """What is counted."""
    rate: float
    """So many in a second: median of the calls."""
    slowest: float
    """In the slowest call."""
    fastest: float
    """In the fastest call."""
    trace_s: float | None = None
    """Seconds of tracing."""
    compile_s: float | None = None
    """Seconds of compiling."""
    memory_mib: float | None = None
    """What a call needs, in MiB."""
    gigaflop: float | None = None
    """Arithmetic of a call, in 10^9 operations."""
    gigabytes: float | None = None
    """Bytes read and written in a call, in 10^9."""
    acting_share: float | None = None
    """Of the time of a training, how much acting alone would take; None where several devices trained."""
    seconds: float | None = None
    """Of a whole run that ends when its task is solved in training, or with its frames."""
    frames: int | None = None
    """Of each seed until then; None where not every seed came to it, and of other parts."""
    devices: int | None = None
    """How many shared the work; None in files from before this was counted, which are of one."""

    @property
    def key(self) -> tuple[str, str, str, str]:
        """What it is a measurement of."""
        return self.part, self.what, self.size, self.unit


def row(part: str, what: str, size: str, unit: str, speed: Rate, costs: Costs | None, **more: Any) -> Row:
    """A row from what was measured."""
    return Row(
        part, what, size, unit, speed.median, speed.slowest, speed.fastest, **(asdict(costs) if costs else {}), **more
    )


def write(path: Path, where: dict[str, Any], settings: dict[str, Any], rows: Sequence[Row]) -> None:
    """Write the file that `read` reads, with what it was measured on."""
    content = {"version": VERSION, "where": where, "settings": settings, "rows": [asdict(one) for one in rows]}
    json_file.write(path, content)


def read(path: Path) -> tuple[dict[str, Any], list[Row]]:
    """Where an earlier benchmark was measured, and its rows.

    Raises:
        UserError: if the file is none of a benchmark.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content["version"] != VERSION:
            raise UserError(f"{path} is of version {content['version']}, and {VERSION} is known")
        return content["where"], [Row(**one) for one in content["rows"]]
    except OSError as error:
        raise UserError(f"cannot read {path}: {error.strerror or error}") from error
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise UserError(f"{path} is not what experiments.benchmark writes: {error}") from error


def table(rows: Sequence[Row]) -> str:
    """Markdown, one line for each row; how many devices worked is said where it is more than one anywhere. Memory is
    that of each device."""
    several = any((one.devices or 1) > 1 for one in rows)
    heading = ("what", "size", *(["devices"] if several else []))
    heading += ("per second (minimum, maximum)", "trace + compile", "memory", "rollout alone", "update, the rest")
    lines = [
        (
            one.what,
            one.size,
            *([str(one.devices or 1)] if several else []),
            f"{three_digits(one.rate)} {one.unit} ({three_digits(one.slowest)}, {three_digits(one.fastest)})",
            "-" if one.compile_s is None else f"{one.trace_s or 0:.1f} + {one.compile_s:.1f} s",
            "-" if one.memory_mib is None else f"{one.memory_mib:,.0f} MiB",
            *_halves(one),
        )
        for one in rows
    ]
    return _markdown(heading, lines)


def _halves(one: Row) -> tuple[str, str]:
    """Frames/s of acting alone, with its share of the time, and of what is left, which is learning."""
    share = one.acting_share
    if share is None or not 0 < share < 1:
        return "-", "-"
    rollout, update = (f"{three_digits(one.rate / of)} {one.unit}" for of in (share, 1 - share))
    return f"{rollout} ({share:.0%})", f"{update} ({1 - share:.0%})"


def solved_table(rows: Sequence[Row]) -> str:
    """Markdown: when whole runs solved their task, pre-training, compiling and drawing of maps included."""
    lines = [
        (
            one.what,
            one.size,
            f"{one.seconds:.0f} s" if one.seconds is not None else "-",
            "not within its frames" if one.frames is None else f"{one.frames:,}",
        )
        for one in rows
    ]
    return _markdown(("what", "size", "whole run", "frames until success stayed above 95 %, all seeds"), lines)


def against(rows: Sequence[Row], earlier: Sequence[Row]) -> str:
    """Markdown: each row beside the earlier one of the same; a change counts where the spreads do not overlap."""
    known = {one.key: one for one in earlier}
    lines = [
        (
            one.what,
            one.size,
            f"{three_digits(before.rate)} {one.unit}",
            f"{three_digits(one.rate)} {one.unit}",
            f"{one.rate / before.rate:.2f}",
            "faster" if one.slowest > before.fastest else "slower" if one.fastest < before.slowest else "within spread",
        )
        for one in rows
        if (before := known.get(one.key)) is not None
    ]
    if not lines:
        return "Nothing here was measured there."
    return _markdown(("what", "size", "before", "now", "ratio", ""), lines)


def peers() -> str:
    """Markdown: what others say of themselves. Neither the work nor the hardware is the same."""
    found = json.loads(PEERS.read_text(encoding="utf-8"))
    heading = ("what", "figure", "hardware", "source")
    return _markdown(heading, [tuple(one[name] for name in heading) for one in found])


def three_digits(value: float) -> str:
    """A number to three digits, with commas."""
    shown = float(f"{value:.3g}")
    return f"{shown:,.0f}" if shown >= 100 else f"{shown:g}"


def _markdown(heading: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    return "\n".join("| " + " | ".join(line) + " |" for line in (heading, ["---"] * len(heading), *lines))
