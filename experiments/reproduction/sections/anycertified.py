"""Certificates of agents for any task: exact bounds for formulas, of the policy of one seed."""

from collections.abc import Mapping
from typing import Any

from experiments.reproduction.anytask import met, tested
from experiments.reproduction.page import origin, table
from experiments.reproduction.stored import Stored
from t2tl_jax.evaluation.statistics import CONFIDENCE, Estimate
from t2tl_jax.runs.folder import RunFolder, read_json

RUNS = ("any-zones", "any-letters", "any-walls", "any-water", "any-flat")
"""Whose parameters are stored."""

HEADING = ("run", "task", "rows met", "renamed", "success", "violation", "time-out", "ended by env")

ON_MAPS = {
    True: "Each episode has a map of its own, drawn for it alone: the bounds are about all maps that can be drawn.",
    False: "Their maps are those that are kept for evaluation, and come again and again: the bounds are about these.",
}
"""What certificates of episodes with and without a map of their own are about."""


def certified(runs: Mapping[str, Stored]) -> str:
    """Exact bounds for the policy of one seed of each agent."""
    there = {name: runs[name] for name in RUNS if name in runs}
    found = [(name, one) for name, run in there.items() for one in certificates(run)]
    lacking = " ".join(f"{name} has none{_why(there[name])}." for name in there if name not in dict(found))
    if not found:
        return lacking
    rows = [(name, *row) for name, one in found for row in _rows(one, there[name])]
    about = [ON_MAPS[own] for own in (True, False) if any(_own_maps(one) is own for _, one in found)]
    return "\n\n".join(
        (
            table(HEADING, rows),
            f"{' '.join(_told(name, one) for name, one in found)} {lacking}".rstrip(),
            f"{' '.join(about)} Each is of one seed, the run's first, which can lie above or below the means over "
            "seeds of the tables before. Intervals are exact and binomial (Clopper and Pearson); those of "
            f"one command hold at once with {CONFIDENCE:.0%} (Bonferroni), not over several commands. Time-outs and "
            "ends by the environment are shares without bounds.",
            "Each is made by `python -m experiments.evaluate results/any/RUN --tasks TASKS --certify EPISODES`; "
            "certificates.json beside the parameters holds the bounds and the whole command.",
            f"Of these certificates: {origin([one.get('where', {}) for _, one in found])}",
            "Of the trainings:",
        )
    )


def certificates(run: Stored) -> list[dict[str, Any]]:
    """Those that were made from a run's parameters, or else with its tests."""
    afterwards = read_json(RunFolder(run.path).certificates).get("certificates", [])
    with_tests = tested.read(run.path).get(tested.CERTIFIED)
    if afterwards or with_tests is None:
        return afterwards
    return [with_tests | {"where": run.versions}]


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


def _own_maps(made: Mapping[str, Any]) -> bool:
    """Whether each episode had a map of its own; the first certificates did not say, and had none."""
    return made.get("own_maps", False)


def _told(name: str, made: Mapping[str, Any]) -> str:
    """Whose certificates these are, and how long they took."""
    each = made["seconds"] / len(made["by_task"])
    return (
        f"{name}: {made['policy']} policy of seed {made['seed']}, {made['episodes']:,} episodes a task{_limit(made)}, "
        f"{2 * len(made['by_task'])} intervals; {made['seconds']:.0f} s of playing, {each:.1f} s a task, after "
        f"{made.get('map_seconds', 0):.0f} s of drawing maps and {made['compile_seconds']:.0f} s of compiling"
        f"{_device(made)}."
    )


def _limit(made: Mapping[str, Any]) -> str:
    """The time limit; those that were made with the tests have the run's own."""
    limit = made.get("settings", {}).get("episode_length")
    return "" if limit is None else f" of at most {limit:,} steps"


def _device(made: Mapping[str, Any]) -> str:
    """On what it was made, if that is known."""
    devices = made.get("where", {}).get("devices", [])
    return f", on {' and '.join(sorted(set(devices)))}".replace("cpu", "a CPU") if devices else ""


def _why(run: Stored) -> str:
    """Why a run has no certificates, if its files tell."""
    return "" if RunFolder(run.path).params.is_file() else ": its parameters are not stored"
