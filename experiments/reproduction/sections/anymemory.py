"""Agents with and without memory, where discs are seen from near only."""

from collections.abc import Mapping, Sequence

import numpy as np

from experiments.reproduction.anytask import met
from experiments.reproduction.anytask.runs import BROAD_FRAMES, MEMORY_RANGE, MEMORY_SEGMENT, MEMORY_STEPS
from experiments.reproduction.cells import COST, cost, share, text
from experiments.reproduction.claims import differences
from experiments.reproduction.page import table
from experiments.reproduction.sections.anytask import MODE, own_family, state_of
from experiments.reproduction.stored import Stored
from t2tl_jax.networks.context import ContextConfig
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
            text(run.by_seed("violation_rate")),
            text(run.by_seed("env_termination_rate")),
            text(run.by_seed("timeout_rate")),
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
    rose = "; ".join(f"{name} {np.mean(then):.3f} to {np.mean(last):.3f}" for name, (then, last) in rises.items())
    rising = [name for name, (then, last) in rises.items() if np.mean(last) > np.mean(then)]
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
        f"{longest / 1e6:.0f}. Success in training, of {parts[0]} % and of {parts[1]} % of the frames: {rose}. {told}"
        f"{known}"
    )


def _success(run: Stored, part: tuple[float, float]) -> np.ndarray:
    """Success in a part of the training, by seed."""
    iterations = np.unique(run.columns["iteration"]) / run.columns["iteration"].max()
    among = (iterations > part[0]) & (iterations <= part[1])
    return np.nanmean(run.metrics["success_rate"][:, among], axis=1)
