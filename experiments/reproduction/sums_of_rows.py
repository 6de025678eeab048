"""What difference it makes how the rows of MJX's contacts are summed up."""

from collections.abc import Mapping
from pathlib import Path
from statistics import fmean
from typing import Any

from envs.straight_line.layout import PARTS, ROWS_LAST_UP_TO, ROWS_WHOLE_UP_TO
from experiments.reproduction.page import commit, origin, paragraph, table
from t2tl_jax.runs.folder import read_json

FILE = "trial_sums_of_rows.json"
"""Random play in ZoneEnv with MJX in many forms, by turns; and what is compiled for them."""

FORMS = {
    "last": "rows behind",
    "plain": "whole",
    **{f"r{parts}": f"{parts} parts" for parts in (2, 3, 4, 6, 8, 12, 16)},
    **{f"s{parts}": f"{parts} parts, one by one" for parts in (4, 6, 12)},
    "tree": "halves of halves",
}
"""What the forms are called on the page, by their names in the script."""

CHOSEN = f"r{PARTS}"

CLEAR = 1.02
"""So many times as fast a form is more than slightly faster."""


def sums_of_rows(results: Path) -> str:
    """A step by the form and the batch, whether the program's is the fastest, and kernels; a sentence if not stored."""
    if not (results / FILE).is_file():
        return "Not measured yet."
    stored = read_json(results / FILE)
    measured = sorted((row for run in stored["runs"] for row in run["rows"]), key=lambda row: row["num_envs"])
    forms = [form for form in FORMS if any(form in row["forms"] for row in measured)]
    made = stored["compiled"]
    asked = f"""*Kernels* are the fused operations of what the compiler of JAX {made["jax"]} makes of {made["what"]},
        for an {made["device"]}, asked on a machine without one at commit {commit(made)}; its seconds are of
        {made["on"]}."""
    parts = (
        paragraph(f"Random play, nothing learned; milliseconds of a step. {stored['note']}"),
        table(("environments", *(FORMS[form] for form in forms)), [_times(row, forms) for row in measured]),
        origin([run["where"] for run in stored["runs"]]),
        paragraph(_as_chosen(measured)),
        paragraph(asked),
        _kernels(made["forms"]),
        paragraph(f"""Whole iterations, asked at commit {commit(stored["iterations"]["where"])}: seconds of compiling
            on two cores, beside small work at times, in one process: once with whole rows first, and once with parts
            first. Tracing does not count."""),
        _iterations(stored["iterations"]["rows"]),
    )
    return "\n\n".join(parts)


def _times(row: Mapping[str, Any], forms: list[str]) -> tuple[str, ...]:
    times = (row["forms"].get(form) for form in forms)
    return f"{row['num_envs']:,}", *(f"{time[0]:.2f}" if time else "-" for time in times)


def _kernels(made: list[Mapping[str, Any]]) -> str:
    sizes = sorted({one["num_envs"] for one in made})
    found = {(one["form"], one["num_envs"]): f"{one['kernels']} ({one['seconds']:.0f} s)" for one in made}
    rows = [
        (name, *(found.get((form, size), "-") for size in sizes))
        for form, name in FORMS.items()
        if any((form, size) in found for size in sizes)
    ]
    return table(("form", *(f"{size:,} environments" for size in sizes)), rows)


def _iterations(rows: list[Mapping[str, Any]]) -> str:
    """Of each training with whole rows and with parts."""
    spent: dict[tuple[str, int, int], list[str]] = {}
    kernels = {}
    for row in rows:
        key = row["what"], row["seeds"], row["parts"]
        spent.setdefault(key, []).append(f"{row['seconds']:.0f} s")
        kernels[key] = str(row["kernels"])
    cells = [
        (what, str(seeds), FORMS["plain" if parts == 1 else f"r{parts}"], kernels[what, seeds, parts], ", ".join(times))
        for (what, seeds, parts), times in spent.items()
    ]
    return table(("training", "seeds", "form", "kernels", "compiling"), cells)


def _as_chosen(measured: list[Mapping[str, Any]]) -> str:
    """The rule that the program has, what it gains, and where another form was clearly faster."""
    times: dict[int, dict[str, list[float]]] = {}
    for row in measured:
        for form, (time, *_) in row["forms"].items():
            times.setdefault(row["num_envs"], {}).setdefault(form, []).append(time)
    apart = max(max(of) / min(of) for forms in times.values() for of in forms.values())
    gains = [
        row["forms"]["plain"][0] / row["forms"][CHOSEN][0]
        for row in measured
        if row["num_envs"] > ROWS_WHOLE_UP_TO and {"plain", CHOSEN} <= set(row["forms"])
    ]
    if not gains:
        raise ValueError(
            f"{FILE}: rows in {PARTS} parts were not timed beside whole ones, so nothing says why to cut them"
        )
    faster = []
    for num_envs, forms in times.items():
        mean = {form: fmean(of) for form, of in forms.items()}
        best = min(mean, key=lambda form: mean[form])
        ratio = mean[_own(num_envs)] / mean[best]
        if ratio > CLEAR:
            faster.append(f"{FORMS[best]} with {num_envs:,} environments ({ratio:.2f} times as fast)")
    which = f", where the fastest was {'; '.join(faster)}" if faster else ""
    return f"""So on a GPU rows that lie before a batch are summed up whole for up to {ROWS_WHOLE_UP_TO:,} environments,
        and in {PARTS} parts for more. That makes a step of these {min(gains):.2f} to {max(gains):.2f} times as fast as
        whole rows do in the same process. Another form than the program's was at least {CLEAR} times as fast in
        {len(faster)} of {len(times)} sizes{which}. Two processes took up to {apart:.2f} times as long as each other for
        the same form and size. Nothing was measured with more environments than {max(times):,}, with an axis of seeds,
        or on other GPUs. The script puts forms into the program of the commit above, so that the code of the form that
        was taken was not timed by it."""


def _own(num_envs: int) -> str:
    """The form that the program has on a GPU."""
    return "last" if num_envs <= ROWS_LAST_UP_TO["gpu"] else "plain" if num_envs <= ROWS_WHOLE_UP_TO else CHOSEN
