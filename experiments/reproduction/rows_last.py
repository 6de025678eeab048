"""What it matters whether the rows of MJX's contacts lie before the batch in memory, or behind it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from envs.straight_line.layout import ROWS_LAST_UP_TO
from experiments.reproduction.page import commit, origin, paragraph, table
from t2tl_jax.runs.folder import read_json

FILE = "trial_rows_last.json"
"""Random play in ZoneEnv with MJX in both forms, by turns, on several machines."""

HEADING = ("seeds x environments", "environments", "rows before", "rows behind", "ratio")


def rows_last(results: Path) -> str:
    """A step in both forms by the batch, a table for each machine; a sentence where none is stored."""
    if not (results / FILE).is_file():
        return "Not measured yet."
    stored = read_json(results / FILE)
    parts = [paragraph(f"Random play, nothing learned. {stored['note']}")]
    for machine in stored["machines"]:
        where = machine["where"]
        cores = f"On a host of {where['cpu_count']} cores, its processor alone." if where["backend"] == "cpu" else ""
        parts += [*[cores] * bool(cores), table(HEADING, map(_row, machine["rows"])), origin([where])]
    parts.append(paragraph(_as_chosen(stored["machines"])))
    made = stored["compiled"]
    said = f"""*Kernels* are the fused operations of what the compiler of JAX {made["jax"]} makes of {made["what"]}, for
        an {made["device"]}, asked on a machine without one at commit {commit(made)}."""
    kernels = [(f"{one['num_envs']:,}", str(one["rows_first"]), str(one["rows_last"])) for one in made["kernels"]]
    heading = ("environments", "kernels, rows before", "kernels, rows behind")
    return "\n\n".join([*parts, paragraph(said), table(heading, kernels)])


def _together(row: Mapping[str, Any]) -> int:
    return max(row["seeds"], 1) * row["num_envs"]


def _row(row: Mapping[str, Any]) -> tuple[str, ...]:
    seeds, each, before, behind = row["seeds"], row["num_envs"], row["rows_first"], row["rows_last"]
    return (
        f"{seeds} x {each:,}" if seeds else f"{each:,}",
        f"{_together(row):,}",
        f"{before:.2f} ms",
        f"{behind:.2f} ms",
        f"{before / behind:.2f}",
    )


def _as_chosen(machines: Any) -> str:
    """The rule that the program has, and whether it takes the faster form of everything that was measured."""
    wrong = []
    for machine in machines:
        longest = ROWS_LAST_UP_TO[machine["where"]["backend"]]
        for row in machine["rows"]:
            if (row["rows_first"] > row["rows_last"]) != (_together(row) <= longest):
                wrong.append(f"{_together(row):,}")
    faster = f"not the faster form of {', '.join(wrong)} environments" if wrong else "the faster form in every row"
    return f"""So rows lie behind a batch on a processor, and on every GPU behind one of up to
        {ROWS_LAST_UP_TO["gpu"]:,} environments. That is {faster}. Rows before the batch were summed up whole here; in
        long batches [they no longer are](#sums-of-rows-in-long-batches), and more sizes are there. Nothing was measured
        on other GPUs."""
