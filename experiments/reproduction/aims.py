"""What this project aims at for trainings on one H200 and on two cores of a processor, beside what was measured."""

from dataclasses import dataclass
from pathlib import Path

from experiments.benchmarks import measured
from experiments.reproduction.page import paragraph, table
from experiments.reproduction.scaling import in_time

T1TL, T2TL = "zone_ppo_long:t1tl", "zone_ppo_long:t2tl"
SHORT_T1TL, SHORT_T2TL = "zone_ppo:t1tl", "zone_ppo:t2tl"
ONE, TWELVE = "1 seed", "12 seeds"
H200, TWO_CORES = ("NVIDIA H200",), ("cpu", "cpu")
HARDWARE = {H200: "H200", TWO_CORES: "2 CPU cores"}
"""By the names of the devices that JAX sees."""


@dataclass(frozen=True)
class Aim:
    """Of one training with so many seeds."""

    what: str
    size: str
    least: float | None = None
    """Frames/s of whole iterations that it should make at least."""
    within: float | None = None
    """Seconds that compiling should take at most."""
    devices: tuple[str, ...] = H200
    """On which hardware, of `HARDWARE`."""


AIMS = (
    Aim(T2TL, TWELVE, least=1_500_000),
    Aim(T1TL, TWELVE, least=2_500_000),
    Aim(f"{T1TL}:closed_form", TWELVE, least=12_000_000),
    Aim(T2TL, ONE, least=500_000),
    Aim(T1TL, ONE, least=800_000),
    Aim("waterworld_dqn:t1tl", TWELVE, least=300_000),
    Aim(T1TL, TWELVE, within=20),
    Aim(T2TL, TWELVE, within=30),
    Aim(SHORT_T2TL, ONE, least=6_000, devices=TWO_CORES),
    Aim(SHORT_T1TL, ONE, least=30_000, devices=TWO_CORES),
)


NOT_MEASURED = """Not measured: a second start of T1TL and T2TL on the H200, by the cache, in under 10 s."""

COMPILING = """In trials that are not stored, most of T1TL's compiling was the choice of a kernel for each of about a
hundred matrix products, most of them of the task's Transformer, whose four layers are written out. Without Triton's
products it compiled within the aim, but trained a tenth slower; fewer candidates for each saved little and made it a
third slower. Layers in a loop halve the products; on a CPU they compile and run slower, and on a GPU
that is not measured."""


def aims(results: Path) -> str:
    """Every aim that something stored decides: of several files of the same devices, made from clean commits, the
    newest."""
    found: dict[tuple[tuple[str, ...], str, str], measured.Row] = {}
    for where, rows in in_time(results):
        if not where.get("git_modified"):
            devices = tuple(where["devices"])
            found |= {(devices, row.what, row.size): row for row in rows if row.part == "training"}
    keys = [(aim, (aim.devices, aim.what, aim.size)) for aim in AIMS]
    lines = [_line(aim, found[key]) for aim, key in keys if key in found]
    if not lines:
        return "Not measured yet."
    shown = table(("what", "size", "hardware", "aim", "measured", ""), lines)
    return "\n\n".join((shown, paragraph(COMPILING), NOT_MEASURED))


def _line(aim: Aim, row: measured.Row) -> tuple[str, ...]:
    if aim.least is not None:
        wanted, rates = f"{aim.least:,.0f} frames/s", (row.rate, row.slowest, row.fastest)
        median, slowest, fastest = map(measured.three_digits, rates)
        got = f"{median} ({slowest}, {fastest}) frames/s"
        reached = row.rate >= aim.least
    else:
        assert aim.within is not None and row.compile_s is not None
        wanted, got = f"compiled within {aim.within:g} s", f"{row.compile_s:.1f} s"
        if row.trace_s is not None:
            got += f" ({row.compile_s + row.trace_s:.1f} s with tracing)"
        reached = row.compile_s <= aim.within
    outcome = "reached" if reached else "**not reached**"
    return f"`{aim.what}`", aim.size, HARDWARE[aim.devices], wanted, got, outcome
