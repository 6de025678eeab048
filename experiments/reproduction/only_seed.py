"""What an axis for the only seed cost MJX's substep on a GPU, before it was left out."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from experiments.reproduction import halved
from experiments.reproduction.page import commit, origin, paragraph, table
from t2tl_jax.runs.folder import read_json

FILE = "trial_only_seed.json"
"""Random play in ZoneEnv with MJX, by how a batch is shaped."""

BEFORE = "profile_h200_large.json"
"""Of `experiments.benchmarks.profiles`: trainings of the program that still had the axis."""

PHYSICS = "physics"
"""The part that had the axis."""


def only_seed(results: Path) -> str:
    """A step of each shape, what is compiled for it, and what a training may gain; a sentence where none is stored."""
    if not (results / FILE).is_file():
        return "Not measured yet."
    stored = read_json(results / FILE)
    rows = []
    for one in stored["rows"]:
        seeds, num_envs, took = one["seeds"], one["num_envs"], one["milliseconds"]
        together = (seeds or 1) * num_envs
        shape = f"{seeds} x {num_envs:,}" if seeds else f"{num_envs:,}"
        rows.append((shape, f"{together:,}", f"{took:.2f} ms", f"{1e6 * took / together:.0f} ns"))
    parts = (
        paragraph(f"Random play, nothing learned. {stored['note']}"),
        table(("seeds x environments", "environments", "a step", "a step and environment"), rows),
        origin([stored["where"]]),
        paragraph(_gain(stored["rows"], results)),
        *_compiled(stored["compiled"]),
    )
    return "\n\n".join(parts)


def _gain(rows: Sequence[Mapping[str, Any]], results: Path) -> str:
    """How many times as long a step takes with the axis, and what that was to mean to the trainings that were profiled
    with it, and did."""
    took = {(one["seeds"], one["num_envs"]): one["milliseconds"] for one in rows}
    pairs = {num_envs: (took[1, num_envs], one) for (seeds, num_envs), one in took.items() if not seeds}
    said = [f"{with_it / without:.2f} times as long with {n:,} environments" for n, (with_it, without) in pairs.items()]
    text = f"With the axis of the only seed a step took {' and '.join(said)}."
    if not (results / BEFORE).is_file() or not (results / halved.FILE).is_file():
        return text
    before, after = (read_json(results / name) for name in (BEFORE, halved.FILE))
    gains = []
    for what, of in before["profiles"].items():
        num_envs = int(what.split(":")[-1])
        if num_envs not in pairs or what not in after["profiles"]:
            return text
        saved = (pairs[num_envs][0] - pairs[num_envs][1]) / 1e3 * of["frames"] / num_envs
        gains.append(_one_gain(what, of, after["profiles"][what], saved))
    return f"""{text} If a training saved as much in each step, what would that make of the iterations that were
        profiled with the axis (commit {commit(before["where"])}), and what did it (commit {commit(after["where"])}, on
        another machine of the kind)? {" ".join(gains)}"""


def _one_gain(what: str, before: Mapping[str, Any], after: Mapping[str, Any], saved: float) -> str:
    """Of an iteration on one GPU, as predicted from `saved` seconds and as measured; with its other parts as they were,
    since these may be faster on one machine than on another."""
    whole = before["seconds"]
    physics, now = (one["seconds"] * one["parts"][PHYSICS]["share"] for one in (before, after))
    others = (whole - physics) / (after["seconds"] - now)
    return f"""`{what}`: predicted {whole / (whole - saved):.2f} times as fast, measured
        {whole / after["seconds"]:.2f}; but parts that the axis has nothing to do with were {others:.2f} times as fast
        there, and without that it is {whole / (whole - physics + now):.2f}."""


def _compiled(made: Mapping[str, Any]) -> tuple[str, str]:
    said = f"""What the compiler of JAX {made["jax"]} makes of {made["what"]}, for {made["environments"]:,} environments
        on each {made["device"]}, asked on a machine without one. *Kernels* are the fused
        operations of the compiled program; arrays *with the rows last* have the forty-eight rows of a robot side by
        side in memory."""
    rows = [(form["shape"], str(form["kernels"]), str(form["rows_last"])) for form in made["forms"]]
    return paragraph(said), table(("shape", "kernels", "arrays with the rows last"), rows)
