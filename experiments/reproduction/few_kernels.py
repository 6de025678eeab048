"""How many GPU kernels an iteration had when each array of a network was taken by itself, and how many it has."""

from pathlib import Path

from experiments.reproduction.page import commit, paragraph, table
from t2tl_jax.runs.folder import read_json

FILE = "trial_few_kernels.json"
"""Counted in what the compiler makes for a GPU, by the commit before and the first one with few."""


def few_kernels(results: Path) -> str:
    """A row for each training; a sentence where nothing is stored."""
    if not (results / FILE).is_file():
        return "Not measured yet."
    stored = read_json(results / FILE)
    rows = []
    for before, after in zip(stored["before"]["rows"], stored["after"]["rows"], strict=True):
        seeds = f"{before['seeds']} seed{'s' * (before['seeds'] > 1)}"
        counts = [f"{before[part]:,} -> {after[part]:,}" for part in ("step", "all")]
        rows.append((before["what"], seeds, *counts))
    said = f"""Fused operations in what the compiler of JAX {stored["jax"]} makes of one iteration for an
        {stored["device"]}, asked on a machine without one at commit {commit(stored["before"])} and at
        {commit(stored["after"])}: in the loop of gradient steps, and in the whole program. Each is a kernel; matrix
        products that are not fused, copies and what devices send each other are not counted. The text of the script is
        in `results/{FILE}`."""
    heading = ("training", "size", "of a gradient step", "of the program")
    return "\n\n".join([paragraph(said), table(heading, rows)])
