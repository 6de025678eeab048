"""Show what a task compiles to: `python -m t2tl_jax.ltl 'F(a & F b)' --word 'a; ; a,b'`."""

import os
import sys
from dataclasses import dataclass
from typing import Annotated, Literal

import tyro

from t2tl_jax.ltl.automaton import build
from t2tl_jax.ltl.budget import MAX_ROWS
from t2tl_jax.ltl.describe import describe, describe_word, to_dot
from t2tl_jax.ltl.errors import LTLError
from t2tl_jax.ltl.formula import Formula
from t2tl_jax.ltl.tasks import WATER_PROPOSITIONS, ZONE_PROPOSITIONS, resolve_task


@dataclass(frozen=True)
class Arguments:
    """Compile co-safe LTL tasks and print the rows of their table, or the automaton as Graphviz text."""

    formulas: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="FORMULA")]
    """Formulas (`!Red U (Black & F White)`) or names of the paper's tasks (`phi_water`)."""
    word: str | None = None
    """Labels to step through, steps apart by `;`, propositions by `,`: `a; ; a,b`."""
    alphabet: Literal["every_subset", "at_most_one"] = "every_subset"
    """Which letters exist: every set of propositions, or at most one proposition at a time."""
    propositions: str | None = None
    """The environment's propositions in its order, apart by `,`. By default those of the formulas."""
    dot: bool = False
    """Print the automaton as Graphviz text and nothing else."""
    max_rows: int = MAX_ROWS
    """Refuse tasks with more rows."""


def main(argv: list[str] | None = None) -> int:
    """Run the command; return the exit code: 0, or 2 for a formula or word that cannot be used."""
    arguments = tyro.cli(Arguments, args=argv, prog="python -m t2tl_jax.ltl", description=Arguments.__doc__)
    try:
        print(run(arguments), flush=True)
    except BrokenPipeError:  # the reader (`| head`) has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except LTLError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


def run(arguments: Arguments) -> str:
    """Return what the command prints."""
    if not arguments.formulas:
        raise LTLError("give at least one formula, for example 'F(a & F b)'")
    formulas = [resolve_task(text) for text in arguments.formulas]
    names = _propositions(formulas) if arguments.propositions is None else tuple(_split(arguments.propositions, ","))
    automaton = build(formulas, names, arguments.alphabet, max_rows=arguments.max_rows)
    if arguments.dot:
        return to_dot(automaton)
    text = describe(automaton)
    if arguments.word is not None:
        word = [set(_split(step, ",")) for step in arguments.word.split(";")]
        for task, formula in enumerate(formulas):
            text += f"\n\nword, task {task}: {formula}\n{describe_word(automaton, word, task)}"
    return text


def _propositions(formulas: list[Formula]) -> tuple[str, ...]:
    """Return the paper's order where all propositions are one environment's, else alphabetical order."""
    used = {name for formula in formulas for name in formula.propositions()}
    for known in (ZONE_PROPOSITIONS, WATER_PROPOSITIONS):
        if used and used <= set(known):
            return known
    return tuple(sorted(used))


def _split(text: str, separator: str) -> list[str]:
    return [part.strip() for part in text.split(separator) if part.strip()]


if __name__ == "__main__":
    raise SystemExit(main())
