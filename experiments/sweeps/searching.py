"""``--search``: settings are proposed in batches, trained, and ranked; the best one is named with how to report it."""

import dataclasses
import shlex
from pathlib import Path
from typing import Any

from experiments import tuning
from experiments.cli import request
from experiments.cli.grid import Point
from experiments.sweeps import report, space
from experiments.sweeps.plan import PROG, Plan
from experiments.sweeps.search import CONFIGURATION, Search, recorded, worth
from experiments.sweeps.work import Work
from t2tl_jax.runs.folder import RunFolder, locked

DRAWN = 5
"""So many of the best settings of a search are drawn; curves of all of them could not be told apart."""


def run(plan: Plan, work: Work) -> None:
    """Train the settings that are proposed, batch by batch, and say which is best.

    Raises:
        Interrupted: saying when the user stopped it.
    """
    if plan.only is not None:
        search = Search(plan.base, plan.space, plan.search_seed, _content(plan), begins=False)
        work.train({_folder(plan, number): _point(plan, search, number) for number in plan.only}, plan.only)
        return
    plan.base.mkdir(parents=True, exist_ok=True)
    with locked(RunFolder(plan.base)):
        search = Search(plan.base, plan.space, plan.search_seed, _content(plan))
        print(f"search on seeds {plan.config.seeds.rstrip(',')}, on which no result is reported")
        runs: dict[Path, Point] = {}
        for start in range(0, plan.trials, plan.batch):
            numbers = range(start, min(start + plan.batch, plan.trials))
            batch = {_folder(plan, number): _point(plan, search, number) for number in numbers}
            print(f"trials {start} to {numbers[-1]} of {plan.trials}:")
            work.train(batch, numbers)
            for number, of_trial in zip(numbers, report.read_curves(batch).values(), strict=True):
                search.tell(number, worth(report.final_returns(of_trial)))
            runs |= batch
        values = {_folder(plan, number): value for number, value in search.values.items() if number < plan.trials}
    ranked = sorted(runs, key=lambda path: -values[path])
    curves = report.read_curves(ranked)
    print(f"\n{report.HEAD}")
    for path in ranked:
        print(report.line(path, runs[path], curves[path]))
    print(report.LEGEND)
    report.draw({runs[path].label: curves[path] for path in ranked[:DRAWN]}, plan.base)
    best = runs[ranked[0]]
    print(
        f"best: {best.label}, of {len(ranked)} settings by the mean discounted return over seeds "
        f"{plan.config.seeds.rstrip(',')}.\nThe best of so many looks better than it is; on other seeds it is:"
    )
    print(f"  {_reporting(plan, best)}")
    print(f"done: {plan.base}")


def _folder(plan: Plan, number: int) -> Path:
    """Where the run of a trial lies."""
    return plan.base / f"trial-{number:04d}"


def _point(plan: Plan, search: Search, number: int) -> Point:
    """The setting of a trial, under its number."""
    point = space.point(plan.space, search.texts(number), plan.config.seeds, plan.asked, PROG)
    return dataclasses.replace(point, label=f"trial {number}: {point.label}")


def _content(plan: Plan) -> dict[str, Any]:
    """What makes a search the same one, for its record."""
    return {
        CONFIGURATION: recorded(plan.config),
        "seeds": plan.config.seeds,
        "space": [dimension.text for dimension in plan.space],
        "search-seed": plan.search_seed,
    }


def _reporting(plan: Plan, best: Point) -> str:
    """The command that trains a setting on seeds that nothing was chosen on."""
    rest = list(plan.rest)
    for flag in ("--seeds", *(f"--{dimension.axis.flag}" for dimension in plan.space)):
        place, word = request.find(rest, flag)
        rest = rest if word is None else request.without(rest, place)
    seeds = ("--seeds", tuning.for_report(best.config))
    return shlex.join(["python", "-m", "experiments.run", *rest, *best.words, *seeds])
