"""What this project aims at for trainings on one H200, beside what was measured."""

from dataclasses import dataclass
from pathlib import Path

from experiments.benchmarks import measured
from experiments.reproduction.page import table
from experiments.reproduction.scaling import in_time

T1TL, T2TL = "zone_ppo_long:t1tl", "zone_ppo_long:t2tl"
ONE, TWELVE = "1 seed", "12 seeds"


@dataclass(frozen=True)
class Aim:
    """Of one training with so many seeds."""

    what: str
    size: str
    least: float | None = None
    """Frames/s of whole iterations that it should make at least."""
    within: float | None = None
    """Seconds that compiling should take at most."""


AIMS = (
    Aim(T2TL, TWELVE, least=1_500_000),
    Aim(T1TL, TWELVE, least=2_500_000),
    Aim(f"{T1TL}:closed_form", TWELVE, least=12_000_000),
    Aim(T2TL, ONE, least=500_000),
    Aim(T1TL, ONE, least=800_000),
    Aim("waterworld_dqn:t1tl", TWELVE, least=300_000),
    Aim(T1TL, TWELVE, within=20),
    Aim(T2TL, TWELVE, within=30),
)


def aims(results: Path) -> str:
    """Every aim that something stored decides: of several files of one H200, made from clean commits, the newest."""
    found: dict[tuple[str, str], measured.Row] = {}
    for where, rows in in_time(results):
        if where["devices"] == ["NVIDIA H200"] and not where.get("git_modified"):
            found |= {(row.what, row.size): row for row in rows if row.part == "training"}
    lines = [_line(aim, found[aim.what, aim.size]) for aim in AIMS if (aim.what, aim.size) in found]
    return table(("what", "size", "aim", "measured", ""), lines) or "Not measured yet on one H200."


def _line(aim: Aim, row: measured.Row) -> tuple[str, ...]:
    if aim.least is not None:
        wanted, got = f"{aim.least:,.0f} frames/s", f"{measured.three_digits(row.rate)} frames/s"
        reached = row.rate >= aim.least
    else:
        assert aim.within is not None and row.compile_s is not None
        wanted, got = f"compiled within {aim.within:g} s", f"{row.compile_s:.1f} s"
        reached = row.compile_s <= aim.within
    return f"`{aim.what}`", aim.size, wanted, got, "reached" if reached else "**not reached**"
