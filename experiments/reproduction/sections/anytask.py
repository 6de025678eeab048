"""Agents for any task: what they do on formulas that they were not trained on, beside what others report."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from envs.waterworld import WaterWorldConfig
from experiments.paper import published_any as published
from experiments.paper.published_any import ZONES, Published
from experiments.reproduction.anytask import met, suites, tested
from experiments.reproduction.cells import COST, cost
from experiments.reproduction.page import table
from experiments.reproduction.sections.anyaims import AIMS_HEADING, Bar, aims_of_run
from experiments.reproduction.sections.anyfigures import (
    MODE,
    OWN,
    SAMPLED,
    by_spread,
    by_tasks,
    figures,
    interval,
    over_seeds,
    over_tasks,
)
from experiments.reproduction.stored import Stored
from t2tl_jax.evaluation.statistics import Estimate
from t2tl_jax.networks.lookahead import LookaheadConfig

Others = Mapping[str, Mapping[str, Published]]


HEADING = (
    *("task", "rows met", "renamed", "success", "Student's t", "worst seed", "violation", "ended by env", "time-out"),
    *("steps", "return", "success of the mode", "worst seed of the mode", "steps of the mode"),
)


def tasks_of_run(
    name: str,
    others: Others | None = None,
    bars: Sequence[Bar] = (),
    means: Mapping[str, tuple[str, ...]] | None = None,
    seconds: float | None = None,
) -> Callable[[Mapping[str, Stored]], str]:
    """The section of one run: a line for each task, beside those of others, and what becomes of what is asked.

    Args:
        name: of the run.
        others: figures of others by method and task.
        bars: what is asked.
        means: lines over several tasks, by what they are called.
        seconds: that training of all seeds and compiling may take; None where nothing is asked.
    """
    return partial(_tasks_of_run, name, others or {}, bars, means or {}, seconds)


def _tasks_of_run(
    name: str,
    others: Others,
    bars: Sequence[Bar],
    means: Mapping[str, tuple[str, ...]],
    seconds: float | None,
    runs: Mapping[str, Stored],
) -> str:
    if name not in runs:
        return ""
    run = runs[name]
    of, shares = figures(run), met.read(run.path)
    rows = [(task, *met.cells(shares, task), *_cells(by), *_beside(others, task)) for task, by in of.items()]
    for called, tasks in means.items():
        if set(tasks) <= of.keys():
            met_of = [_met_of_all(shares[kind], tasks) for kind in ("exactly", "renamed")]
            rows.append((f"**{called}**", *met_of, *_mean_cells(of, tasks), *_means_beside(others, called, tasks)))
    facts = table(("frames, seeds", *COST[1:]), [(f"{run.frames:,} x {len(run.seeds)}", *cost(run)[1:])])
    parts = (
        table((*HEADING, *(_heading_of(method, cells) for method, cells in others.items())), rows),
        NO_GOALS if _tells_no_goals(run) else "",
        _rows_note(shares),
        near_the_limit(of, run.config.episode_length),
        table(AIMS_HEADING, aims_of_run(name, bars, seconds)(runs)),
        "" if seconds is None else TIMES_OF_OTHERS,
        facts,
    )
    return "\n\n".join(part for part in parts if part)


NO_GOALS = (
    "**The code of this agent names no goal of a chain but the last.** Balls can overlap, so that every row of a chain "
    "is one letter from true, and no ball by itself brings it nearer: it avoids what fails, and meets all goals but "
    "the last by roaming, within the time limit. Its success is no evidence that it reads chains. Since then "
    "`one_at_a_time` tells of every goal; an agent with that is to be trained."
)


def _tells_no_goals(run: Stored) -> bool:
    """Whether the look-ahead of a run in WaterWorld counts letters of several balls."""
    learner: Any = run.config.learner
    encoder = learner.network.task_encoder
    return (
        isinstance(run.config.env, WaterWorldConfig)
        and isinstance(encoder, LookaheadConfig)
        and not (encoder.one_at_a_time or encoder.letters)
    )


def _met_of_all(shares: Mapping[str, Any], tasks: Sequence[str]) -> str:
    """The shares of some tasks added up; a row that several of them have counts for each."""
    if not set(tasks) <= shares.keys():
        return "-"
    each = [map(int, shares[task].split("/")) for task in tasks]
    return "/".join(str(sum(numbers)) for numbers in zip(*each, strict=True))


def _rows_note(shares: Mapping[str, Mapping[str, Any]]) -> str:
    rows, own = shares["rows"], shares.get("own", {})
    if not rows:
        return ""
    said = (
        f"Training met {rows['exactly']:,} open rows, {rows['renamed']:,} up to renaming of propositions, in all its "
        "pools."
    )
    if own:
        said += (
            f" Of its own family it is tested on {own['formulas']} formulas, of which "
            f"{own['exactly'] or 'none'} was met as a whole under its own names. Up to renaming {own['renamed']} were "
            f"met as a whole, {own['formulas'] - own['renamed'] - own['without a row met']} in part, and "
            f"{own['without a row met']} not at all: only these last are unseen in the strict sense, and success on "
            "its own family is not success on unseen formulas."
        )
    return said


def near_the_limit(of: Mapping[str, Any], limit: int) -> str:
    """Of which tasks the episodes that succeed take nearly all of the time that there is, so that it is the limit that
    others fail by; '' where there is none."""
    said = []
    for task, by in of.items():
        steps = float(np.mean(known)) if (known := _known(by[SAMPLED]["success_length"])).size else 0.0
        if not NEARLY_ALL * limit < steps <= limit:  # some are played under a longer limit
            continue
        late = float(np.nanmean(by[SAMPLED]["timeout_rate"]))
        told = (
            f"{task}: the episodes that succeed take {steps:.0f} steps of the limit of {limit:,}, and {late:.3f} of "
            "all run out of time, so that the limit decides here; longer episodes were not played."
        )
        if task in suites.ZONE_DEEP and set(suites.ZONE_DEEP) <= of.keys():
            rest = [deep for deep in suites.ZONE_DEEP if deep != task]
            mean_of, without = (over_tasks(of, tasks, SAMPLED, "success_rate") for tasks in (suites.ZONE_DEEP, rest))
            told += (
                f" It lowers the level *deeper* of the tables of codes as well: {mean_of.value:.3f} here, "
                f"{without.value:.3f} without it."
            )
        said.append(told)
    return " ".join(said)


NEARLY_ALL = 0.9
"""Of the time limit."""


def _known(values: np.ndarray) -> np.ndarray:
    return values[np.isfinite(values)]


def _cells(by: Mapping[str, Mapping[str, np.ndarray]]) -> list[str]:
    sampled, mode = by[SAMPLED], by[MODE]
    return [
        over_seeds(sampled["success_rate"], "success_rate").text(),
        interval(by_spread(sampled["success_rate"], "success_rate")),
        f"{np.nanmin(sampled['success_rate']):.3f}",
        *(f"{np.nanmean(sampled[name]):.3f}" for name in ("violation_rate", "env_termination_rate", "timeout_rate")),
        over_seeds(sampled["success_length"], "success_length").text(0),
        over_seeds(sampled["discounted_return"], "discounted_return").text(),
        over_seeds(mode["success_rate"], "success_rate").text(),
        f"{np.nanmin(mode['success_rate']):.3f}",
        over_seeds(mode["success_length"], "success_length").text(0),
    ]


def _mean_cells(of: Mapping[str, Any], tasks: Sequence[str]) -> list[str]:
    def of_all(figure: str, policy: str = SAMPLED) -> Estimate:
        return over_tasks(of, tasks, policy, figure)

    def worst(policy: str) -> str:
        return f"{min(float(np.nanmin(of[task][policy]['success_rate'])) for task in tasks):.3f}"

    return [
        of_all("success_rate").text(),
        interval(by_tasks(of, tasks, SAMPLED, "success_rate")),
        worst(SAMPLED),
        *(f"{of_all(name).value:.3f}" for name in ("violation_rate", "env_termination_rate", "timeout_rate")),
        of_all("success_length").text(0),
        of_all("discounted_return").text(),
        of_all("success_rate", MODE).text(),
        worst(MODE),
        of_all("success_length", MODE).text(0),
    ]


def _beside(others: Others, task: str) -> list[str]:
    return [of[task].text() if task in of else "-" for of in others.values()]


def _means_beside(others: Others, called: str, tasks: Sequence[str]) -> list[str]:
    """Means of others over some tasks, or what they report of these as a whole; '-' where a task is not known."""
    found = []
    for of in others.values():
        mean_of = published.mean_of([of[task] for task in tasks]) if set(tasks) <= of.keys() else None
        parts = [one.text() for one in (mean_of, of.get(called)) if one is not None]
        found.append(", ".join(parts) or "-")
    return found


def _heading_of(method: str, cells: Mapping[str, Published]) -> str:
    if method == FEWEST:
        return method
    known = ", ".join(
        name for name in ("success", "steps") if any(getattr(cell, name) is not None for cell in cells.values())
    )
    whose = (
        f"{method} (not published: played by this project, not stored)" if method in published.NOT_STORED else method
    )
    return f"{whose}: {known or 'return'}"


FEWEST = "fewest steps that the maps allow (a bound, computed)"
MOST_SECONDS = 300.0
TIMES_OF_OTHERS = (
    "The seconds are those of one GPU. Nobody reports the same world on the same machine: Jaxolotl's paper, of which a "
    "summary was at hand, has for ten seeds in a kinematic ZoneEnv on one RTX 5070 Ti "
    + ", ".join(
        f"{method}'s method in {ours:g} minutes ({theirs / 60:g} hours by the original program)"
        for method, (theirs, ours) in published.JAXOLOTL_MINUTES.items()
    )
    + "; DeepLTL's own and GCRL-LTL's times are not published."
)

MAPS_50, UNTIL_36 = tested.name_of_maps(50), tested.name_of_all("Until_1_2_1_1", 36)

OPEN_ZONES: Others = {
    method: {
        **cells,
        **{
            called: Published(None, None, value) for called, value in published.ZONES_DISCOUNTED.get(method, {}).items()
        },
        **({MAPS_50: published.ZONES_ON_MAPS[method]} if method in published.ZONES_ON_MAPS else {}),
    }
    for method, cells in ZONES.items()
} | {FEWEST: {task: Published(None, steps) for task, steps in published.STEP_BOUND.items()}}
"""What others report of the open ZoneEnv, and what nobody can do better than."""

WALLED: Others = {
    "LTL2Action, pre-trained, 30 seeds in MuJoCo (read off a figure)": {
        UNTIL_36: Published(None, None, published.LTL2ACTION_RETURN)
    }
}

WORST_OF = "success, mean over seeds of the worst of"

ZONE_BARS = (
    Bar("success, mean of z1 to z6", suites.ZONE_Z, least=0.99),
    Bar("success, worst seed and formula of z1 to z6", suites.ZONE_Z, least=0.97, over="worst"),
    Bar("steps, mean of z1 to z6", suites.ZONE_Z, most=200, figure="success_length"),
    Bar("return, mean of z1 to z6", suites.ZONE_Z, least=0.68, figure="discounted_return"),
    Bar(f"{WORST_OF} g1 to g4, long, j8, j10, s7, s8", suites.ZONE_HARD, least=0.97, over="task"),
    Bar("success on 50 tasks with their maps", (MAPS_50,), least=1.0, policy=MODE),
    Bar("success on 50 tasks with their maps", (MAPS_50,), least=1.0),
    Bar("return on 50 tasks with their maps", (MAPS_50,), least=0.66, figure="discounted_return", policy=MODE),
)
WALL_BARS = (
    Bar("success on `Until_1_2_1_1`", (UNTIL_36,), least=0.98),
    Bar("return on `Until_1_2_1_1`", (UNTIL_36,), least=0.72, figure="discounted_return"),
    Bar("return on `Until_1_2_1_1`", (UNTIL_36,), least=0.72, figure="discounted_return", policy=MODE),
    Bar("success on `phi_zone`", ("phi_zone",), least=0.98),
)
LETTER_BARS = (
    Bar(f"{WORST_OF} letters_1 to letters_5", suites.LETTERS.tasks[:5], least=0.99, over="task"),
    Bar("success on letters_reach_12", ("letters_reach_12",), least=0.99),
    Bar("success on letters_avoid_6", ("letters_avoid_6",), least=0.99),
)
FLAT_BARS = (Bar(f"{WORST_OF} flat_1 to flat_5", suites.FLAT.tasks, least=0.99, over="task"),)
WATER_BARS = (
    Bar("success on `phi_water`", ("phi_water",), least=0.99),
    Bar("steps on `phi_water`", ("phi_water",), most=76, figure="success_length"),
    Bar(
        "success on chains over eight colours whose exact formula was not trained; most were met under other names",
        (OWN,),
        least=0.95,
    ),
)
