"""The running example, whose formula can be violated."""

from collections.abc import Mapping

import numpy as np

from experiments.reproduction import runs as named
from experiments.reproduction.cells import COST, cost, share, solved, text
from experiments.reproduction.claims import differences
from experiments.reproduction.page import table
from experiments.reproduction.sections.ablation import commits
from experiments.reproduction.sections.settings import what_differs
from experiments.reproduction.stored import Stored
from t2tl_jax.evaluation.comparisons import Pairs

FIRST = "safe-t1tl"
"""What the others are compared with."""

PAIRS = [(FIRST, f"safe-{method}") for method in named.ZONE_METHODS if f"safe-{method}" != FIRST]

LABELS = {f"safe-{method}": method for method in named.ZONE_METHODS}

NOTE = "Nothing of it is published, so nothing is claimed."


def safe(runs: Mapping[str, Stored]) -> str:
    """Success and violations of every method, in training and of the final parameters."""
    rows = [
        (
            name.removeprefix("safe-"),
            solved(run),
            share(run.by_seed("success_rate")),
            share(violations(run)),
            share(run.end("violation_rate")),
            share(run.by_seed("violation_rate")),
            text(run.by_seed("discounted_return")),
            *cost(run),
        )
        for name, run in runs.items()
    ]
    heading = (
        "method",
        "solved",
        "success, final",
        "violations, all of training",
        "violations, end of training",
        "violations, final",
        "return, final",
        *COST,
    )
    parts = (
        table(heading, rows),
        what_differs(runs, LABELS, "safe"),
        safe_order(runs, PAIRS),
        NOTE if rows else "",
        commits(runs),
    )
    return "\n\n".join(part for part in parts if part)


def safe_order(runs: Mapping[str, Stored], pairs: Pairs, claims: Pairs = ()) -> str:
    """Differences between runs by the success and the violations of their final parameters."""
    rates = {"success": "success_rate", "violations": "violation_rate"}
    values = {what: {name: run.by_seed(rate) for name, run in runs.items()} for what, rate in rates.items()}
    parts = [differences(runs, pairs, of, f"{what} of the final parameters", claims) for what, of in values.items()]
    return "\n\n".join(part for part in parts if part)


def violations(run: Stored) -> dict[int, float]:
    """Share of all episodes of a training that violated the task, by seed."""
    episodes = np.nan_to_num(run.metrics["episodes"])
    violated = (episodes * np.nan_to_num(run.metrics["violation_rate"])).sum(axis=1)
    ended = episodes.sum(axis=1)
    rates = np.where(ended > 0, violated / np.maximum(ended, 1), np.nan)
    return dict(zip(run.seeds, rates.tolist(), strict=True))
