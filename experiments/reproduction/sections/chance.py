"""What random actions get in WaterWorld, beside the first published values of `phi_water` and our own."""

from collections.abc import Mapping
from typing import Any

from experiments.paper.published_water import EPISODES, PHI_WATER
from experiments.reproduction.chance import FILE, NAME
from experiments.reproduction.page import table
from experiments.reproduction.runs import SHORTLY
from experiments.reproduction.sections import figures
from experiments.reproduction.stored import Stored
from experiments.reproduction.tables import returns_at
from t2tl_jax.evaluation import statistics
from t2tl_jax.evaluation.statistics import Estimate
from t2tl_jax.runs.folder import read_json

FIRST = EPISODES[0]
"""The first episode at which the published curves were read."""


def water_beginning(runs: Mapping[str, Stored]) -> str:
    """The first episodes of trainings, and what chance gets."""
    others = {name: runs[name] for name in (*SHORTLY, *SHORTLY.values()) if name in runs}
    runs = {name: run for name, run in runs.items() if name not in others}
    trained = {name: run for name, run in runs.items() if name != NAME}
    parts = (figures.water_beginning(trained), figures.other_beginnings(others), random_play(runs))
    return "\n\n".join(part for part in parts if part)


def random_play(runs: Mapping[str, Stored]) -> str:
    """A row for each setting, the published and our own values beside it, and which settings reach the former."""
    if NAME not in runs:
        return ""
    stored = read_json(runs[NAME].path / FILE)
    settings = stored["settings"]
    heading = ("random actions in", "maps drawn for", "return", "success", "violation", "steps", "episodes a map")
    rows = [
        (
            named(setting),
            _radius(setting["map_radius"]),
            returns(setting).text(4),
            *(statistics.mean(_each(setting, rate), lowest=0, highest=1).text(4) for rate in _RATES),
            statistics.mean(_each(setting, "mean_length"), lowest=0, highest=stored["episode_length"]).text(1),
            f"{min(_each(setting, 'episodes')):,}",
        )
        for setting in settings
    ]
    parts = (
        *(_what(stored), table(heading, rows), _beside(runs)),
        *(reached(settings), above_chance(runs, settings), _taken(stored)),
    )
    return "\n\n".join(part for part in parts if part)


def named(setting: Mapping[str, Any]) -> str:
    """What a setting is called."""
    changed = [*([_radius(setting["radius"])] if setting["radius"] != 1 else [])]
    changed += [f"speed x {setting['speed']:g}"] if setting["speed"] != 1 else []
    return ", ".join(changed) or "the default world"


def returns(setting: Mapping[str, Any]) -> Estimate:
    """Mean return of a setting, with an interval over maps."""
    return statistics.mean(_each(setting, "mean_return"), lowest=-1, highest=1)


def reached(settings: list[dict[str, Any]]) -> str:
    """At which settings random play is at or above the highest of the first published values."""
    best = max(PHI_WATER, key=lambda method: PHI_WATER[method][0])
    value = PHI_WATER[best][0]
    means = {_full_name(setting): returns(setting).value for setting in settings}
    there = [f"{name} ({mean:.3f})" for name, mean in means.items() if mean is not None and mean >= value]
    where = "; ".join(there) if there else "none of these settings"
    highest = f"the highest published value at {FIRST} episodes, {value:.2f} ({best})"
    return f"Random play is at or above {highest}, at: {where}."


def above_chance(runs: Mapping[str, Stored], settings: list[dict[str, Any]]) -> str:
    """By how much the first episodes of our trainings are better than chance, on the same maps; '' without any."""
    default = [one for one in settings if one["radius"] == one["speed"] == one["map_radius"] == 1]
    chance = {of_map["map"]: of_map["mean_return"] for one in default for of_map in one["maps"]}
    found = []
    for name, run in runs.items():
        if name != NAME and set(run.seeds) <= set(chance):
            more = returns_at(run, [FIRST])[:, 0] - [chance[seed] for seed in run.seeds]
            found.append(f"{name} {statistics.mean(more).text()}")
    if not found:
        return ""
    return f"Ours at {FIRST} episodes less random play in the default world, map by map: {', '.join(found)}."


_RATES = ("success_rate", "violation_rate")
"""Each of thousands of episodes, so that the spread over maps says how well their mean is known."""


def _what(stored: Mapping[str, Any]) -> str:
    return (
        f"Uniformly random actions on `{stored['task']}`, nothing learned, on the same maps and within the same "
        f"{stored['episode_length']} steps. Radius and speed are of the balls alone; the agent keeps its own. Where "
        "maps are drawn for larger balls, they are others than those of the runs above. Intervals are over maps. "
        "If the next goal and each of the three obstacles were always as likely to be touched first, 1 episode in "
        f"{4**5:,} would succeed, whatever radius and speed are; a time-out counts 0."
    )


def _beside(runs: Mapping[str, Stored]) -> str:
    """The published values and those of the trainings at the first episode that is known."""
    published = ", ".join(f"{method} {curve[0]:.2f}" for method, curve in PHI_WATER.items())
    ours = {name: returns_at(run, [FIRST])[:, 0] for name, run in runs.items() if name != NAME}
    known = ", ".join(f"{name} {statistics.mean(values).text()}" for name, values in ours.items())
    return f"Published at {FIRST} episodes: {published}." + (f" Ours, mean of these {FIRST}: {known}." if known else "")


def _taken(stored: Mapping[str, Any]) -> str:
    frames = sum(sum(_each(setting, "frames")) for setting in stored["settings"])
    return (
        f"In all {frames:,} frames in {stored['seconds']:.0f} s, compiling {stored['compile_seconds']:.0f} s "
        "before that; no seeds but the maps."
    )


def _full_name(setting: Mapping[str, Any]) -> str:
    other = f" on maps for {_radius(setting['map_radius'])}" if setting["map_radius"] != 1 else ""
    return f"{named(setting)}{other}"


def _radius(factor: float) -> str:
    return f"radius x {factor:g}"


def _each(setting: Mapping[str, Any], name: str) -> list[Any]:
    return [of_map[name] for of_map in setting["maps"]]
