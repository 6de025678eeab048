"""Where the time goes while XLA compiles an iteration for a GPU."""

from pathlib import Path

from experiments.reproduction.page import origin, paragraph, table
from t2tl_jax.runs.folder import read_json

FILE = "trial_compiling.json"
"""Read off JAX's profiler."""


def compiling(results: Path) -> str:
    """Its steps one after another; a sentence where none are stored."""
    if not (results / FILE).is_file():
        return "Not measured yet."
    stored = read_json(results / FILE)
    whole = stored["seconds"]
    rows = [
        (what, f"{begin:.1f} s", f"{end - begin:.1f} s", f"{(end - begin) / whole:.0%}")
        for what, begin, end in stored["steps"]
    ]
    said = f"""
        `{stored["training"]}`, {stored["seeds"]} seeds: {whole:.1f} s under the profiler,
        {stored["without_profiler"]:.1f} s without it. {stored["note"]}"""
    return "\n\n".join([paragraph(said), table(("step", "begins", "takes", "share"), rows), origin([stored["where"]])])
