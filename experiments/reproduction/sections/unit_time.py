"""The table of reward per unit time."""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from experiments.reproduction.cells import text
from experiments.reproduction.claims import differences
from experiments.reproduction.page import table
from experiments.reproduction.runs import ALONE_END
from experiments.reproduction.sections.timing_doubts import doubts
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
of one seed alone on its device, without the comparisons of parameters that a training makes on the way. Pre-training is
timed for one seed too, which may converge after fewer frames than the agents had whose rewards are counted: its time is
taken for as many as theirs. Intervals and outcomes tell of the seeds' rewards alone and not of how times vary. While
these were taken other timed runs compiled and trained on the other GPU of the host, and rewards and times are of
different commits. Outcomes are without compiling, which the published program has none of. Seconds of compiling are no
comparison of methods: they depend on what else was compiled before in the same process and beside it. Pre-training and
training compile side by side in use; here their seconds are added."""


def unit_time(runs: Mapping[str, Stored]) -> str:
    """Reward over the time of one seed alone on the device, its pre-training counted, and the published order."""
    rows, rates, compiled = [], {}, {}
    for name, run in runs.items():
        world, _, method = name.partition("-")
        cost = cost_alone(runs, world, method)
        if cost is None:
            continue
        rewards = reward_sum(run)
        rates[name] = per_minute(rewards, cost.seconds)
        compiled[name] = per_minute(rewards, cost.seconds + cost.compiling)
        printed = [value * UNITS[world] for value in PUBLISHED.get(world, {}).get(method, ())]
        rows.append(
            (
                name,
                text(rewards, 0),
                f"{cost.frames:,}",
                f"{cost.seconds:.0f} s",
                f"{cost.compiling:.0f} s",
                text(rates[name], 0),
                text(compiled[name], 0),
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
    return "\n\n".join([*parts, NOTE, *doubts(runs, {world: claims(world) for world in WORLDS}, rates)])


@dataclass(frozen=True)
class Cost:
    """What a method takes for one seed alone on the device, with its pre-training."""

    frames: int
    seconds: float
    compiling: float


def cost_alone(runs: Mapping[str, Stored], world: str, method: str) -> Cost | None:
    """Of the whole training and, if it starts from one, its pre-training, for as many frames as those had whose rewards
    are counted; None unless all of it is there and the timed run is the same training."""
    run, alone = (runs.get(f"{world}-{method}{ending}") for ending in ("", ALONE_END))
    if run is None or alone is None or not _same_training(run, alone):
        return None
    if method not in READERS:
        return Cost(run.frames, alone.train_seconds, alone.compile_seconds)
    first, timed = (runs.get(f"{world}-pretraining-{READERS[method]}{ending}") for ending in ("", ALONE_END))
    if first is None or timed is None:
        return None
    return Cost(
        run.frames + first.frames,
        alone.train_seconds + timed.train_seconds * first.frames / timed.frames,
        alone.compile_seconds + timed.compile_seconds,
    )


def _same_training(run: Stored, alone: Stored) -> bool:
    return alone.frames == run.frames and alone.config.learner == run.config.learner


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
