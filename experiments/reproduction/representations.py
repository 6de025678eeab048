"""The table of representations: what a formula becomes in each, against its size, and what compiling it costs."""

import statistics
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from envs.waterworld import COLOURS
from envs.zones import ZoneConfig, ZoneEnv
from experiments.paper.published_representations import PROPERTIES
from experiments.reproduction.page import table
from experiments.reproduction.stored import Stored
from t2tl_jax.ltl import TaskTable, compile_named
from t2tl_jax.runs.folder import RunFolder, read_json, write_json
from t2tl_jax.runs.provenance import describe

NAME = "representations"
FILE = "table.json"
REPEATS = 101
"""Times that each formula is compiled; on a machine that others use too, the median of few of them jumps."""

EARLIER_REPEATS = 5
"""Of what was stored before their number was stored with it."""

ZONE_TASKS = ("phi_zone", "phi_zone_prime", "phi_safe")
OWN, SAME = "phi_water", "phi_water_5_3"
"""The paper's formula, and its name among those of the tables of steps."""

WATER_TASKS = (OWN, *(f"phi_water_{goals}_{obstacles}" for goals in (4, 5, 6) for obstacles in (1, 2)), SAME)


def measure(folder: Path) -> None:
    """Compile the paper's tasks and store what came of it, as a finished run that trained nothing."""
    files = RunFolder(folder)
    folder.mkdir(parents=True, exist_ok=True)
    zones = ZoneEnv(ZoneConfig())
    rows = [_measured(task, zones.propositions, zones.alphabet) for task in ZONE_TASKS]
    rows += [_measured(task, tuple(COLOURS), "every_subset") for task in WATER_TASKS]
    write_json(files.versions, {"started": describe()})
    write_json(folder / FILE, {"repeats": REPEATS, "rows": rows})
    write_json(files.status, {"state": "finished", "ended": "complete", "seeds": []})


def _measured(task: str, propositions: tuple[str, ...], alphabet: Any) -> dict[str, Any]:
    seconds, compiled = [], None
    for _ in range(REPEATS):
        began = time.perf_counter()
        compiled = compile_named(task, propositions, alphabet)
        seconds.append(time.perf_counter() - began)
    assert isinstance(compiled, TaskTable)
    lengths = compiled.mask.sum(axis=-1)
    return {
        "task": task,
        "tokens": int(lengths[int(compiled.initial_row[0])]),
        "sub_tasks": int(compiled.is_open.sum()),
        "letters": compiled.num_letters,
        "milliseconds": 1000 * statistics.median(seconds),
        "least_and_most": [1000 * min(seconds), 1000 * max(seconds)],
    }


def section(runs: dict[str, Stored]) -> str:
    """The table, from what was stored, and the published one beside it."""
    if NAME not in runs:
        return ""
    content = read_json(runs[NAME].path / FILE)
    measured, repeats = content["rows"], content.get("repeats", EARLIER_REPEATS)
    rows = [
        (
            f"`{row['task']}`",
            str(row["tokens"]),
            str(row["sub_tasks"]),
            "1",
            str(row["sub_tasks"]),
            "16 (ZoneEnv), 32 (WaterWorld)",
            f"{row['sub_tasks'] + 2} x {row['letters']}",
            "{:.1f} ms ({:.1f} to {:.1f})".format(row["milliseconds"], *row["least_and_most"]),
        )
        for row in measured
    ]
    heading = (
        "task",
        "tokens",
        "sub-tasks",
        "automaton's state as a number",
        "one-hot, at least",
        "Transformer's code, any formula",
        "table, rows x letters",
        "compiling the table",
    )
    same = f"`{SAME}` is `{OWN}` by another name. " if {OWN, SAME} <= {row["task"] for row in measured} else ""
    note = (
        f"{same}Nothing is trained: no seeds, no frames. Compiling is the median of {repeats} times (least to most), "
        f"in one process on the processor ({runs[NAME].versions.get('cpu') or 'not known which'})."
    )
    return f"{table(heading, rows)}\n\n{note}\n\n{_beside_published(measured)}"


def _beside_published(measured: Sequence[dict[str, Any]]) -> str:
    """What the paper says in words, and what it comes to here."""
    sub_tasks, tokens = _span(measured, "sub_tasks"), _span(measured, "tokens")
    median = max(row["milliseconds"] for row in measured)
    longest = max(row.get("least_and_most", [0.0, row["milliseconds"]])[1] for row in measured)
    ours = {
        "size": (
            f"1 number, or one-hot one for each sub-task, {sub_tasks}",
            f"{tokens} tokens are read; the code has the same width for every formula",
        ),
        "made": ("compiled from the formula, nothing by hand", "learned, from tables compiled from the formula"),
        "when": (
            f"in advance, in {longest:.1f} ms at most, medians up to {median:.1f} ms",
            "the tables likewise; codes from the present parameters",
        ),
        "to be interpreted": ("not measured", "by its attention, see `--only attention`"),
    }
    heading = (
        "",
        "automaton or reward machine, published",
        "automaton or reward machine, here",
        "Transformer, published",
        "Transformer, here",
    )
    rows = [(what, machine, ours[what][0], reader, ours[what][1]) for what, machine, reader in PROPERTIES]
    said = "The paper's Table I is in words and names no formula. In other words, beside what is there here:"
    return f"{said}\n\n{table(heading, rows)}"


def _span(rows: Sequence[dict[str, Any]], name: str) -> str:
    values = [row[name] for row in rows]
    return f"{min(values)} to {max(values)}"
