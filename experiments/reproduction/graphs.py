"""What loops as CUDA graphs gain: stored benchmarks before and after them, and the trial that they come from."""

from pathlib import Path
from typing import Any

from experiments.benchmarks import measured
from experiments.benchmarks.measured import three_digits
from experiments.reproduction.page import origin, paragraph, table
from experiments.reproduction.scaling import in_time
from t2tl_jax.runs.folder import read_json

TRIAL = "trial_graphs.json"
USUAL, BOTH = "usual", "both"

AFTER = ("benchmark_h200_graphs.json", "benchmark_h200_graphs_closed.json", "benchmark_h200_two_graphs.json")
"""The first benchmarks with graphs."""


def graphs(results: Path) -> str:
    """Both tables, and whether numbers stay the same."""
    return "\n\n".join(part for part in (_benchmarks(results), _trial(results)) if part) or "Not measured yet."


def _benchmarks(results: Path) -> str:
    """Each of the first rates with graphs beside the newest one before, on as many devices of the same kind."""
    before: dict[tuple[Any, ...], tuple[measured.Row, str]] = {}
    rows, versions = [], []
    files = {name: measured.read(results / name) for name in AFTER if (results / name).is_file()}
    first = min((where["time"] for where, _ in files.values()), default="")
    for where, some in in_time(results):
        if where.get("time", "") < first and not where.get("git_modified"):
            before |= {(tuple(where["devices"]), *row.key): (row, where["git_revision"][:7]) for row in some}
    for where, some in files.values():
        versions.append(where)
        for row in some:
            old = before.get((tuple(where["devices"]), *row.key))
            if old is not None:
                was, commit = old
                rates = [f"{three_digits(one.rate)} {one.unit}" for one in (was, row)]
                count, ratio = str(len(where["devices"])), f"{row.rate / was.rate:.2f}"
                rows.append((row.what, row.size, count, rates[0], commit, rates[1], ratio))
    if not rows:
        return ""
    heading = ("what", "size", "GPUs", "before", "commit", "with graphs", "ratio")
    return f"{table(heading, rows)}\n\n{origin(versions)}"


def _trial(results: Path) -> str:
    if not (results / TRIAL).is_file():
        return ""
    stored = read_json(results / TRIAL)
    forms = stored["forms"]
    rows = []
    for one in stored["iterations"]:
        usual = one["seconds"][USUAL][0]
        cells = [_milliseconds(one["seconds"].get(form), usual if form != USUAL else None) for form in forms]
        seeds = "1 seed" if one["seeds"] == 1 else f"{one['seeds']} seeds"
        rows.append((f"`{one['what']}`", seeds, str(one["machine"]), *cells))
    said = "; ".join(f"*{form}*: {what}" for form, what in forms.items())
    parts = (
        paragraph(f"The trial. Milliseconds of an iteration, and how many times as fast as usual. {said}."),
        table(("training", "size", "machine", *forms), rows),
        paragraph(f"{stored['note']} {origin([stored['where']])}"),
        paragraph(_same(stored["same"], {one["what"]: one["seconds"][USUAL][0] for one in _of_many(stored)})),
    )
    return "\n\n".join(parts)


def _of_many(stored: dict[str, Any]) -> list[dict[str, Any]]:
    """Of each training the last iterations of several seeds."""
    return [one for one in stored["iterations"] if one["seeds"] > 1]


def _milliseconds(seconds: list[float] | None, usual: float | None) -> str:
    if seconds is None:
        return "-"
    median, fastest, slowest = (f"{1e3 * one:.0f}" for one in seconds)
    faster = "" if usual is None else f", {usual / seconds[0]:.2f}"
    return f"{median} ({fastest}, {slowest}){faster}"


def _same(same: dict[str, Any], usual: dict[str, float]) -> str:
    price = [f"`{what}` {seconds[USUAL] / usual[what]:.2f}" for what, seconds in same["deterministic_seconds"].items()]
    return (
        f"Are the numbers the same? {same['note']} Of DQN ({_names(same['equal'])}) all bits are equal with and "
        f"without the options ({same['equal_forms']}). Of PPO two runs of the very same program differ by themselves "
        f"({_names(same['differ_by_themselves'])}, without the options). With XLA's deterministic operations "
        "(`XLA_FLAGS=--xla_gpu_deterministic_ops=true`), where sums have an order, they do not, and all bits are equal "
        f"with and without the options ({same['equal_with_deterministic_operations_forms']}) in "
        f"{_names(same['equal_with_deterministic_operations'])}. An iteration with deterministic operations takes so "
        f"many times as long as usual: {', '.join(price)}. Whoever wants a run by PPO on a GPU to be repeated bit for "
        "bit sets that flag; the runs that are reported here did not."
    )


def _names(names: list[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)
