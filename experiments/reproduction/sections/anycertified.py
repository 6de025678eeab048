"""Certificates of agents for any task: exact bounds for formulas, of the policy of one seed."""

from collections.abc import Mapping
from typing import Any

from experiments.reproduction.anytask import met, tested
from experiments.reproduction.page import origin, table
from experiments.reproduction.stored import Stored
from t2tl_jax.evaluation.statistics import CONFIDENCE, Estimate
from t2tl_jax.runs.folder import RunFolder, read_json

ZONES = "any-zones"
"""Its certificates are made with its tests."""

OTHERS = ("any-letters", "any-walls", "any-water", "any-flat")
"""Those of these were made afterwards, if their parameters are stored."""

CHOSEN = (
    "Where a formula has no name, it is the first of a list: of the 36 of `Until_1_2_1_1` by their texts, or of the 32 "
    "chains of WaterWorld. Nothing is bounded for the others."
)
"""Which formulas stand for lists of them."""

HEADING = ("task", "rows met", "renamed", "success", "violation", "time-out", "ended by env")


def certified(runs: Mapping[str, Stored]) -> str:
    """Exact bounds for the policy of one seed of each agent."""
    return "\n\n".join(part for part in (with_tests(runs), afterwards(runs)) if part)


def with_tests(runs: Mapping[str, Stored]) -> str:
    """Of the open ZoneEnv's agent, from what its tests stored."""
    if ZONES not in runs:
        return ""
    made = tested.read(runs[ZONES].path).get(tested.CERTIFIED)
    if made is None:
        return "The run that is stored has none."
    return "\n\n".join(
        (
            table(HEADING, _rows(made, runs[ZONES])),
            f"{made['policy']} policy of seed {made['seed']}, {made['episodes']:,} episodes a task, on "
            f"{_maps(runs[ZONES])} that are kept for evaluation, each of which comes again "
            "and again: the bounds are about these maps, and not about all that can be drawn. Certified are "
            f"{', '.join(made['by_task'])}, and no other formula for this agent. Exact binomial "
            f"intervals (Clopper and Pearson), all {2 * len(made['by_task'])} of which hold at once with "
            f"{CONFIDENCE:.0%}. Played in {made['seconds']:.0f} s after {made['compile_seconds']:.0f} s of compiling, "
            "beside other work on the same GPU.",
        )
    )


def afterwards(runs: Mapping[str, Stored]) -> str:
    """Of the other agents, from the files beside their parameters."""
    there = {name: runs[name] for name in OTHERS if name in runs}
    found = [(name, one) for name, run in there.items() for one in made_afterwards(run)]
    without = [name for name in there if name not in dict(found)]
    lacking = " ".join(f"{name} has none{_why(there[name])}." for name in without)
    if not found:
        return lacking
    rows = [(name, f"{one['episodes']:,}", *row) for name, one in found for row in _rows(one, there[name])]
    fewer = any(one["episodes"] < tested.CERTIFICATE_EPISODES for _, one in found)
    few = " Where there are fewer episodes, more would have taken too long there, and the bounds are wider."
    return "\n\n".join(
        (
            "Of other agents, made afterwards from the parameters that are stored:",
            table(("run", "episodes a task", *HEADING), rows),
            f"{' '.join(_told(name, one, there[name]) for name, one in found)} {lacking}",
            "Each is of one seed, which can lie above or below the means over seeds of the tables before. The "
            f"intervals are made as above, and about the maps likewise; they hold at once with {CONFIDENCE:.0%} within "
            f"a run, not over several runs.{few if fewer else ''} {CHOSEN} Each run by `python -m experiments.evaluate "
            "results/any/RUN --tasks TASKS --certify EPISODES`, beside other work on the same processor; it stores the "
            "bounds and the whole command in certificates.json beside the parameters.",
            f"Of these certificates: {origin([one.get('where', {}) for _, one in found])}",
            "Of the trainings, any-zones' too:",
        )
    )


def made_afterwards(run: Stored) -> list[dict[str, Any]]:
    """The certificates that lie beside a run's parameters."""
    return read_json(RunFolder(run.path).certificates).get("certificates", [])


def _rows(made: Mapping[str, Any], run: Stored) -> list[tuple[str, ...]]:
    """The cells of every task of some certificates; a bar in a formula would end its cell."""
    shares = met.read(run.path)
    return [
        (
            task.replace("|", "\\|"),
            *met.cells(shares, task),
            Estimate(**one["success"]).text(5),
            Estimate(**one["violation"]).text(5),
            *(f"{one[what] / made['episodes']:.5f}" for what in ("timeouts", "env_terminations")),
        )
        for task, one in made["by_task"].items()
    ]


def _told(name: str, made: Mapping[str, Any], run: Stored) -> str:
    """Whose certificates these are, and how long they took."""
    return (
        f"{name}: {made['policy']} policy of seed {made['seed']}, {made['settings']['checkpoint']} parameters, "
        f"{_maps(run)}, {2 * len(made['by_task'])} intervals, played in {made['seconds']:.0f} s after "
        f"{made['compile_seconds']:.0f} s of compiling."
    )


def _why(run: Stored) -> str:
    """Why a run has no certificates, if its files tell."""
    return "" if RunFolder(run.path).params.is_file() else ": its parameters are not stored"


def _maps(run: Stored) -> str:
    """How many maps are kept for evaluation."""
    count = getattr(run.config.env, "pool_size", None)
    return "the maps" if count is None else f"{count:,} maps"
