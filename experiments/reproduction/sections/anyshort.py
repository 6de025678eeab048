"""What the README says of one agent for any task in the open ZoneEnv, and of other codes."""

from collections.abc import Mapping

import numpy as np

from experiments.paper import published_any as published
from experiments.reproduction.anytask import suites
from experiments.reproduction.anytask.runs import STRICT
from experiments.reproduction.anytask.tested import name_elsewhere
from experiments.reproduction.sections.anyfigures import SAMPLED, figures, over_tasks
from experiments.reproduction.sections.anytask import ZONES
from experiments.reproduction.stored import Stored

CODES = {
    "broad-lookahead": "read off the table",
    "broad-transformer": "by a Transformer over the text, learned by playing",
    "solved-transformer": "by dynamic programming, other seeds",
}
"""Codes that the README tells of, all of which one layer reads; the page of figures has more."""


def in_short(runs: Mapping[str, Stored]) -> str:
    """What the README says of one agent for any task in the open ZoneEnv: z1 to z6 beside others, what it is weakest
    at, and what it cost."""
    if "any-zones" not in runs:
        return "Not measured yet."
    run = runs["any-zones"]
    of = figures(run)
    rates = {task: of[task][SAMPLED]["success_rate"] for task in of}
    means = {task: float(np.nanmean(rate)) for task, rate in rates.items()}
    hard = suites.ZONE_HARD
    weakest = min(hard, key=means.__getitem__)
    elsewhere = [name_elsewhere(task, suite) for suite in suites.MORE_COLOURS for task in suite.tasks]
    coloured = [means[name] for name in elsewhere if name in of]

    def ours(figure: str, digits: int = 3) -> str:
        return over_tasks(of, suites.ZONE_Z, SAMPLED, figure).text(digits)

    def theirs(method: str) -> str:
        found = published.mean_of([ZONES[method][task] for task in suites.ZONE_Z])
        assert found is not None
        return f"{found.success:.3f} in {found.steps:.4g}"

    hardware = ", ".join(sorted({name.replace("NVIDIA ", "") for name in run.versions["devices"]}))
    alone = "alone" if run.status.get("alone") else "host shared"
    parts = (
        "*An agent of the open ZoneEnv; settings were chosen on other formulas, knowing these results.",
        f"Success on z1 to z6: {ours('success_rate')} (Wilson's) in {ours('success_length', 0)} steps",
        f"(DeepLTL: {theirs('DeepLTL')}; GenZ-LTL [nearer](docs/zeroshot.md));",
        f"weakest of {len(hard)} harder: {weakest}, {means[weakest]:.3f}, worst seed",
        f"{float(np.nanmin(rates[weakest])):.3f};",
        *([f"six colours, maps of six to ten: {min(coloured):.2f} to {max(coloured):.2f};"] if coloured else []),
        f"twelve in turn: {means['reach_12']:.2f}.",
        *_strictly(runs),
        f"{len(run.seeds)} seeds, {run.frames / 1e6:.0f} M frames: {run.train_seconds:.0f} s +",
        f"{run.compile_seconds:.0f} s of compiling, one {hardware}, {alone}.",
        f"Codes through one layer, on both: {_of_codes(runs)}.*",
    )
    return " ".join(parts)


def _strictly(runs: Mapping[str, Stored]) -> list[str]:
    """The same of agents whose training met no row of these formulas."""
    run = runs.get(f"any-zones{STRICT}")
    if run is None:
        return []
    means = [over_tasks(figures(run), tasks, SAMPLED, "success_rate") for tasks in (suites.ZONE_Z, suites.ZONE_HARD)]
    z, hard = (f"{mean.value:.3f}" for mean in means)
    return [f"Without a row of these in training, under any names: {z} and {hard}."]


def _of_codes(runs: Mapping[str, Stored]) -> str:
    """What other codes came to on the same formulas, by what they are called: on z1 to z6, and on harder ones."""
    said = []
    for code, label in CODES.items():
        run = runs.get(f"any-zones-{code}")
        if run is None:
            continue
        of = figures(run)
        means = [over_tasks(of, tasks, SAMPLED, "success_rate").value for tasks in (suites.ZONE_Z, suites.ZONE_HARD)]
        said.append(f"{label} {' and '.join('-' if mean is None else f'{mean:.3f}' for mean in means)}")
    return "; ".join(said) or "nothing measured yet"
