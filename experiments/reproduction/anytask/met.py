"""What a training met of the tasks that its agents are tested on: the rows of all its pools, which can be made again.

`experiments.split` asks the same of families, of which it draws. Here the pools are those that were trained on, so that
what was drawn by chance and what was kept out both count.
"""

import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from experiments.paper import fixed_set
from experiments.reproduction.anytask import tested
from experiments.reproduction.anytask.suites import WATER_CHAINS, Suite
from t2tl_jax.env import LabelledEnv
from t2tl_jax.errors import UserError
from t2tl_jax.ltl import (
    Formula,
    is_family,
    languages,
    renaming,
    resolve_tasks,
    row_languages,
    share,
)
from t2tl_jax.ltl.compiler.steps import Steps
from t2tl_jax.ltl.languages import Language
from t2tl_jax.registry import make_env
from t2tl_jax.runs import config_files, pool_workers
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.folder import RunFolder, read_json, write_json
from t2tl_jax.runs.met import Rows, met_elsewhere, new_rows, pools_drawn
from t2tl_jax.runs.pools import make_pools

FILE = "met.json"
"""In the folder of a kept run."""

SHARE = re.compile("[0-9]{1,9}/[0-9]{1,9}")
"""How many of a task's rows were met, of how many."""

OWN = "its own family"
"""What the formulas are called, of the family of the training, that it is evaluated on."""

Shares = dict[str, dict[str, Any]]
"""``{"exactly": {task: "2/5"}, "renamed": {task: "3/5"}, "rows": {"exactly": 90, "renamed": 40}, "own": {...}}``: by
language, and up to renaming of propositions. `own` counts the formulas of `OWN`: all of them, those that training met
as a whole under their own names and up to renaming, and those of which it met no row up to renaming."""

ALSO = {"any-water": (WATER_CHAINS,)}
"""Lists whose rows are counted of a run that was not tested on them, by its name."""

MOST_KEPT = 2
"""So many sets of pools are remembered: those of an agent, and of the code that was learned before it."""


_of_pools: dict[str, Rows] = {}
"""What the last pools held, by all that they depend on: trainings that differ in their network alone draw the same."""


def rows_trained_on(config: Config, env: LabelledEnv) -> Rows:
    """The languages of all open rows of all pools of a training."""
    numbers = range(pools_drawn(config, config.iterations))
    pools = (config.task, config.pool, config.limits, config.progression)
    drawn_by = repr((*pools, env.propositions, env.alphabet, numbers))
    if drawn_by not in _of_pools:
        while len(_of_pools) >= MOST_KEPT:
            del _of_pools[next(iter(_of_pools))]
        _of_pools[drawn_by] = _rows_of_pools(config, env, numbers)
    return _of_pools[drawn_by]


def _rows_of_pools(config: Config, env: LabelledEnv, numbers: range) -> Rows:
    known: dict[Language, Language] = {}
    if config.run.pool_processes:  # as many as there is something to do for here
        count = min(config.run.pool_processes, os.cpu_count() or 1)
        config = replace(config, run=replace(config.run, pool_processes=count))
        with pool_workers.executor(config, env) as workers:
            for new in workers.map(_new_in, numbers, chunksize=16):
                known.update(new)
        return frozenset(known), frozenset(known.values())
    pools = make_pools(config, env)
    assert pools is not None
    for number in numbers:
        known.update(new_rows(pools.training(number), known))
    return frozenset(known), frozenset(known.values())


_known: dict[Language, Language] = {}
"""What a process that draws has met so far."""


def _new_in(number: int) -> dict[Language, Language]:
    """The open rows of a pool that this process had not met before."""
    new = new_rows(pool_workers.draw(number), _known)
    _known.update(new)
    return new


def shares(config: Config, tasks: dict[str, list[Formula]], elsewhere: Iterable[tuple[Suite, str]] = ()) -> Shares:
    """How many of the open rows of some tasks a training met, and of the formulas that it is evaluated on.

    Args:
        config: of the run.
        tasks: in the world of the training, by what they are called.
        elsewhere: suites in other worlds, and a task of each.
    """
    env = make_env(config.env)
    known = rows_trained_on(config, env)
    found: Shares = {"exactly": {}, "renamed": {}, "rows": {}}
    for kind, renamed in (("exactly", False), ("renamed", True)):
        found["rows"][kind] = len(known[renamed])
        for name, formulas in tasks.items():
            rows = row_languages(formulas, env.propositions, env.alphabet, renamed=renamed)
            found[kind][name] = str(share(rows, known[renamed]))
    for suite, task in elsewhere:
        assert suite.env is not None
        name, there = tested.name_elsewhere(task, suite), make_env(suite.env)
        (formula,) = resolve_tasks([task]).values()
        found["exactly"][name], found["renamed"][name] = map(
            str, met_elsewhere(formula, there.propositions, env, known)
        )
    return found | _met_of_own(config, env, known, found)


def _met_of_own(config: Config, env: LabelledEnv, known: Rows, found: Shares) -> Shares:
    """The same shares with those of the pool of formulas that the run is evaluated on."""
    pools = make_pools(config, env)
    assert pools is not None
    table = pools.evaluation
    automaton, (exactly, renamed) = table.automaton(), known
    open_rows = np.flatnonzero(automaton.verdict == 0).tolist()
    exact = languages.of_rows(automaton.every_letter(), automaton.verdict, open_rows)
    classes = renaming.of_rows(automaton.steps, automaton.verdict, open_rows)
    language_of = dict(zip(open_rows, exact, strict=True))
    class_of = dict(zip(open_rows, classes, strict=True))
    starts = list(dict.fromkeys(np.asarray(table.initial_row).tolist()))
    same = sum(language_of[start] in exactly for start in starts)
    whole = sum(class_of[start] in renamed for start in starts)
    unseen = sum(
        not any(class_of[row] in renamed for row in _ahead(automaton.steps, start) if row in class_of)
        for start in starts
    )
    return {
        "exactly": found["exactly"] | {OWN: str(share(exact, exactly))},
        "renamed": found["renamed"] | {OWN: str(share(classes, renamed))},
        "own": {"formulas": len(starts), "exactly": same, "renamed": whole, "without a row met": unseen},
    }


def _ahead(steps: Steps, start: int) -> list[int]:
    """A row, and all that it can become."""
    found = {start: None}
    waiting = [start]
    while waiting:
        fresh = [row for row in steps.outcomes_of(waiting.pop()) if row not in found]
        found.update(dict.fromkeys(fresh))
        waiting += fresh
    return list(found)


def _formulas(suites: tuple[Suite, ...], env: LabelledEnv) -> Iterator[tuple[str, list[Formula]]]:
    """The tasks of suites in the world of the training, by what the stored results call them."""
    for suite in suites:
        if suite.env is not None or suite.exchanged:
            continue
        if suite.manner == "maps":
            formulas = fixed_set.formulas(suite.tasks[0])
            yield tested.name_of_maps(len(formulas)), formulas
        elif suite.manner == "together":
            formulas = tested.every_task(suite.tasks[0], env.propositions)
            yield tested.name_of_all(suite.tasks[0], len(formulas)), formulas
        else:
            yield from ((name, [formula]) for name, formula in resolve_tasks(suite.tasks).items())


def _elsewhere(suites: tuple[Suite, ...]) -> list[tuple[Suite, str]]:
    """The suites of other worlds, with each of their tasks."""
    there = [suite for suite in suites if suite.env is not None and suite.manner == "each"]
    return [(suite, task) for suite in there for task in suite.tasks]


def keep(folder: Path, suites: tuple[Suite, ...]) -> None:
    """Count what a kept run met of its suites, of those in `ALSO` and of its own family, which takes a minute, and
    write it beside its other files; nothing of a run on one task."""
    file = RunFolder(folder).config
    suites = (*suites, *ALSO.get(folder.name, ()))
    if not file.is_file():
        return
    config = config_files.load(file)
    if is_family(config.task, (env := make_env(config.env)).propositions):
        write_json(folder / FILE, shares(config, dict(_formulas(suites, env)), _elsewhere(suites)))


def read(folder: Path) -> Shares:
    """What is stored of it; nothing where there is no file.

    Raises:
        UserError: if the file holds something else.
    """
    file = folder / FILE
    if not file.is_file():
        return {"exactly": {}, "renamed": {}, "rows": {}}
    stored = read_json(file)
    if not all(_are_shares(stored.get(kind)) for kind in ("exactly", "renamed")):
        raise UserError(f"{file} should hold, for each task, how many of its rows training met, such as 3/5")
    return stored


def _are_shares(found: Any) -> bool:
    return isinstance(found, dict) and all(isinstance(text, str) and SHARE.fullmatch(text) for text in found.values())


def cells(shares: Mapping[str, Mapping[str, Any]], task: str) -> tuple[str, str]:
    """Two cells of a table, of what `read` gives: of a task's open rows, how many were met; and up to names."""
    exactly, renamed = (shares[kind].get(task, "-") for kind in ("exactly", "renamed"))
    return exactly, renamed


def rows_met(shares: Mapping[str, Mapping[str, str]], tasks: Sequence[str]) -> str:
    """Of all open rows of some tasks together, how many a training met up to renaming of propositions."""
    return as_share(counted(shares, [task for task in tasks if task in shares["renamed"]]))


def counted(shares: Mapping[str, Mapping[str, str]], tasks: Sequence[str]) -> tuple[int, int] | None:
    """The same as numbers; None where it is not known of all tasks, or where there are none."""
    if not tasks or not set(tasks) <= shares["renamed"].keys():
        return None
    found = [shares["renamed"][task].split("/") for task in tasks]
    return sum(int(some) for some, _ in found), sum(int(rows) for _, rows in found)


def as_share(counted: tuple[int, int] | None) -> str:
    """A cell: how many were met, of how many; a dash where that is not known."""
    return "-" if counted is None else f"{counted[0]}/{counted[1]}"
