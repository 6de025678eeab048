"""Agents with and without memory, where discs are seen from near only."""

from collections.abc import Mapping, Sequence

from experiments.reproduction.cells import COST, cost, share, text
from experiments.reproduction.claims import differences
from experiments.reproduction.page import table
from experiments.reproduction.sections.anytask import MODE, own_family, state_of
from experiments.reproduction.stored import Stored


def memory(names: Sequence[str], runs: Mapping[str, Stored]) -> str:
    """With and without memory where discs are seen from near only, seed by seed on the same maps."""
    rows = [
        (
            name.removeprefix("any-memory-"),
            state_of(run),
            share(own_family(run)),
            share(own_family(run, MODE)),
            text(run.by_seed("success_length"), 0),
            text(run.by_seed("discounted_return")),
            "-" if run.sizes is None else f"{run.sizes.others:,}",
            *cost(run),
        )
        for name, run in runs.items()
    ]
    pairs = [(first, second) for k, first in enumerate(names) for second in names[k + 1 :]]
    # Of policies that read different states none is compared, but the planned comparisons are corrected for all.
    states = [state_of(run) for run in runs.values()]
    alike = {name: run for name, run in runs.items() if states.count(state_of(run)) > 1}
    success = {name: own_family(run) for name, run in alike.items()}
    mode = {name: own_family(run, MODE) for name, run in alike.items()}
    returns = {name: run.by_seed("discounted_return") for name, run in alike.items()}
    heading = ("policy", "state", "success", "success of the mode", "steps", "return", "parameters", *COST)
    apart = (
        "A policy that was trained with another state than the others is not compared with them: its line tells of "
        "that state, not of its memory."
    )
    parts = (
        table(heading, rows),
        apart if len(set(states)) > 1 else "",
        differences(alike, pairs, success, "success on unseen formulas and maps"),
        differences(alike, pairs, mode, "success of the mode"),
        differences(alike, pairs, returns, "discounted return"),
    )
    return "\n\n".join(part for part in parts if part)
