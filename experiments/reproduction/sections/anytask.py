"""Agents for any task: what they do on formulas that they were not trained on, beside what others report."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from envs.waterworld import WaterWorldConfig
from experiments.paper import published_any as published
from experiments.paper.published_any import ZONES, Published
from experiments.reproduction.anytask import met, suites, tested
from experiments.reproduction.cells import COST, cost
from experiments.reproduction.page import table
from experiments.reproduction.sections.anycertified import Bounds, bounds
from experiments.reproduction.stored import Stored
from t2tl_jax.evaluation.statistics import Estimate, mean, mean_rate, two_way_mean
from t2tl_jax.networks.lookahead import LookaheadConfig

SAMPLED, MODE = "sampled", "deterministic"

RANGES = {"success_length": (0.0, np.inf), "discounted_return": (-np.inf, np.inf)}
"""Of every figure that is no rate."""

Others = Mapping[str, Mapping[str, Published]]


@dataclass(frozen=True)
class Bar:
    """What is asked of a run, and what decides it."""

    says: str
    tasks: tuple[str, ...]
    least: float | None = None
    most: float | None = None
    figure: str = "success_rate"
    policy: str = SAMPLED
    over: str = "mean"
    """The mean over tasks and seeds, or the worst seed and task ("worst"), or the mean over seeds of the task that has
    the worst one ("task")."""


def figures(run: Stored) -> dict[str, dict[str, dict[str, np.ndarray]]]:
    """By task, policy and figure: float[seeds], NaN where there is none. Tasks of other worlds name them."""
    found = {}
    for part, entry in tested.read(run.path).items():
        for task, policies in entry.get("tasks", {}).items():
            suite = _ELSEWHERE.get(part)
            found[tested.name_elsewhere(task, suite) if suite else task] = {
                policy: {name: np.array(values, np.float64) for name, values in of.items()}
                for policy, of in policies.items()
            }
    if (reports := {policy: run.played(policy=policy) for policy in (SAMPLED, MODE)}) and all(reports.values()):
        found[OWN] = {
            policy: {
                name: np.array([seed[name]["value"] for seed in report["seeds"]], np.float64) for name in tested.FIGURES
            }
            for policy, report in reports.items()
            if report is not None
        }
    return found


OWN = met.OWN
"""Formulas of the family of the training that it never had as they stand, on maps that it never had."""

_ELSEWHERE = {suite.name: suite for suite in (*suites.MORE_COLOURS, suites.EXCHANGED)}
"""Suites whose tasks are also played elsewhere, or otherwise."""


def over_seeds(values: np.ndarray, figure: str) -> Estimate:
    """The mean over seeds."""
    known = values[np.isfinite(values)]
    return mean(known, *RANGES[figure]) if figure in RANGES else mean_rate(known)


def by_spread(values: np.ndarray, figure: str) -> Estimate:
    """The mean over seeds with Student's t interval, of rates too; without one where all seeds are equal."""
    return mean(values[np.isfinite(values)], *RANGES.get(figure, (0.0, 1.0)))


def spread(rates: Mapping[int, float]) -> str:
    """The same of rates by seed, for a cell."""
    return by_spread(np.array(list(rates.values()), np.float64), "success_rate").text()


def interval(estimate: Estimate, digits: int = 3) -> str:
    """The interval alone, for a cell; a dash where there is none."""
    if estimate.low is None or estimate.high is None:
        return "-"
    return f"[{estimate.low:.{digits}f}, {estimate.high:.{digits}f}]"


def over_tasks(of: Mapping[str, Any], tasks: Sequence[str], policy: str, figure: str) -> Estimate:
    """The mean over seeds and tasks, both of them samples."""
    values = np.stack([of[task][policy][figure] for task in tasks], axis=1)
    return two_way_mean(values, *RANGES.get(figure, (0.0, 1.0)))


def own_family(run: Stored, policy: str = SAMPLED) -> dict[int, float]:
    """Success by seed on formulas of the training's family that it never had as they stand, on maps likewise."""
    return run.by_seed("success_rate", policy=policy)


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
        "-",  # the interval beside it is of this kind
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


def _in_time(run: Stored, most: float) -> tuple[str, str, str, str]:
    """Whether training of all seeds took no longer than it may, compiling and pre-training included."""
    before = run.status.get("pretraining", {}).get("training_seconds", 0.0)
    took = run.train_seconds + run.compile_seconds + before
    says = f"seconds, training of all {len(run.seeds)} seeds and compiling"
    return says, f"under {most:g}", f"{took:.0f}", REACHED if took < most else MISSED


Aim = tuple[str, str, str, str]
"""What is asked, the bar, what was measured, and what becomes of it."""

Aims = Callable[[Mapping[str, Stored]], list[Aim]]
"""The aims of a section, of the runs that are there."""

AIMS_HEADING = ("aim of this project", "bar", "measured", "")

REACHED, MISSED = "reached", "**not reached**"


def aims_of_run(name: str, bars: Sequence[Bar], seconds: float | None = None) -> Aims:
    """What becomes of what is asked of one run.

    Args:
        name: of the run.
        bars: what is asked.
        seconds: that training of all seeds and compiling may take; None where nothing is asked.
    """

    def found(runs: Mapping[str, Stored]) -> list[Aim]:
        if name not in runs:
            return []
        run = runs[name]
        timed = [] if seconds is None else [_in_time(run, seconds)]
        return [*aims(figures(run), bars, bounds(run)), *timed]

    return found


def aims(of: Mapping[str, Any], bars: Sequence[Bar], certified: Mapping[str, Bounds] | None = None) -> list[Aim]:
    """What is asked, what was measured, and whether it is reached.

    Args:
        of: figures, as `figures` gives them.
        bars: what is asked; those of which a task was not played are left out.
        certified: by task, what a certificate says of the sampled policy of one seed.
    """
    rows = []
    for bar in bars:
        if not set(bar.tasks) <= of.keys():
            continue
        measured, estimate = _measured(of, bar)
        wanted = f"at least {bar.least:g}" if bar.least is not None else f"at most {bar.most:g}"
        says = f"{bar.says} (mode)" if bar.policy == MODE else bar.says
        said = _reached(of, bar, certified or {}) if _holds(bar, measured) else MISSED
        rows.append((says, wanted, estimate, said))
    return rows


def verdicts(of: Mapping[str, Any], bars: Sequence[Bar]) -> str:
    """The same as a table; '' where nothing was played."""
    return table(AIMS_HEADING, aims(of, bars))


def _holds(bar: Bar, value: float) -> bool:
    return (bar.least is None or value >= bar.least) and (bar.most is None or value <= bar.most)


def _reached(of: Mapping[str, Any], bar: Bar, certified: Mapping[str, Bounds]) -> str:
    """That a mean reaches the bar, and what speaks against it: an interval that includes the bar, or a certificate that
    lies below it."""
    doubts, digits = [], _digits(bar)
    seeds = by_spread(_by_seed(of, bar), bar.figure)
    if bar.over != "worst" and _includes(seeds, bar):
        ends = "" if bar.over == "mean" and len(bar.tasks) == 1 else f", {interval(seeds, digits)},"
        doubts.append(f"the interval over seeds{ends} includes the bar")
    doubts += _below(bar, certified)
    if doubts:
        return f"{REACHED} by the mean alone: {'; '.join(doubts)}"
    if bar.over == "mean" and len(bar.tasks) > 1 and _includes(over_tasks(of, bar.tasks, bar.policy, bar.figure), bar):
        return f"{REACHED} for these formulas; the interval for others of their kind includes the bar"
    return REACHED


def _by_seed(of: Mapping[str, Any], bar: Bar) -> np.ndarray:
    """float[seeds]: what the bar is about, of each seed; the mean over tasks, or of the task that is worst."""
    each = np.array([of[task][bar.policy][bar.figure] for task in bar.tasks])
    found: np.ndarray = min(each, key=np.nanmean) if bar.over == "task" else np.nanmean(each, axis=0)
    return found


def _includes(estimate: Estimate, bar: Bar) -> bool:
    """Whether an interval does not lie wholly on the right side of the bar."""
    return any(not _holds(bar, end) for end in (estimate.low, estimate.high) if end is not None)


def _below(bar: Bar, certified: Mapping[str, Bounds]) -> list[str]:
    """Certificates of single tasks that the bar is about, which lie wholly below it."""
    if bar.least is None or bar.policy != SAMPLED or bar.figure != "success_rate":
        return []
    single = bar.tasks if bar.over != "mean" or len(bar.tasks) == 1 else ()  # a mean asks nothing of its parts
    return [
        f"the certificate of {task}, of seed {one.seed}, lies below it: {one.success.text(4)}"
        for task in single
        if (one := certified.get(task)) and one.success.high is not None and one.success.high < bar.least
    ]


def _digits(bar: Bar) -> int:
    return 0 if bar.figure == "success_length" else 3


def _measured(of: Mapping[str, Any], bar: Bar) -> tuple[float, str]:
    each = [of[task][bar.policy][bar.figure] for task in bar.tasks]
    digits = _digits(bar)
    if bar.over == "worst":
        values = [float(np.nanmin(values)) for values in each]
    elif bar.over == "task":
        values = [float(np.nanmean(values)) for values in each]
    else:
        estimate = (
            by_spread(np.asarray(each[0]), bar.figure)
            if len(each) == 1
            else over_tasks(of, bar.tasks, bar.policy, bar.figure)
        )
        return (np.nan if estimate.value is None else estimate.value), estimate.text(digits)
    worst = int(np.argmin(values))
    said = f"{values[worst]:.{digits}f} ({bar.tasks[worst]})"
    if bar.over == "task":  # a mean hides what single seeds do
        said += f"; worst seed and formula {min(float(np.nanmin(values)) for values in each):.{digits}f}"
    return values[worst], said


def state_of(run: Stored) -> str:
    """What the policy reads of observations."""
    learner: Any = run.config.learner
    return type(learner.network.state).__name__.removesuffix("Config").lower()


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
