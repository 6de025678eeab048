"""What large tables, many letters, replays of DQN, files of metrics and groups of seeds take, from stored results."""

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from experiments.benchmarks.measured import three_digits
from experiments.reproduction import page
from t2tl_jax.runs.folder import read_json

FILE = "room.json"
"""Of `experiments.benchmarks.room`, among the results."""

LETTERS = "letters*.json"
"""Of `experiments.benchmarks.letters`."""

RECORDING = "recording.json"
"""Of `experiments.benchmarks.recording`."""

GROUPS = "groups_h100.json"
"""Of runs of `experiments.run` whose seeds did and did not train side by side."""


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


def letters(results: Path) -> str:
    """What compiling and steps cost by the number of letters, of every device that it was measured on."""
    files = sorted(results.glob(LETTERS))
    if not files:
        return "Not measured yet."
    text = """
        Every subset of the propositions is a letter (`python -m experiments.benchmarks.letters`). The formula `thirds`
        is `F(A & F(B & F C))` with a third of them at once in each place; `chain` has one after the other; `pairs` has
        any of the pairs of one from the first half and one from the second. Compiling is the median of all calls, and
        the slowest. Memory is the most of Python and NumPy meanwhile, and the table. A step is one letter of a batch,
        looked up in one row, or in all rows: the median of all calls, the fastest and the slowest."""
    return "\n\n".join((page.paragraph(text), *(_letters(read_json(file)) for file in files)))


def _letters(stored: Mapping[str, Any]) -> str:
    found, of = stored["results"], stored["settings"]
    rows = [
        (
            *(f"`{one['shape']}`", str(one["propositions"]), str(one["rows"]), str(one["parts"])),
            f"{1e3 * one['compile_s']['median']:.0f} ms ({1e3 * one['compile_s']['slowest']:.0f} ms)",
            f"{one['peak_mib'] + one['table_mib']:.1f} MiB",
            *(_nanoseconds(one[name]) for name in ("step_ns", "step_all_ns")),
        )
        for one in found
    ]
    text = f"""
        {of["repeats"]} calls each, of {of["steps"]} batches of {of["batch"]:,} letters. {stored.get("beside", "")}
        {stored.get("note", "")} {page.origin([stored["where"]])}"""
    heading = ("formula", "propositions", "rows", "parts", "compiling (slowest)", "memory", "in one row", "in all rows")
    return "\n\n".join((page.paragraph(text), page.table(heading, rows), page.paragraph(_relabelled(found))))


FEWER, MORE = 10, 20
"""Propositions between which a step was to cost the same: 2^10 letters and 2^20."""


def _relabelled(found: Sequence[Mapping[str, Any]]) -> str:
    """How many times as long a step takes with 2^20 letters as with 2^10, by formula; '' where that is not known."""
    steps = {(one["shape"], one["propositions"]): one for one in found}
    said = []
    for shape in dict.fromkeys(one["shape"] for one in found):
        fewer, more = (steps.get((shape, count)) for count in (FEWER, MORE))
        if fewer and more:
            one_row, all_rows = (more[name]["median"] / fewer[name]["median"] for name in ("step_ns", "step_all_ns"))
            said.append(
                f"`{shape}` {one_row:.2f} and {all_rows:.2f} (parts {fewer['parts']} and {more['parts']}, rows "
                f"{fewer['rows']} and {more['rows']})"
            )
    if not said:
        return ""
    return (
        f"With {MORE} propositions a step takes so many times as long as with {FEWER}, in one row and in all rows: "
        f"{'; '.join(said)}. The aim was that it costs the same."
    )


def _nanoseconds(measured: Mapping[str, float]) -> str:
    return f"{measured['median']:.3g} ns ({measured['fastest']:.3g} to {measured['slowest']:.3g})"


def recording(results: Path) -> str:
    """What the largest file of metrics takes to write and to read."""
    if not (results / RECORDING).is_file():
        return "Not measured yet."
    stored = read_json(results / RECORDING)
    found, of, each = stored["results"], stored["settings"], stored["results"]["iteration_ms"]
    text = f"""
        {of["seeds"]:,} seeds with {of["scalars"]} scalars each were written in {each["median"]:.1f} ms an iteration
        (median; the slowest {each["slowest"]:.1f} ms), by made-up numbers without a training; the file of
        {found["rows"]:,} rows has {found["file_mib"]:.0f} MiB and was read once, in {found["reading_s"]:.1f} s
        (`python -m experiments.benchmarks.recording`). {page.origin([stored["where"]])}"""
    return page.paragraph(text)


def groups(results: Path) -> str:
    """How fast seeds train in groups on a GPU, beside side by side."""
    if not (results / GROUPS).is_file():
        return "Not measured yet."
    stored = read_json(results / GROUPS)
    rows = [
        (
            *(f"`{one['config']}:{one['method']}`", str(one["seeds"])),
            f"{one['at_once']}" + ("" if one["asked"] or one["at_once"] == one["seeds"] else ", chosen by the program"),
            f"{one['iterations']}",
            f"{one['training_seconds']:.1f} s",
            f"{three_digits(one['seeds'] * one['frames'] / one['training_seconds'])} frames/s",
        )
        for one in stored["runs"]
    ]
    heading = ("training", "seeds", "at once", "iterations", "training", "all seeds together")
    commands = "\n".join(f"    {shlex.join(one['command'])}" for one in stored["runs"])
    told = page.paragraph(f"{stored['note']} {stored['beside']} {page.origin([stored['where']])}")
    return "\n\n".join((commands, page.table(heading, rows), told))
