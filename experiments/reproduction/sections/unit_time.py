"""The table of reward per unit time."""

import itertools
from collections.abc import Mapping

import numpy as np

from experiments.reproduction.cells import text
from experiments.reproduction.claims import differences
from experiments.reproduction.page import table
from experiments.reproduction.stored import Stored
from t2tl_jax.evaluation.comparisons import Pairs

PUBLISHED: dict[str, dict[str, tuple[float, float]]] = {
    "zone": {
        "t2tl": (12.21, 7.16),
        "t1tl": (11.09, 7.46),
        "gnn": (9.60, 5.85),
        "dfa_number": (6.61, 5.63),
        "dfa_cont": (3.12, 2.80),
    },
    "water": {
        "t1tl": (2.60, 0.05),
        "rm-6": (2.20, 0.20),
        "dfa": (2.02, 0.52),
        "t2tl": (1.96, 0.08),
        "gnn": (1.95, 0.03),
    },
}
"""Reward per unit time as printed, mean and spread, the best first: 0.01 per minute in ZoneEnv, per minute in
WaterWorld."""

UNITS = {"zone": 0.01, "water": 1.0}
"""Of the values above."""

WORLDS = {"zone": "ZoneEnv", "water": "WaterWorld"}

READERS = {"t2tl": "transformer", "t1tl": "transformer", "gnn": "gnn"}
"""Which pre-training a method starts from."""

NOTE = """The published unit is not known (the paper's R_i cannot be what its curves show), so only orders compare: that
of the printed values, every two of a world, though most of their printed spreads overlap. The published RM of
WaterWorld reads 6 numbers (rm-6); rm has 16, which is ours. The time of a method is one number, of one whole training
and pre-training of one seed alone on the device, so intervals and outcomes tell of the seeds' rewards alone and
not of how that time would vary. The comparisons of parameters that a training makes on the way are left out of it.
Outcomes are without compiling, which the published program has none of. Pre-training and training compile side by side
in use; here their seconds are added."""


def unit_time(runs: Mapping[str, Stored]) -> str:
    """Reward over the time of one seed alone on the device, its pre-training counted, and the published order."""
    rows, rates = [], {}
    for name, run in runs.items():
        world, _, method = name.partition("-")
        alone = alone_with_pretraining(runs, world, method)
        if not alone or alone[0].frames != run.frames:
            continue
        seconds = sum(one.train_seconds for one in alone)
        compiling = sum(one.compile_seconds for one in alone)
        rewards = reward_sum(run)
        rates[name] = per_minute(rewards, seconds)
        printed = [value * UNITS[world] for value in PUBLISHED.get(world, {}).get(method, ())]
        rows.append(
            (
                name,
                text(rewards, 0),
                f"{sum(one.frames for one in alone):,}",
                f"{seconds:.0f} s",
                f"{compiling:.0f} s",
                text(rates[name], 0),
                text(per_minute(rewards, seconds + compiling), 0),
                " ± ".join(f"{value:.4g}" for value in printed) or "-",
            )
        )
    if not rows:
        return ""
    heading = (
        "run",
        "sum of rewards",
        "frames, with pre-training",
        "time of one seed alone",
        "compile",
        "per minute",
        "per minute, with compiling",
        "published",
    )
    parts = [table(heading, rows)]
    for world, title in WORLDS.items():
        pairs = claims(world)
        if compared := differences(runs, pairs, rates, "reward per minute", pairs):
            parts += [f"**{title}**", compared]
    return "\n\n".join([*parts, NOTE])


def claims(world: str) -> Pairs:
    """The order of a world's printed values, every two."""
    return list(itertools.combinations((f"{world}-{method}" for method in PUBLISHED[world]), 2))


def reward_sum(run: Stored) -> dict[int, float]:
    """Sum of the undiscounted rewards of all episodes of a training, by seed: formulas pay +1 and -1 at the end."""
    counts = np.nan_to_num(run.metrics["episodes"])
    rates = np.nan_to_num(run.metrics["success_rate"]) - np.nan_to_num(run.metrics["violation_rate"])
    return dict(zip(run.seeds, (counts * rates).sum(axis=1).tolist(), strict=True))


def per_minute(rewards: Mapping[int, float], seconds: float) -> dict[int, float]:
    """Each seed's reward over the same time."""
    return {seed: 60 * reward / seconds for seed, reward in rewards.items()}


def alone_with_pretraining(runs: Mapping[str, Stored], world: str, method: str) -> list[Stored]:
    """The timed run of one seed alone and, if it starts from one, its pre-training; empty unless all of it is there."""
    names = [f"{world}-{method}-alone"]
    if method in READERS:
        names.append(f"{world}-pretraining-{READERS[method]}-alone")
    return [runs[name] for name in names] if all(name in runs for name in names) else []
