"""What a large table and the replays of DQN take, from stored results."""

from pathlib import Path

from experiments.reproduction import page
from t2tl_jax.runs.folder import read_json

FILE = "room.json"
"""Of `experiments.benchmarks.room`, among the results."""


def table(results: Path) -> str:
    """Seconds and memory of compiling one large table."""
    if not (results / FILE).is_file():
        return "Not measured yet."
    stored = read_json(results / FILE)
    found, where = stored["table"], stored["where"]
    text = f"""
        {found["goals"]} goals in any order are a table of {found["rows"]:,} rows. `python -m t2tl_jax.ltl` compiles and
        describes it, from the start of the program on, in {found["seconds"]:.0f} s beside other work, of which it
        computes {found["processor_seconds"]:.0f} s on one core of {where["cpu_count"]}, and takes
        {found["memory_mib"]:,.0f} MiB (`python -m experiments.benchmarks.room`). {page.origin([where])}"""
    return page.paragraph(text)


def replays(results: Path) -> str:
    """How much memory replays take, by their shapes."""
    if not (results / FILE).is_file():
        return "Not measured yet."
    stored = read_json(results / FILE)
    rows = [
        (f"`{one['config']}`", f"`{one['method']}`", str(one["seeds"]), f"{one['bytes'] / 2**30:.2f} GiB")
        for one in stored["replays"]
    ]
    said = "The replay of all seeds together, by the shapes of its arrays (`python -m experiments.benchmarks.room`)."
    return "\n\n".join((page.paragraph(said), page.table(("configuration", "method", "seeds", "replay"), rows)))
