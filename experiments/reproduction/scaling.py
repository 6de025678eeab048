"""The table of several GPUs: stored benchmarks of one device beside those of several of its kind."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from experiments.benchmarks import measured
from experiments.benchmarks.measured import three_digits
from experiments.reproduction.page import origin, table

AIM_OF_SEEDS, AIM_OF_ONE_SEED = 1.9, 1.7
"""So many times the frames/s of one device are aimed at for two; nothing was set for other numbers."""

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
    parts = []
    for versions, found in pairs(results):
        count = found[0].count
        heading = ("what", "size", "one device", f"{count} devices", "ratio (range)", "aim", "")
        parts += [table(heading, [_line(pair) for pair in found]), origin([versions])]
    return "\n\n".join(parts) or NOTHING


def pairs(results: Path) -> list[tuple[Mapping[str, Any], list[Pair]]]:
    """Of each file of several devices, where it was measured and its rows that one device has too.

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
        kept = [one for one in rows if one.part in PARTS and one.devices == count and one.key in of_one]
        if kept:
            found.append((where, [Pair(of_one[one.key], one) for one in kept]))
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


def _line(pair: Pair) -> tuple[str, ...]:
    one, several, aim = pair.one, pair.several, pair.aim
    lowest, highest = several.slowest / one.fastest, several.fastest / one.slowest
    return (
        one.what,
        one.size,
        f"{three_digits(one.rate)} {one.unit}",
        f"{three_digits(several.rate)} {several.unit}",
        f"{pair.ratio:.2f} ({lowest:.2f}, {highest:.2f})",
        "-" if aim is None else f"{aim:g}",
        "" if aim is None else "met" if pair.ratio >= aim else "not met",
    )
