"""What loops as CUDA graphs gain: stored benchmarks before and after them, and the trial that they come from."""

from pathlib import Path
from typing import Any

from experiments.benchmarks import measured
from experiments.benchmarks.measured import three_digits
from experiments.reproduction.page import origin, paragraph, table
from experiments.reproduction.scaling import in_time
from t2tl_jax.runs.folder import read_json

TRIAL = "trial_graphs.json"
USUAL = "JAX"
"""The form that JAX's own settings give."""

AFTER = (
    "benchmark_h200_graphs.json",
    "benchmark_h200_graphs_closed.json",
    "benchmark_h200_two_graphs.json",
    "benchmark_h200_dqn.json",
)
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
                memory, compiling = (
                    _both(was, row, of, digits) for of, digits in (("memory_mib", 0), ("compile_s", 1))
                )
                rows.append((row.what, row.size, count, rates[0], commit, rates[1], ratio, memory, compiling))
    if not rows:
        return ""
    heading = ("what", "size", "GPUs", "before", "commit", "with graphs", "ratio", "memory, MiB", "compiling, s")
    return f"{table(heading, rows)}\n\n{origin(versions)}"


def _both(before: measured.Row, after: measured.Row, name: str, digits: int) -> str:
    """A cost before and with graphs."""
    values = [getattr(one, name) for one in (before, after)]
    return "-" if None in values else " -> ".join(f"{value:,.{digits}f}" for value in values)


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
        paragraph(f"The trial. Milliseconds of an iteration, and how many times as fast as JAX has it. {said}."),
        table(("training", "size", "machine", *forms), rows),
        paragraph(f"{stored['note']} {origin([stored['where']])}"),
        paragraph(_same(stored["same"])),
    )
    return "\n\n".join(parts)


def _milliseconds(seconds: list[float] | None, usual: float | None) -> str:
    if seconds is None:
        return "-"
    median, fastest, slowest = (f"{1e3 * one:.0f}" for one in seconds)
    faster = "" if usual is None else f", {usual / seconds[0]:.2f}"
    return f"{median} ({fastest}, {slowest}){faster}"


def _same(same: dict[str, Any]) -> str:
    ordered = same["equal_with_deterministic_operations"]
    times = [
        f"`{what}` {1e3 * seconds['JAX']:.0f} and {1e3 * seconds['side by side']:.0f} ms"
        for what, seconds in same["deterministic_seconds"].items()
    ]
    return (
        f"Are the numbers the same? {same['note']} DQN ({_names(same['equal'])}): all bits are equal in the form "
        f"*{same['equal_form']}* and as JAX has it. PPO: two runs of the very same program, as JAX has it, differ by "
        f"themselves ({_names(same['differ_by_themselves'])}; others were not run twice). With XLA's deterministic "
        "operations, where sums have an order, two runs of it do not, and all bits are equal in the form "
        f"*{same['equal_with_deterministic_operations_form']}* and as JAX has it ({_names(ordered)}); the form *both* "
        "was not tried with them. Deterministic operations cost: an iteration takes, as JAX has it and side by side, "
        f"{'; '.join(times)}. Whoever wants a run by PPO on a GPU to be repeated sets "
        "`XLA_FLAGS=--xla_gpu_deterministic_ops=true`; the runs that are reported here did not."
    )


def _names(names: list[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)
