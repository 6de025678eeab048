"""What the README says of one agent for any task in the open ZoneEnv, and of other codes."""

from collections.abc import Mapping

import numpy as np

from experiments.paper import published_any as published
from experiments.reproduction.anytask import suites
from experiments.reproduction.anytask.runs import STRICT
from experiments.reproduction.sections.anytask import SAMPLED, ZONES, figures, over_tasks
from experiments.reproduction.stored import Stored

PLAYED = {
    "broad-lookahead": "look-ahead",
    "broad-automaton": "automaton",
    "broad-gru": "GRU",
    "broad-rgcn": "R-GCN",
    "broad-transformer": "Transformer",
}
"""Codes that the README tells of, read by one layer; what is learned of them was learned by playing."""

SOLVED = {"solved-gru": "GRU", "solved-transformer": "Transformer"}
"""Those that learned by dynamic programming."""


def in_short(runs: Mapping[str, Stored]) -> str:
    """What the README says of one agent for any task in the open ZoneEnv: z1 to z6 beside others, what it is weakest
    at, and what it cost."""
    if "any-zones" not in runs:
        return "Not measured yet."
    run = runs["any-zones"]
    of = figures(run)
    rates = {task: float(np.nanmean(of[task][SAMPLED]["success_rate"])) for task in suites.ZONES.tasks}
    rest = suites.ZONE_HARD
    weakest = min(rest, key=rates.__getitem__)

    def ours(figure: str, digits: int = 3) -> str:
        return over_tasks(of, suites.ZONE_Z, SAMPLED, figure).text(digits)

    def theirs(method: str) -> str:
        found = published.mean_of([ZONES[method][task] for task in suites.ZONE_Z])
        assert found is not None
        return f"{found.success:.3f} in {found.steps:.4g}"

    genz = ZONES["GenZ-LTL"][weakest].success
    hardware = ", ".join(sorted({name.replace("NVIDIA ", "") for name in run.versions["devices"]}))
    alone = "alone" if run.status.get("alone") else "host shared"
    parts = (
        "*An agent of the open ZoneEnv, codes read off the table.",
        "Settings: chosen on other formulas, knowing these results.",
        f"Success, z1 to z6: {ours('success_rate')} in {ours('success_length', 0)} steps",
        f"(DeepLTL's files: {theirs('DeepLTL')}; GenZ-LTL's, played by us: {theirs('GenZ-LTL')});",
        f"{weakest}, weakest of {len(rest)} others: {rates[weakest]:.3f} (GenZ-LTL {genz:.3f});",
        f"twelve discs in turn: {rates['reach_12']:.2f}.",
        *_strictly(runs),
        f"{len(run.seeds)} seeds, {run.frames / 1e6:.0f} M frames: {run.train_seconds:.0f} s,",
        f"{run.compile_seconds:.0f} s to compile, one {hardware}, {alone}.",
        f"Lidars gated by codes, z1 to z6 / those {len(rest)}, %: {_of_codes(runs, PLAYED)};",
        f"by dynamic programming, other seeds: {_of_codes(runs, SOLVED)} {_budgets(runs)}.*",
    )
    return " ".join(parts)


def _strictly(runs: Mapping[str, Stored]) -> list[str]:
    """The same of agents whose training met no row of these formulas."""
    run = runs.get(f"any-zones{STRICT}")
    if run is None:
        return []
    means = [over_tasks(figures(run), tasks, SAMPLED, "success_rate") for tasks in (suites.ZONE_Z, suites.ZONE_HARD)]
    z, hard = (f"{mean.value:.3f}" for mean in means)
    return [f"With no row of these met, by any names: {z}, {hard}."]


def _of_codes(runs: Mapping[str, Stored], codes: Mapping[str, str]) -> str:
    """What other codes came to on the same formulas, by what they are called: on z1 to z6, and on harder ones."""
    said = []
    for code, label in codes.items():
        run = runs.get(f"any-zones-{code}")
        if run is None:
            continue
        of = figures(run)
        means = [over_tasks(of, tasks, SAMPLED, "success_rate").value for tasks in (suites.ZONE_Z, suites.ZONE_HARD)]
        said.append(f"{label} {'/'.join('-' if mean is None else f'{100 * mean:.1f}' for mean in means)}")
    return ", ".join(said) or "nothing measured yet"


def _budgets(runs: Mapping[str, Stored]) -> str:
    """Seeds and frames of the agents with these codes."""
    there = [runs[name] for code in (PLAYED | SOLVED) if (name := f"any-zones-{code}") in runs]
    found = dict.fromkeys(f"{len(run.seeds)} seeds, {run.frames / 1e6:.0f} M frames" for run in there)
    return f"({' or '.join(found)})" if found else ""
