"""The table of representations: what a formula becomes in each, against its size, and what compiling it costs."""

import statistics
import time
from pathlib import Path
from typing import Any

from envs.waterworld import COLOURS
from envs.zones import ZoneConfig, ZoneEnv
from experiments.reproduction.page import table
from experiments.reproduction.stored import Stored
from t2tl_jax.ltl import TaskTable, compile_named
from t2tl_jax.runs.folder import RunFolder, read_json, write_json
from t2tl_jax.runs.provenance import describe

NAME = "representations"
FILE = "table.json"
REPEATS = 5

ZONE_TASKS = ("phi_zone", "phi_zone_prime", "phi_safe")
WATER_TASKS = tuple(f"phi_water_{goals}_{obstacles}" for goals in (4, 5, 6) for obstacles in (1, 2))


def measure(folder: Path) -> None:
    """Compile the paper's tasks and store what came of it, as a finished run that trained nothing."""
    files = RunFolder(folder)
    folder.mkdir(parents=True, exist_ok=True)
    zones = ZoneEnv(ZoneConfig())
    rows = [_measured(task, zones.propositions, zones.alphabet) for task in ZONE_TASKS]
    rows += [_measured(task, tuple(COLOURS), "every_subset") for task in WATER_TASKS]
    write_json(files.versions, {"started": describe()})
    write_json(folder / FILE, {"rows": rows})
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
    """The table, from what was stored."""
    if NAME not in runs:
        return ""
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
        for row in read_json(runs[NAME].path / FILE)["rows"]
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
    note = (
        f"Nothing is trained: no seeds, no frames. Compiling is the median of {REPEATS} times (least to most), in\n"
        f"one process on the processor ({runs[NAME].versions.get('cpu') or 'not known which'}).\n\n"
        "The paper calls the Transformer's representation built on the fly. Here every method's formulas are compiled\n"
        "ahead into a table; what stays the same for every formula is the width of the learned code."
    )
    return f"{table(heading, rows)}\n\n{note}"
