"""Agents with and without memory, where discs are seen from near only."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from experiments.reproduction.anytask import met
from experiments.reproduction.anytask.runs import BROAD_FRAMES, MEMORY_RANGE, MEMORY_SEGMENT, MEMORY_STEPS
from experiments.reproduction.cells import COST, cost, share, text
from experiments.reproduction.claims import differences
from experiments.reproduction.page import table
from experiments.reproduction.sections.anyfigures import MODE, own_family, state_of
from experiments.reproduction.stored import Stored
from t2tl_jax.networks.context_config import ContextConfig
from t2tl_jax.registry import named_config

CARRIED = "any-memory-carried"
"""The run whose policy carries its state."""

METRES_A_STEP = 0.03
"""What the robot goes in one at most, once it is that fast."""

BEFORE = (0.75, 0.8), (0.95, 1.0)
"""Two parts of a training, by which it is told whether success still rose."""


def memory(names: Sequence[str], runs: Mapping[str, Stored]) -> str:
    """With and without memory where discs are seen from near only, seed by seed on the same maps."""
    rows = [
        (
            name.removeprefix("any-memory-"),
            state_of(run),
            share(own_family(run)),
            share(own_family(run, MODE)),
            share(run.by_seed("violation_rate")),
            share(run.by_seed("env_termination_rate")),
            share(run.by_seed("timeout_rate")),
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
    heading = (
        *("policy", "state", "success", "success of the mode", "violation", "ended by env", "time-out"),
        *("steps", "return", "parameters", *COST),
    )
    apart = (
        "A policy that was trained with another state than the others is not compared with them: its line tells of "
        "that state, not of its memory."
    )
    parts = (
        table(heading, rows),
        _what_they_are(runs),
        apart if len(set(states)) > 1 else "",
        differences(alike, pairs, success, "success on its own family, other maps"),
        differences(alike, pairs, mode, "success of the mode"),
        differences(alike, pairs, returns, "discounted return"),
    )
    return "\n\n".join(part for part in parts if part)


def _what_they_are(runs: Mapping[str, Stored]) -> str:
    """What these policies remember, and how far they were trained."""
    if not runs:
        return ""
    frames = max(run.frames for run in runs.values())
    longest = named_config("zones_any").frames
    parts = ["-".join(f"{100 * share:.0f}" for share in part) for part in BEFORE]
    rises = {name.removeprefix("any-memory-"): [_success(run, part) for part in BEFORE] for name, run in runs.items()}
    means = {name: (np.mean(then), np.mean(last)) for name, (then, last) in rises.items()}
    rose = ", ".join(f"from {then:.3f} to {last:.3f} ({name})" for name, (then, last) in means.items())
    rising = [name for name, (then, last) in means.items() if last > then]
    told = (
        "It rose until the end, so that none of these trainings had settled: more frames may change what is compared."
        if len(rising) == len(rises)
        else f"It still rose of {', '.join(rising) or 'none'}."
    )
    shares = next((met.read(run.path) for run in runs.values()), {})
    own = shares.get("own")
    carried = (
        f"carried has as many parameters as gru and goes on with its state through the whole episode, one for each "
        f"colour, and learns over {MEMORY_SEGMENT} steps from the state that it had at the first of them, where t2tl "
        f"and gru learn from pieces of {ContextConfig().segment_length}"
        if CARRIED in runs
        else "it is no policy whose state is carried through the episode, and of such a one nothing was measured"
    )
    known = (
        f" Of the {own['formulas']} formulas of the family that they are tested on, training met {own['renamed']} as a "
        f"whole under other names, and of {own['without a row met']} no row; of their open rows it met "
        f"{shares['renamed'][met.OWN]} up to names, {shares['exactly'][met.OWN]} under their own."
        if own
        else ""
    )
    return (
        f"The window of t2tl and of gru holds the last {MEMORY_STEPS} steps, in which the robot goes "
        f"{MEMORY_STEPS * METRES_A_STEP:.1f} m at most, where the lidar reaches {MEMORY_RANGE} m: it "
        f"holds little that is out of the lidar's reach. No longer window was tried. "
        f"gru reads the same window, anew at every step: {carried}. "
        f"All had {frames / 1e6:.0f} million frames, agents of the broad family {BROAD_FRAMES / 1e6:.0f} and any-zones "
        f"{longest / 1e6:.0f}. Between {parts[0]} % and {parts[1]} % of the frames mean success in training went "
        f"{rose}. {told}{known} {_how_chosen(runs)}{_pulled(runs)}"
    )


def _how_chosen(runs: Mapping[str, Stored]) -> str:
    """That nothing was tuned for any of these policies, and on what they ran."""
    learners: list[Any] = [run.config.learner for run in runs.values()]
    rates = {learner.learning_rate for learner in learners if not learner.anneal_learning_rate}
    one_rate = len(rates) == 1 and not any(learner.anneal_learning_rate for learner in learners)
    step = f", with one constant step size ({rates.pop():g})" if one_rate else ""
    kinds = sorted({kind for run in runs.values() for kind in run.versions.get("devices", [])})
    return (
        "Nothing was tuned for any of these policies: they have the settings of the agents of the narrower family"
        f"{step}, and no trial of step sizes, of layers or of segments is recorded. What was changed after results had "
        "been seen is the same for all: lidars are merged, after runs that read them as they are, and frames were "
        f"raised from 8 million, since success still rose. All ran on {', '.join(kinds)}."
    )


OUTLYING = 3.0
"""A seed that lies so many standard deviations of the others below their mean pulls the mean down."""


def _pulled(runs: Mapping[str, Stored]) -> str:
    """Which means are pulled down by a single seed; '' where none is."""
    said = []
    for name, run in runs.items():
        rates = own_family(run)
        if len(rates) < FEWEST_SEEDS:
            continue
        lowest = min(rates, key=rates.__getitem__)
        rest = [rate for seed, rate in rates.items() if seed != lowest]
        if rates[lowest] < np.mean(rest) - OUTLYING * np.std(rest, ddof=1):
            said.append(
                f"{name.removeprefix('any-memory-')} seed {lowest} ({rates[lowest]:.3f}, in training "
                f"{run.end('success_rate')[lowest]:.3f}; mean of the others {np.mean(rest):.3f})"
            )
    return f" One seed pulls the mean down of: {'; '.join(said)}." if said else ""


FEWEST_SEEDS = 4
"""Of fewer nothing is said to be an outlier."""


def _success(run: Stored, part: tuple[float, float]) -> np.ndarray:
    """Success in a part of the training, by seed; NaN of a seed of which no episode ended in it."""
    iterations = np.unique(run.columns["iteration"]) / run.columns["iteration"].max()
    among = (iterations > part[0]) & (iterations <= part[1])
    return np.ma.masked_invalid(run.metrics["success_rate"][:, among]).mean(axis=1).filled(np.nan)
