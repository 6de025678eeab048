"""What was tried to make starts shorter, and what it gained."""

from collections.abc import Mapping
from pathlib import Path
from statistics import fmean
from typing import Any

from experiments.reproduction.page import commit, origin, paragraph, table
from t2tl_jax.runs.folder import read_json

ASKED = ("trial_early_start.json", "trial_early_start_shared.json", "starts_h100_four.json")
"""With and without a GPU that is asked for while modules load, by turns; with it; and without it."""
SMALL = ("trial_small_programs.json", "starts_h200_kept_shared.json")
"""With programs kept however short they took to compile, and as JAX keeps them."""
EARLY = "trial_early_gpu.json"
"""Versions by turns: one that makes the GPU ready while modules load, and one that looks for garbage less."""

GARBAGE = "trial_garbage.json"
"""Loading and tracing with garbage looked for, and as a run does it, by turns."""

FORMS = {
    "before": "before",
    "early": "with the GPU made ready while modules load",
    "early, no garbage at all": "the same, and the whole process looks for no garbage",
    "early, ended at once": "the same but for garbage, and the process ends without Python's own end",
    "now": "with the GPU made ready, no search for garbage while modules load and a training is traced, and all keys "
    "by one program",
}
"""What the forms are called on the page, by their names in the file."""


def trials(results: Path) -> list[str]:
    """Paragraphs and tables, in the order of the trials; those that are not stored are left out."""
    return [*map(paragraph, (*_asked_for(results), *_small(results))), *_early(results), *_garbage(results)]


def _asked_for(results: Path) -> list[str]:
    """What it gained to ask for the GPU while modules load: starts with it and without."""
    alone, shared, without = (results / name for name in ASKED)
    if not all(file.is_file() for file in (alone, shared, without)):
        return []
    stored = read_json(alone)
    first, later = {}, {}
    for form, starts in stored["starts"].items():
        first[form], *rest = (f"{one['process']:.1f}" for one in starts)
        later[form] = ", ".join(rest)
    both = [read_json(file)["starts"] for file in (shared, without)]
    second = [
        f"`{what}` {of['second']['process']:.1f} s with it and {both[1][what]['second']['process']:.1f} s without"
        for what, of in both[0].items()
    ]
    return [
        f"A trial asked for the GPU while modules load. `{stored['training']}` was started with it and without it, by "
        f"turns, on a host with one GPU and nothing else to do. The first start of each traced everything anew, and "
        f"took {first['with']} s with it, where nothing was compiled before, and {first['without']} s without. Each "
        f"later one took {later['with']} s with it and {later['without']} s without. On a shared host with four GPUs a "
        f"second start took: {'; '.join(second)}. That is no clear gain, a GPU that fails was hidden by it, and it was "
        f"taken out; what was missing is said below. {stored['note']} {origin([stored['where']])}"
    ]


def _small(results: Path) -> list[str]:
    """What it gained to keep every compiled program, however small: starts with it and without."""
    if not all((results / name).is_file() for name in SMALL):
        return []
    every, usual = (read_json(results / name) for name in SMALL)
    second = []
    for what, of in every["starts"].items():
        with_it, without = (starts["second"]["process"] for starts in (of, usual["starts"][what]))
        second.append(f"`{what}` {with_it:.1f} s with it and {without:.1f} s without")
    return [
        "A trial kept every compiled program; else a second start compiles anew what takes less than a second, which "
        f"is JAX's limit for keeping it. A second start, once each: {'; '.join(second)}. No gain is to be seen, and "
        f"it was taken out. {every['note']} {origin([every['where']])}"
    ]


def _early(results: Path) -> list[str]:
    """Where a second start went before, what two changes gained by turns, and what else was tried with them."""
    if not (results / EARLY).is_file():
        return []
    stored = read_json(results / EARLY)
    rows = [
        (f"`{what}`", str(host), FORMS[form], _traced(of["first"]), _each(of["later"]))
        for host, run in enumerate(stored["runs"], 1)
        for what, forms in run["starts"].items()
        for form, of in forms.items()
    ]
    saved = [
        _mean(forms["before"]) - _mean(forms["now" if "now" in forms else "early"])
        for run in stored["runs"]
        for forms in run["starts"].values()
    ]
    alone = [
        _mean(forms["before"]) - _mean(forms["early"]) for run in stored["runs"] for forms in run["starts"].values()
    ]
    versions = [run["where"] | {"git_revision": of} for run in stored["runs"] for of in stored["commits"].values()]
    commits = ", ".join(f"{name} {commit({'git_revision': of})}" for name, of in stored["commits"].items())
    gained = f"""Later starts, the second and those after it, by turns, each a whole process of its own, on two hosts,
        one after the other (commits: {commits}). In brackets is the mean. By `now`, or where that was not tried by
        `early`, they take {min(saved):.1f} to {max(saved):.1f} s less than before on average; and with the GPU made
        ready alone {min(alone):.1f} to {max(alone):.1f} s less. *Traced* is when the first start had traced its
        program, once each, in the order of the rows. {stored["note"]}"""
    return [
        paragraph(_where_it_went(stored["timelines"])),
        paragraph(gained),
        table(("training", "host", "version", "first start: traced after", "later starts"), rows),
        paragraph(f"""Python's own end costs nothing that can be seen. The starts of `starts_h200_early_uncollected`
            were made on the second host, by `now` and before the trial, and are longer than the trial's: what a start
            takes varies by seconds from minute to minute. So the gain is that of the trial, and no aim is judged by it.
            {origin(versions)}"""),
    ]


def _garbage(results: Path) -> list[str]:
    """What the search for garbage costs before a training begins."""
    if not (results / GARBAGE).is_file():
        return []
    stored = read_json(results / GARBAGE)
    usual, kept = stored["forms"]["looked for"], stored["forms"]["not looked for"]

    def both(step: str) -> str:
        with_it, without = ([one[step] for one in of] for of in (usual, kept))
        ranges = (f"{fmean(of):.1f} ({min(of):.1f} to {max(of):.1f})" for of in (with_it, without))
        return " s with it and ".join(ranges) + " s without"

    most = (f"{max(one['mib'] for one in of):.0f} MiB" for of in (usual, kept))
    return [
        paragraph(f"""What the search for garbage costs was measured on a CPU, {len(usual)} times each, by turns, in
            processes of their own: seconds of the thread that loads modules and traces `{stored["training"]}` with
            {stored["seeds"]} seeds. Loading modules takes {both("modules")}, tracing {both("traced")}: what both make
            stays, and Python looks through all of it again and again. At most the process holds
            {" with it and ".join(most)} without. {stored["note"]} {origin([stored["where"]])}""")
    ]


def _where_it_went(lines: Mapping[str, Any]) -> str:
    """The seconds at which parts of a second start were done, and what the first array costs."""
    usual, asked = lines["usual"], lines["only asked for in a thread"]
    at = "; ".join(
        f"{name} after {_all(usual, step)}"
        for name, step in (
            ("modules were loaded", "modules"),
            ("the GPU was found", "gpu found"),
            ("the environment was built", "built"),
            ("the program was traced", "traced"),
            ("and it was compiled", "compiled"),
        )
    )
    first = lines["first_array"]
    return f"""Where a second start of `{lines["training"]}` goes was looked into again, on a host that had nothing else
        to do. Of two starts, {at}. Building the environment is nearly all the first array that is put on the GPU
        ({first["what"]} took {first["seconds"]:.1f} s), probably since JAX sets the GPU's memory aside then. Where a
        thread had only asked for the GPU while modules load, the environment was built after {_all(asked, "built")}. So
        a thread now [puts an array there too](../experiments/cli/early_gpu.py); an error of the GPU is raised where the
        run waits for it. {origin([lines["where"]])}"""


def _all(starts: list[Mapping[str, float]], step: str) -> str:
    return " and ".join(f"{one[step]:.1f} s" for one in starts)


def _each(starts: list[Mapping[str, float]]) -> str:
    seconds = [one["process"] for one in starts]
    return f"{', '.join(f'{one:.1f}' for one in seconds)} s ({fmean(seconds):.1f} s)"


def _traced(start: Mapping[str, float] | None) -> str:
    return "-" if start is None else f"{start['traced']:.1f} s"


def _mean(form: Mapping[str, Any]) -> float:
    return fmean(one["process"] for one in form["later"])
