"""What of an iteration is lost to the second GPU of one seed, and what CUDA graphs have to do with it."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from experiments.reproduction.page import commit, origin, paragraph, table
from t2tl_jax.runs.folder import read_json
from t2tl_jax.training.compiler_options import GRAPHS

FILE = "trial_second_gpu.json"
"""Iterations of one seed by one GPU and by two, as a run has them and with other options of XLA."""

OPTION = "xla_gpu_enable_command_buffer"
"""XLA's option that says what becomes part of CUDA graphs."""

USUAL, HOST = "as a run", "loops started by the host"
"""The form of a run's programs, and the one without loops as CUDA graphs."""


def second_gpu(results: Path) -> str:
    """Every iteration that was timed, and what follows for the second GPU; a sentence where none is stored."""
    if not (results / FILE).is_file():
        return "Not measured yet."
    stored = read_json(results / FILE)
    rows = list(_rows(stored["machines"]))
    heading = ("environments", "GPUs", "form", "commit", "an iteration")
    beside = " ".join(f"Machine {i}: {of['beside']}" for i, of in enumerate(stored["machines"], 1))
    options = {row["form"]: row["xla_flags"] for of in stored["machines"] for row in of["rows"] if row["xla_flags"]}
    named = "; ".join(f"*{form}* has it {_unlike_a_run(flags)}" for form, flags in options.items())
    parts = (
        paragraph(f"{stored['note']} {beside} Of a run's options of XLA one is another, `{OPTION}`: {named}."),
        table(heading, rows),
        origin([of["where"] for of in stored["machines"]]),
        paragraph(f"{_lost(stored['machines'])} {stored['failed']}"),
    )
    return "\n\n".join(parts)


def _rows(machines: list[Mapping[str, Any]]) -> Iterator[tuple[str, ...]]:
    for of in machines:
        for row in of["rows"]:
            took, least, most = (f"{1e3 * row[name]:.0f}" for name in ("seconds", "fastest", "slowest"))
            made = commit(of["where"])
            yield f"{row['num_envs']:,}", str(row["devices"]), row["form"], made, f"{took} ms ({least}, {most})"


def _unlike_a_run(flags: str) -> str:
    """What an option names more than it does in a run, and what it leaves out."""
    name, _, values = flags.partition("=")
    if name != f"--{OPTION}":
        raise ValueError(f"{FILE}: of XLA's options only {OPTION} is known here, got {flags!r}")
    usual, given = set(str(GRAPHS[OPTION]).split(",")), set(values.split(","))
    changes = [("with", given - usual), ("without", usual - given)]
    return " and ".join(f"{word} {', '.join(sorted(names))}" for word, names in changes if names)


def _lost(machines: list[Mapping[str, Any]]) -> str:
    """What both GPUs would make if the second one cost nothing, by the newest commit's iterations."""
    newest = machines[-1]["where"]["git_revision"]
    took = {
        (row["num_envs"], row["devices"], row["form"]): row["seconds"]
        for of in machines
        if of["where"]["git_revision"] == newest
        for row in of["rows"]
    }
    most, least = max(n for n, _, _ in took), min(n for n, _, _ in took)
    one, two, half, by_host = (took[key] for key in _keys(most, least))
    return f"""By commit {newest[:7]} two GPUs make {one / two:.2f} times what one makes. One GPU with half of the
        environments is done in {1e3 * half:.0f} ms, so that two which had nothing to tell each other would make
        {one / half:.2f} times as much: {1e3 * (half - one / 2):.0f} ms are not shared out by sharing out
        environments, and {1e3 * (two - half):.0f} ms come with the second GPU. With all loops started by the host one
        GPU took {1e3 * (by_host - half):.0f} ms more for half of the environments, of which a part may be due to what
        ran beside it; of the loops of two GPUs those of gradient steps and epochs are probably started so."""


def _keys(most: int, least: int) -> tuple[tuple[int, int, str], ...]:
    return (most, 1, USUAL), (most, 2, USUAL), (least, 1, USUAL), (least, 1, HOST)
