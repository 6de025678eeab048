"""What a training met of the tasks that its agents are tested on: the rows of all its pools, which can be made again.

`experiments.split` asks the same of families, of which it draws. Here the pools are those that were trained on, so that
what was drawn by chance and what was kept out both count.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from experiments.paper import fixed_set
from experiments.reproduction.anytask import tested
from experiments.reproduction.anytask.suites import Suite
from t2tl_jax.env import LabelledEnv
from t2tl_jax.ltl import Formula, TaskTable, languages, renaming, resolve_tasks, row_languages, share
from t2tl_jax.ltl.languages import Language
from t2tl_jax.registry import make_env
from t2tl_jax.runs import config_files
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.folder import RunFolder, read_json, write_json
from t2tl_jax.runs.pools import make_pools

FILE = "met.json"
"""In the folder of a kept run."""

Rows = tuple[frozenset[Language], frozenset[Language]]
"""By language, and up to renaming of propositions."""


def rows_trained_on(config: Config, env: LabelledEnv) -> Rows:
    """The languages of all open rows of all pools of a training."""
    pools = make_pools(config, env)
    assert pools is not None
    known: dict[Language, Language] = {}
    for number in range(-(-config.iterations // config.pool.period)):
        known.update(_renamed(pools.training(number), known))
    return frozenset(known), frozenset(known.values())


def _renamed(table: TaskTable, known: dict[Language, Language]) -> dict[Language, Language]:
    """The open rows of a table that are not known: their languages, and the classes of these."""
    automaton = table.automaton()
    rows = np.flatnonzero(automaton.verdict == 0).tolist()
    found = languages.of_rows(automaton.every_letter(), automaton.verdict, rows)
    new = {language: row for language, row in zip(found, rows, strict=True) if language not in known}
    return dict(zip(new, renaming.of_rows(automaton.steps, automaton.verdict, new.values()), strict=True))


def shares(config: Config, tasks: dict[str, list[Formula]]) -> dict[str, dict[str, Any]]:
    """How many of the open rows of some tasks a training met.

    Args:
        config: of the run.
        tasks: by what they are called.

    Returns:
        ``{"exactly": {task: "2/5"}, "renamed": {task: "3/5"}, "rows": [by language, up to renaming]}``
    """
    env = make_env(config.env)
    known = rows_trained_on(config, env)
    found: dict[str, dict[str, Any]] = {"exactly": {}, "renamed": {}, "rows": {}}
    for kind, renamed in (("exactly", False), ("renamed", True)):
        found["rows"][kind] = len(known[renamed])
        for name, formulas in tasks.items():
            rows = row_languages(formulas, env.propositions, env.alphabet, renamed=renamed)
            found[kind][name] = str(share(rows, known[renamed]))
    return found


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


def keep(folder: Path, suites: tuple[Suite, ...]) -> None:
    """Count what a kept run met of its suites, which takes a minute, and write it beside its other files."""
    config = config_files.load(RunFolder(folder).config)
    if suites:
        write_json(folder / FILE, shares(config, dict(_formulas(suites, make_env(config.env)))))


def read(folder: Path) -> dict[str, dict[str, Any]]:
    """What is stored of it; nothing where there is no file."""
    file = folder / FILE
    return read_json(file) if file.is_file() else {"exactly": {}, "renamed": {}, "rows": {}}
