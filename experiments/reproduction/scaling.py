"""The table of several GPUs: stored benchmarks of one device beside those of several of its kind."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from experiments.benchmarks import measured
from experiments.benchmarks.measured import three_digits
from experiments.reproduction.page import origin, paragraph, table

AIM_OF_SEEDS, AIM_OF_ONE_SEED = 1.9, 1.7
"""So many times the frames/s of one device are aimed at for two; nothing was set for other numbers."""

FULL = 0.95
"""Of so many times the devices' number at least, a ratio says that devices do not slow each other down."""

PARTS = ("training", "environments")
"""What several devices share."""

NOTHING = "Not measured yet: no stored benchmark of several GPUs has a counterpart of one, by the same commit and JAX."


@dataclass(frozen=True)
class Setting:
    """What two benchmarks must have in common for a comparison of their devices."""

    kind: str
    """Of the devices."""
    commit: str
    """In full."""
    jax: str
    """Its version."""


@dataclass(frozen=True)
class Pair:
    """The same measured on one device and on several."""

    one: measured.Row
    """On one."""
    several: measured.Row
    """On several, which all had a part of the work."""

    @property
    def count(self) -> int:
        """How many shared the work."""
        assert self.several.devices is not None
        return self.several.devices

    @property
    def ratio(self) -> float:
        """Of the medians."""
        return self.several.rate / self.one.rate

    @property
    def aim(self) -> float | None:
        """For the ratio; None where nothing was set."""
        if self.one.part != "training" or self.count != 2:
            return None
        return AIM_OF_ONE_SEED if self.one.size == "1 seed" else AIM_OF_SEEDS


def scaling(results: Path) -> str:
    """Rates on one and on several devices as Markdown, or a sentence that says that nothing is stored.

    Args:
        results: the folder with ``benchmark_*.json``.
    """
    parts, same_work = [], pairs(results)
    for versions, found in same_work:
        count = found[0].count
        heading = ("what", "size", "one device", f"{count} devices", "ratio (range)", "aim", "")
        parts += [table(heading, [_line(pair) for pair in found]), origin([versions])]
    as_many_each = pairs(results, of_each)
    if as_many_each:
        parts.append("The same with as many seeds on each device, so that the work grows with the devices:")
    for setting in dict.fromkeys(_setting(versions) for versions, _ in as_many_each):
        here = [(versions, found) for versions, found in as_many_each if _setting(versions) == setting]
        grown = [pair for _, found in here for pair in found]
        rows = [
            (pair.one.what, _short(pair.one), f"{_short(pair.several)} on {pair.count}", _ratio(pair)) for pair in grown
        ]
        columns = ("what", "one device", "several devices", "ratio (range)")
        parts += [table(columns, rows), origin([versions for versions, _ in here]), _what_limits(grown)]
    parts.append(_less_busy(results, [(where, pair) for where, found in same_work for pair in found]))
    return "\n\n".join(part for part in parts if part) or NOTHING


Counterpart = Callable[[measured.Row, int], tuple[str, ...]]
"""The key of what one device should have done, for what so many did."""


def same(several: measured.Row, count: int) -> tuple[str, ...]:
    """The very same work on one device."""
    return several.key


def of_each(several: measured.Row, count: int) -> tuple[str, ...]:
    """The seeds of one of the devices by themselves; () where they are not several seeds that share out evenly."""
    seeds, _, word = several.size.partition(" ")
    if word != "seeds" or int(seeds) % count:
        return ()
    each = int(seeds) // count
    return replace(several, size="1 seed" if each == 1 else f"{each} seeds").key


def pairs(results: Path, counterpart: Counterpart = same) -> list[tuple[Mapping[str, Any], list[Pair]]]:
    """Of each file of several devices, where it was measured and its rows that one device has a counterpart of.

    Rows in which some of the devices had nothing to do are left out. Of several files of one device, the newest counts.
    """
    alone: dict[Setting, dict[tuple[str, ...], measured.Row]] = {}
    of_several = []
    for where, rows in in_time(results):
        setting = _setting(where)
        if setting is None:
            continue
        if len(where["devices"]) == 1:
            alone.setdefault(setting, {}).update({one.key: one for one in rows})
        else:
            of_several.append((setting, where, rows))
    found: list[tuple[Mapping[str, Any], list[Pair]]] = []
    for setting, where, rows in of_several:
        of_one = alone.get(setting, {})
        count = len(where["devices"])
        shared = [one for one in rows if one.part in PARTS and one.devices == count]
        kept = [Pair(of_one[counterpart(one, count)], one) for one in shared if counterpart(one, count) in of_one]
        if kept:
            found.append((where, kept))
    return found


def in_time(results: Path) -> list[tuple[dict[str, Any], list[measured.Row]]]:
    """Where each stored benchmark was measured, and its rows; the newest is last."""
    files = {file.name: measured.read(file) for file in results.glob("benchmark_*.json")}
    return [files[name] for name in sorted(files, key=lambda name: (files[name][0].get("time", ""), name))]


def _setting(where: Mapping[str, Any]) -> Setting | None:
    """None where devices differ or the tree differed from its commit, and for a processor, whose cores share more than
    they have of their own."""
    kinds, commit = set(where["devices"]), where.get("git_revision")
    if len(kinds) != 1 or "cpu" in kinds or not commit or where.get("git_modified"):
        return None
    return Setting(kinds.pop(), commit, where["packages"]["jax"])


def _short(row: measured.Row) -> str:
    return f"{row.size}: {three_digits(row.rate)} {row.unit}"


def _ratio(pair: Pair) -> str:
    """With its range: the slowest call over the fastest to the fastest over the slowest."""
    one, several = pair.one, pair.several
    return f"{pair.ratio:.2f} ({several.slowest / one.fastest:.2f}, {several.fastest / one.slowest:.2f})"


def _what_limits(found: Sequence[Pair]) -> str:
    """What one device gains by more seeds, which several lack that share out the same ones.

    '' if that is not known, or if seeds do slow each other down across devices.
    """
    if any(pair.ratio < FULL * pair.count for pair in found):
        return ""
    rates = {(pair.one.what, pair.one.size): pair.one.rate for pair in found}
    said = []
    for pair in found:
        more = rates.get((pair.several.what, pair.several.size))
        if more is not None:
            said.append(
                f"{pair.one.what} makes {more / pair.one.rate:.2f} times the frames/s with {pair.several.size} as with "
                f"{pair.one.size.removesuffix(' seeds')}"
            )
    if not said:
        return ""
    return paragraph(
        f"So these seeds hardly slow each other down across devices. On one device {'; '.join(said)}: fewer seeds "
        "leave it less busy, and the same seeds lose that on several. Of other trainings, and of one seed that is "
        "shared out, this says nothing."
    )


def _less_busy(results: Path, shared: Sequence[tuple[Mapping[str, Any], Pair]]) -> str:
    """What several devices could make of the same seeds if each only had fewer of them: by what one device of the kind
    makes of fewer, by the same commit or, where there is no such figure, by the last one before; '' where neither is
    known."""
    alone = [
        (where, row)
        for where, rows in in_time(results)
        if len(where["devices"]) == 1 and _setting(where) is not None
        for row in rows
    ]
    said, kept = [], []
    for of_several, pair in shared:
        kind, key = of_several["devices"][0], of_each(pair.several, pair.count)
        fewer = [(where, row.rate) for where, row in alone if where["devices"][0] == kind and row.key == key]
        same_commit = [rate for where, rate in fewer if _setting(where) == _setting(of_several)]
        before = [rate for where, rate in fewer if where.get("time", "") <= of_several.get("time", "")]
        if (same_commit or before) and pair.one.part == "training":
            could = pair.count * (same_commit or before)[-1] / pair.one.rate
            kept.append(pair.ratio / could)
            what = f"{pair.one.what} with {pair.one.size} ({of_several['git_revision'][:7]})"
            said.append(f"{what} {could:.2f} times, measured {pair.ratio:.2f} times")
    if not said:
        return ""
    lost = (
        " So what is missing is lost on each device, which fewer seeds keep less busy, and hardly between them: "
        f"{max(1 - min(kept), 0):.1%} at most."
    )
    return paragraph(
        "If devices did not wait for one another, each would be as fast as one device with its share of the seeds, by "
        "the same commit or, where that was not measured, by the last one before, and together they would make "
        f"{'; '.join(said)}.{lost * (min(kept) >= FULL)}"
    )


def _line(pair: Pair) -> tuple[str, ...]:
    one, several, aim = pair.one, pair.several, pair.aim
    return (
        one.what,
        one.size,
        f"{three_digits(one.rate)} {one.unit}",
        f"{three_digits(several.rate)} {several.unit}",
        _ratio(pair),
        "-" if aim is None else f"{aim:g}",
        "" if aim is None else "met" if pair.ratio >= aim else "not met",
    )
