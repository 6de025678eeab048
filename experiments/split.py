"""What tests share with a training: ``python -m experiments.split --training chains --tests z1,z2``.

For every test, the share of its open rows whose meaning training meets, whether drawn or as what is left of a task:
``0/5`` is unseen. Beside the rows themselves, rows are also counted as met that are met under other names of
propositions.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from experiments.cli.errors import guarded
from t2tl_jax.errors import UserError, explained
from t2tl_jax.ltl import Formula, TaskFamily, is_family, resolve_tasks, row_languages, share, tasks_of
from t2tl_jax.ltl.benchmark_tasks import COLOURS
from t2tl_jax.ltl.split import DRAWS
from t2tl_jax.ltl.tasks import NAMED_TASKS
from t2tl_jax.quiet import quiet_imports
from t2tl_jax.runs.config import Task

PROG = "python -m experiments.split"


@dataclass(frozen=True)
class Arguments:
    """What to compare."""

    training: Task = "chains"
    """What is trained on: families or tasks, separated by commas. One family that is data can be given with its fields:
    --training chains --training.depth 1 3."""
    tests: Task = "z1,z2,z3,z4,z5,z6"
    """What is tested on, likewise."""
    propositions: str = ",".join(COLOURS)
    """Those of the environment, in its order, separated by commas."""
    alphabet: Literal["every_subset", "at_most_one"] = "at_most_one"
    """Which letters exist: every set of propositions, or at most one proposition at a time."""
    draws: int = DRAWS
    """The most tasks of a family that are looked at; larger families, and those that cannot list theirs, are drawn
    from."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0, or 2 for input that cannot be used."""
    return guarded(lambda: command(sys.argv[1:] if arguments is None else list(arguments)))


def command(arguments: list[str]) -> int:
    """What `main` runs.

    Raises:
        UserError: for input that cannot be used.
    """
    with quiet_imports():  # loading the environments takes seconds
        from experiments.cli.plugins import import_modules
        from experiments.cli.request import with_parts
        from t2tl_jax.flags import parse

    chosen, rest = with_parts(Arguments(), import_modules(arguments))
    with explained():
        print(table(parse(Arguments, rest, PROG, __doc__, default=chosen)))
    return 0


def table(arguments: Arguments) -> str:
    """Return what the command prints.

    Raises:
        LTLError: for a task or a family that does not fit.
    """
    if arguments.draws < 1:
        raise UserError(f"--draws must be at least 1, got {arguments.draws}")
    names = tuple(name.strip() for name in arguments.propositions.split(",") if name.strip())
    tests = _sets(arguments.tests, names, arguments.draws)
    lines = [["training", "rows", "counted as equal", *tests]]
    for training, tasks in _sets(arguments.training, names, arguments.draws).items():
        for renamed in (False, True):
            met, *asked = (
                row_languages(formulas, names, arguments.alphabet, renamed=renamed)
                for formulas in (tasks, *tests.values())
            )
            known = frozenset(met)
            shares = [str(share(rows, known)) for rows in asked]
            lines.append([training, str(len(known)), "up to renaming" if renamed else "by language", *shares])
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join("  ".join(f"{cell:{width}}" for cell, width in zip(line, widths, strict=True)) for line in lines)


def _sets(text: str | TaskFamily, names: Sequence[str], draws: int) -> dict[str, list[Formula]]:
    """The tasks that every part of a list stands for."""
    if isinstance(text, TaskFamily):
        return {str(text): tasks_of(text, names, draws)}
    words = [word.strip() for word in text.split(",") if word.strip()]
    if not words:
        raise UserError("give at least one task or family, such as z1 or chains")

    def tasks(word: str) -> list[Formula]:
        other = word.isalpha() and word not in (*names, *NAMED_TASKS)  # a misspelt family most likely
        return tasks_of(word, names, draws) if other or is_family(word, names) else list(resolve_tasks(word).values())

    return {word: tasks(word) for word in words}


if __name__ == "__main__":
    sys.exit(main())
