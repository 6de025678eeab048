"""Tasks over more colours than the maps of a run have: they are played on maps with discs of these colours, too."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from envs.zones import ZoneConfig, ZoneEnv
from envs.zones.layouts import COLOURS
from t2tl_jax.errors import UserError
from t2tl_jax.ltl import LTLError, resolve_tasks
from t2tl_jax.ltl.errors import unknown_proposition
from t2tl_jax.registry import make_env
from t2tl_jax.runs import train
from t2tl_jax.runs.any_task import told_by_role
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.result import Result


@dataclass(frozen=True)
class Played:
    """A run, ready to play some tasks."""

    result: Result
    """The run, on fuller maps if it needs them."""
    note: str = ""
    """What was added to the maps; '' where nothing was."""
    colours: str = ""
    """The letters of all discs of the fuller maps; '' for the run's own maps."""

    @property
    def settings(self) -> dict[str, str]:
        """What tells evaluations on these maps from those on the run's own."""
        return {"colours": self.colours} if self.colours else {}


def load(folder: Path, stored: Config, tasks: Sequence[str], changes: dict[str, Any]) -> Played:
    """The run in a folder, as `train.load` gives it, ready to play some tasks.

    Args:
        folder: of the run.
        stored: its configuration.
        tasks: names or formulas.
        changes: of fields of the configuration. A `task` among them is the only one of the list.

    Raises:
        UserError: as `train.load` and `ready`.
    """
    if not isinstance(stored.env, ZoneConfig) or not _lacking(stored.env, tasks):
        return Played(train.load(folder, **changes))
    # A task that speaks of other colours cannot be compiled before these are there.
    own = {name: value for name, value in changes.items() if name != "task"}
    played = ready(train.load(folder, **own), tasks)
    if "task" not in changes:
        return played
    experiment = played.result.experiment
    config = replace(experiment.config, task=changes["task"])
    return replace(played, result=replace(played.result, experiment=experiment.with_config(config)))


def lack(result: Result, tasks: Sequence[str]) -> bool:
    """Whether some tasks speak of colours that the maps of the run, as it is played now, do not have."""
    env = result.experiment.env
    return isinstance(env, ZoneEnv) and bool(_lacking(env.config, tasks))


def ready(result: Result, tasks: Sequence[str]) -> Played:
    """The run on maps that have all colours of some tasks: its own where they do, and else fuller ones.

    What is wrong with a task is left to who compiles it, but for colours.

    Raises:
        UserError: if the agent cannot tell the colours that are to be added, or there is no room for their discs.
    """
    env = result.experiment.env
    if not isinstance(env, ZoneEnv) or not (lacking := _lacking(env.config, tasks)):
        return Played(result)
    _check_agent(result.config, env.config, lacking)
    names = [name for name in COLOURS.values() if any(name in of for of in lacking.values())]
    there = _placed(env.config, names)
    fuller = there.config
    discs, each = fuller.colour_of_each_disc, fuller.colours.count(fuller.colours[-1])
    note = (
        f"the maps of this run have no {_listed(names, 'or')}, so every episode is played on fuller maps: discs are "
        f"added ({', '.join(f'{each} {name}' for name in names)}), and each map has {len(discs)} of them in place of "
        f"{len(env.config.colour_of_each_disc)}"
    )
    return Played(result.elsewhere(there, tasks), note, fuller.colours)


def _lacking(config: ZoneConfig, tasks: Sequence[str]) -> dict[str, list[str]]:
    """By task, the propositions that the maps lack; nothing unless there are discs of all or some of these colours."""
    try:
        formulas = resolve_tasks(tasks) if tasks else {}
    except LTLError:  # a mistake, or no formula
        return {}
    there = _names(config)
    lacking = {task: [name for name in of.propositions() if name not in there] for task, of in formulas.items()}
    known = any(name in COLOURS.values() for names in lacking.values() for name in names)
    return {task: names for task, names in lacking.items() if names} if known else {}


def _names(config: ZoneConfig) -> list[str]:
    """The colours of its maps, as `ZoneEnv` lists them."""
    return [name for letter, name in COLOURS.items() if letter in config.colour_of_each_disc]


def _check_agent(trained: Config, config: ZoneConfig, lacking: dict[str, list[str]]) -> None:
    """Refuse what the agent cannot tell, or ZoneEnv does not have."""
    there = _names(config)
    task, names = next(iter(lacking.items()))
    refused = f"{task}: {unknown_proposition(names[0], there, *names[1:])}"
    room = told_by_role(trained)
    if not room:
        raise UserError(
            f"{refused}\nThis agent tells colours by their names or by their places in its observation, so that no "
            "others can be added to its maps: write the task in the colours that are known, or take a run whose agent "
            "tells them by their role, with network.state=merged, such as of the configuration zones_any"
        )
    if config.layout == "fixed":
        raise UserError(f"{refused}\nThe one fixed map has no others; take a run on random maps (env.layout=random)")
    for task, names in lacking.items():
        if strange := [name for name in names if name not in COLOURS.values()]:
            raise UserError(f"{task}: {unknown_proposition(strange[0], tuple(COLOURS.values()), *strange[1:])}")
    others = {name for names in lacking.values() for name in names}
    if len(there) + len(others) > room:
        raise UserError(
            f"this agent tells {room} colours apart, and its maps would have {len(there) + len(others)}: besides "
            f"{_listed(there, 'and')}, name at most {room - len(there)} in one list, and play the other tasks by "
            "themselves"
        )


def _placed(config: ZoneConfig, names: Sequence[str]) -> ZoneEnv:
    """The environment with discs of more colours."""
    there = _listed(_names(config), "and")
    refused = f"the arena has no room for discs of {_listed(names, 'and')} besides those of {there}"
    for count in range(len(names), 0, -1):
        try:
            env = make_env(config.with_colours(names[:count]))
        except ValueError:  # no room
            continue
        if count == len(names):
            return env
        raise UserError(
            f"{refused}; there is for {count} other {'colour' if count == 1 else 'colours'}: name no more in one list, "
            "and play the other tasks by themselves"
        )
    raise UserError(f"{refused}: write tasks in these colours")


def _listed(names: Sequence[str], word: str) -> str:
    *most, last = names
    return f"{', '.join(most)} {word} {last}" if most else last
