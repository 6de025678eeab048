"""How soon a stored agent acts on a formula that is typed, from stored results."""

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from experiments.reproduction.page import origin, paragraph, table
from t2tl_jax.runs.folder import read_json

FILE = "prompt.json"
"""Of `experiments.benchmarks.prompt`, among the results."""

JUDGED = {0.5: "median", 0.95: "95 % quantile"}
"""Quantiles of the times that are compared with the aim, which is one for every formula."""


def typed(results: Path) -> str:
    """By run, quantiles of the times from a text to the table and to the first action, and how many reach the aim."""
    if not (results / FILE).is_file():
        return "Not measured yet."
    stored = read_json(results / FILE)
    found, aim = stored["results"], stored["settings"]["aim_ms"]
    rows = [
        (
            f"`{run}`",
            f"{of['counted']} of {of['drawn']}",
            *(", ".join(f"{value:.1f}" for value in of[name]) for name in ("compile_ms", "action_ms")),
            *("reached" if _quantile(of, one) < aim else "**not reached**" for one in JUDGED),
            str(of["late"]),
        )
        for run, of in found.items()
    ]
    heading = (
        *("run", "formulas", "to the table, ms", "to the first action, ms"),
        *(f"{name} under {aim:g} ms" for name in JUDGED.values()),
        f"{aim:g} ms or longer",
    )
    said = f"""
        `{shlex.join(stored["where"]["command"])}`: formulas drawn from the family of each agent's training, but for
        those that a program had to be compiled for. Median, 95 % quantile and maximum, from the text on."""
    parts = (paragraph(said), table(heading, rows), paragraph(_verdict(found, aim)), paragraph(_load(stored)))
    return "\n\n".join((*parts, origin([stored["where"]])))


def _verdict(found: Mapping[str, Any], aim: float) -> str:
    """What becomes of an aim that is one for every formula."""
    late, counted = (sum(of[name] for of in found.values()) for name in ("late", "counted"))
    slowest = max(_quantile(of, 1.0) for of in found.values())
    by = [f"by the {name} in {_in_which(found, one, aim)}" for one, name in JUDGED.items()]
    return (
        f"Asked for is a first action in under {aim:g} ms, of every formula. That is reached {' and '.join(by)}: "
        f"{late} of {counted} formulas took longer, and the slowest {slowest:.1f} ms."
    )


def _in_which(found: Mapping[str, Any], quantile: float, aim: float) -> str:
    reached = [Path(run).name for run, of in found.items() if _quantile(of, quantile) < aim]
    others = [Path(run).name for run in found if Path(run).name not in reached]
    if not others:
        return "each"
    return f"{', '.join(reached)}, not in {', '.join(others)}" if reached else "none"


def _load(stored: Mapping[str, Any]) -> str:
    """How busy the machine was with other work, for which a formula may have waited."""
    before, after = stored["load"]
    return (
        f"The machine is shared with other work: its load average was {before:.1f} before and {after:.1f} after, on "
        f"{stored['where']['cpu_count']} cores. What this command makes of it is about 1."
    )


def _quantile(of: Mapping[str, Any], quantile: float) -> float:
    return float(of["action_ms"][of["quantiles"].index(quantile)])
