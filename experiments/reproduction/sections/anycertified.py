"""Certificates of agents for any task: exact bounds for formulas, of the policy of one seed."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from experiments.reproduction.anytask import met, tested
from experiments.reproduction.page import origin, table
from experiments.reproduction.stored import Stored
from t2tl_jax.evaluation.statistics import CONFIDENCE, Estimate
from t2tl_jax.runs.folder import RunFolder, read_json

RUNS = ("any-zones", "any-letters", "any-walls", "any-water", "any-flat")
"""Whose parameters are stored."""

HEADING = ("run", "task", "rows met", "renamed", "success", "violation", "time-out", "ended by env")

MOST_FORMULAS = 6
"""Of a longer list of formulas that have no names, the table has three lines."""

MOST_SECONDS = 60.0
"""What a certificate of `tested.CERTIFICATE_EPISODES` episodes may take."""


@dataclass(frozen=True)
class Bounds:
    """What a certificate says of a task."""

    seed: int
    """Whose policy it is of."""
    success: Estimate


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
    lists = " ".join(_of_list(name, one) for name, one in found if len(_unnamed(one)) > MOST_FORMULAS)
    about = [ON_MAPS[own] for own in (True, False) if any(_own_maps(one) is own for _, one in found)]
    return "\n\n".join(
        (
            table(HEADING, rows),
            *([lists] if lists else []),
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


def bounds(run: Stored) -> dict[str, Bounds]:
    """What the certificates of a run say of success, by task."""
    return {
        task: Bounds(made["seed"], Estimate(**one["success"]))
        for made in certificates(run)
        for task, one in made["by_task"].items()
    }


def in_time(runs: Mapping[str, Stored]) -> list[tuple[str, str, str, str]]:
    """Whether a certificate of one formula took no longer than it may, playing, maps and compiling together, in the run
    where it took longest on a GPU; and what the longest on a CPU took, of which nothing is asked."""
    took: dict[bool, list[tuple[float, str]]] = {True: [], False: []}
    for name in RUNS:
        for made in certificates(runs[name]) if name in runs else []:
            if made["episodes"] >= tested.CERTIFICATE_EPISODES:
                each = made["seconds"] / len(made["by_task"]) + made.get("map_seconds", 0.0) + made["compile_seconds"]
                took[set(made.get("where", {}).get("devices", [])) != {"cpu"}].append((each, name))
    if not took[True]:
        return []
    (seconds, run), on_cpu = max(took[True]), max(took[False], default=None)
    also = "" if on_cpu is None else f"; on a CPU {on_cpu[0]:.0f} ({on_cpu[1]})"
    return [
        (
            f"seconds, a certificate of one formula by {tested.CERTIFICATE_EPISODES:,} episodes, on a GPU",
            f"under {MOST_SECONDS:g}",
            f"at most {seconds:.0f} ({run}), maps and compiling included{also}",
            "reached" if seconds < MOST_SECONDS else "**not reached**",
        )
    ]


def _rows(made: Mapping[str, Any], run: Stored) -> list[tuple[str, ...]]:
    """The cells of every task of some certificates; of a long list of formulas, those of three of them."""
    shares, unnamed = met.read(run.path), _unnamed(made)
    chosen = _three(made, unnamed) if len(unnamed) > MOST_FORMULAS else {}
    called = {task: label for label, task in chosen.items()}
    shown = [task for task in made["by_task"] if not (chosen and task in unnamed)] + list(called)
    return [(_cell(called.get(task, task)), *met.cells(shares, task), *_figures(made, task)) for task in shown]


def _cell(text: str) -> str:
    """A bar in a formula would end its cell."""
    return text.replace("|", "\\|")


def _figures(made: Mapping[str, Any], task: str) -> tuple[str, ...]:
    one = made["by_task"][task]
    return (
        Estimate(**one["success"]).text(5),
        Estimate(**one["violation"]).text(5),
        *(f"{one[what] / made['episodes']:.5f}" for what in ("timeouts", "env_terminations")),
    )


def _unnamed(made: Mapping[str, Any]) -> list[str]:
    """Tasks that are called by their formulas."""
    return [task for task in made["by_task"] if not task.isidentifier()]


def _three(made: Mapping[str, Any], tasks: list[str]) -> dict[str, str]:
    """By what they are called, the formulas of a list with the lowest, the middle and the highest success."""
    ordered = sorted(tasks, key=lambda task: float(made["by_task"][task]["success"]["value"]))
    places = {"lowest": 0, "middle": (len(ordered) - 1) // 2, "highest": -1}
    return {f"{which} of {len(ordered)} formulas": ordered[place] for which, place in places.items()}


def _of_list(name: str, made: Mapping[str, Any]) -> str:
    """Which formulas stand for a long list."""
    three = _three(made, _unnamed(made))
    said = ", ".join(f"{label.partition(' ')[0]} `{task}`" for label, task in three.items())
    return (
        f"Of the {len(_unnamed(made))} formulas of {name} that have no names, by their success: {said}; "
        "certificates.json has every one."
    )


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
