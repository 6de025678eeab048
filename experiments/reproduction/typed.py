"""How soon a stored agent acts on a formula that is typed, from stored results."""

import shlex
from pathlib import Path

from experiments.reproduction.page import origin, paragraph, table
from t2tl_jax.runs.folder import read_json

FILE = "prompt.json"
"""Of `experiments.benchmarks.prompt`, among the results."""

AIM = 5.0
"""Milliseconds from a text to the first action, once warmed up."""


def typed(results: Path) -> str:
    """By run, quantiles of the times from a text to the table and to the first action, beside the aim."""
    if not (results / FILE).is_file():
        return "Not measured yet."
    stored = read_json(results / FILE)
    rows = []
    for run, of in stored["results"].items():
        median = of["action_ms"][of["quantiles"].index(0.5)]
        rows.append(
            (
                f"`{run}`",
                f"{of['counted']} of {of['drawn']}",
                *(", ".join(f"{value:.1f}" for value in of[name]) for name in ("compile_ms", "action_ms")),
                "reached" if median < AIM else "**not reached**",
            )
        )
    heading = ("run", "formulas", "to the table, ms", "to the first action, ms", f"median under {AIM:g} ms")
    said = f"""
        `{shlex.join(stored["where"]["command"])}`: formulas drawn from the family of each agent's training, but for
        those that a program had to be compiled for. Median, 95 % quantile and maximum, from the text on."""
    return "\n\n".join((paragraph(said), table(heading, rows), origin([stored["where"]])))
