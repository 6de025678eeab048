"""The first table of the page of agents for any task: all aims, what was measured, and what becomes of them."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from experiments.benchmarks import measured
from experiments.reproduction import typed
from experiments.reproduction.anytask.items import AIMS, ANY_ITEMS
from experiments.reproduction.page import paragraph, table
from experiments.reproduction.sections.anyaims import AIMS_HEADING, MISSED, REACHED, Aim
from experiments.reproduction.stored import Stored
from t2tl_jax.runs.folder import read_json

BENCHMARK = "benchmark_h200_whole.json"
"""Of environments alone on one GPU, among the results."""

LEAST_STEPS = 100e6
"""A second, of the worlds that were written for these agents."""

WORLDS = {"letterworld": "LetterWorld", "flatworld": "FlatWorld"}
"""What rows of the benchmark begin with, and what the worlds are called."""

PUBLISHED = """
"Better than every published method" is shown for the methods that have figures in the same worlds, in the tables below.
For StructLTL, SemLTL, Jaxolotl and PlatoLTL it is not decided, since their worlds differ (or, of PlatoLTL, we have no
figures)."""


def summary(runs: Mapping[str, Stored], results: Path) -> str:
    """All aims of the page, each with a link to where it is measured; '' where there is none.

    Args:
        runs: those of agents for any task.
        results: folder of everything that is stored.
    """
    rows = [
        (f"[{about}](#{anchor(ANY_ITEMS[item].title)})", *aim)
        for item, (about, aims) in AIMS.items()
        for aim in aims(runs)
    ]
    rows += [("[prompt](usage.md)", *aim) for aim in prompt(results)]
    rows += [("[speed](performance.md)", *aim) for aim in speed(results)]
    if not rows:
        return ""
    shown = table(("where", *AIMS_HEADING[:-1], "verdict"), rows)
    return "\n\n".join(("## In short", paragraph(_counted([row[-1] for row in rows])), shown, paragraph(PUBLISHED)))


def _counted(verdicts: Sequence[str]) -> str:
    """How many aims are reached, and how many of them not without doubt."""
    reached = [verdict for verdict in verdicts if verdict.startswith(REACHED)]
    doubted = sum(verdict != REACHED for verdict in reached)
    said = f"Of the {len(verdicts)} lines of this table {len(reached)} say reached"
    return f"{said}, {doubted} of these with a reservation beside it." if doubted else f"{said}."


def anchor(title: str) -> str:
    """What a link to a heading is called: small letters, hyphens for spaces, and no other signs."""
    return re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")


def prompt(results: Path) -> list[Aim]:
    """How soon stored agents act on a formula that is typed."""
    if not (results / typed.FILE).is_file():
        return []
    stored = read_json(results / typed.FILE)
    found, aim = stored["results"], stored["settings"]["aim_ms"]
    medians = {Path(run).name: of["action_ms"][of["quantiles"].index(0.5)] for run, of in found.items()}
    slowest = max(max(of["action_ms"]) for of in found.values())
    late, counted = (sum(of[name] for of in found.values()) for name in ("late", "counted"))
    said = ", ".join(f"{median:.1f} ({run})" for run, median in medians.items())
    held = REACHED
    if late:
        held = f"{MISSED} by every formula: {late} of {counted} took longer, the slowest {slowest:.1f}"
    return [
        (
            "milliseconds from a typed formula to the first action",
            f"under {aim:g}",
            f"median {said}",
            held,
        )
    ]


def speed(results: Path) -> list[Aim]:
    """How many steps of the bare worlds one GPU does in a second, from the fewest to the most at once."""
    if not (results / BENCHMARK).is_file():
        return []
    rows = [row for row in measured.read(results / BENCHMARK)[1] if row.part == "environments"]
    found = []
    for begins, world in WORLDS.items():
        of_world = [row for row in rows if row.what.startswith(begins)]
        if not of_world:
            continue
        said = ", ".join(f"{row.rate / 1e6:,.0f} million ({row.size})" for row in of_world)
        reached = any(row.rate >= LEAST_STEPS for row in of_world)
        bar = f"at least {LEAST_STEPS / 1e6:g} million"
        found.append((f"steps of {world} a second, one H200", bar, said, REACHED if reached else MISSED))
    return found
