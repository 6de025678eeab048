"""Show what a task compiles to: `python -m t2tl_jax.ltl 'F(a & F b)' --word 'a; ; a,b'`."""

import os
import sys
import time
from dataclasses import dataclass
from typing import Annotated, Literal

import tyro

from t2tl_jax.errors import UserError
from t2tl_jax.flags import parse
from t2tl_jax.ltl.compiler.automaton import Automaton, build
from t2tl_jax.ltl.compiler.budget import Limits, way_out_alone
from t2tl_jax.ltl.compiler.machine_automaton import build_machines
from t2tl_jax.ltl.compiler.parts import check_entries, check_tokens, fitting_cuts, room_for
from t2tl_jax.ltl.compiler.states import EXACT
from t2tl_jax.ltl.describe import describe, describe_word, to_dot
from t2tl_jax.ltl.errors import LTLError
from t2tl_jax.ltl.families import check_name, is_family
from t2tl_jax.ltl.formula import Formula
from t2tl_jax.ltl.reward_machine import RewardMachine
from t2tl_jax.ltl.tasks import WATER_PROPOSITIONS, ZONE_PROPOSITIONS, resolve

MANY_ROWS = 200
"""Tables with more rows are described in short."""

FIRST_ROWS = 20
"""Of these so many rows are listed, if nothing else was asked for."""


@dataclass(frozen=True)
class Arguments:
    """Compile co-safe LTL tasks, or reward machines, and print the rows of their table, or Graphviz text."""

    formulas: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="FORMULA")]
    """Formulas (`!Red U (Black & F White)`) or names of the paper's tasks (`phi_water`); or reward machines, by name
    (`rm_t10`) or file (`*.rm`)."""
    word: str | None = None
    """Labels to step through, steps apart by `;`, propositions by `,`: `a; ; a,b`."""
    alphabet: Literal["every_subset", "at_most_one"] = "every_subset"
    """Which letters exist: every set of propositions, or at most one proposition at a time."""
    progression: Literal["exact", "paper"] = "exact"
    """The usual rules, or the paper's, which also drop a satisfied proposition."""
    propositions: str | None = None
    """The environment's propositions in its order, apart by `,`. By default those of the tasks."""
    dot: bool = False
    """Print the automaton as Graphviz text and nothing else."""
    show_rows: int | None = None
    """List so many rows, 0 for all; by default all of a table of up to 200, and the first 20 of a larger one."""
    max_rows: int = Limits.max_rows
    """Refuse tasks with more rows."""
    max_cells: int = Limits.max_cells
    """Refuse tasks whose table has more entries in the arrays that letters are looked up in, or in that of the tokens.
    """
    max_terms: int = Limits.max_terms
    """Refuse tasks of which something is left that is a disjunction of more terms."""
    max_tokens: int = Limits.max_tokens
    """Refuse tasks with longer rows."""
    max_work: int = Limits.max_work
    """Refuse tasks that take longer, in units of some 0.2 microseconds; 0 for what so many rows may take."""
    max_propositions: int = Limits.max_propositions
    """Refuse tasks that use more propositions."""


def main(argv: list[str] | None = None) -> int:
    """Run the command; return the exit code: 0, 2 for input that cannot be used, 130 after Ctrl-C."""
    texts = sys.argv[1:] if argv is None else argv
    try:
        arguments = parse(Arguments, texts, prog="python -m t2tl_jax.ltl", description=Arguments.__doc__)
        print(run(arguments), flush=True)
    except BrokenPipeError:  # the reader (`| head`) has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except UserError as error:
        print(f"error: {way_out_alone(str(error))}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:  # a large task takes its time
        print("\nstopped", file=sys.stderr)
        return 130
    return 0


def run(arguments: Arguments) -> str:
    """Return what the command prints."""
    if not arguments.formulas:
        raise LTLError("give at least one formula, for example 'F(a & F b)'")
    if arguments.show_rows is not None and arguments.show_rows < 0:
        raise LTLError(f"--show-rows takes a whole number from 0 on, got {arguments.show_rows}")
    begin = time.monotonic()
    resolved = [resolve(text) for text in arguments.formulas]
    for text, one in zip(arguments.formulas, resolved, strict=True):
        _refuse_family(text, one, _split(arguments.propositions or "", ","))
    formulas = [task for task in resolved if isinstance(task, Formula)]
    machines = [machine for task in resolved if not isinstance(task, Formula) for machine in task]
    if formulas and machines:
        raise LTLError("formulas and reward machines cannot share a table; give either")
    tasks: list[Formula] | list[RewardMachine] = formulas or machines
    names = _propositions(tasks) if arguments.propositions is None else tuple(_split(arguments.propositions, ","))
    limits = Limits(
        max_rows=arguments.max_rows,
        max_cells=arguments.max_cells,
        max_terms=arguments.max_terms,
        max_tokens=arguments.max_tokens,
        max_work=arguments.max_work,
        max_propositions=arguments.max_propositions,
    )
    if machines:
        if arguments.progression != EXACT:
            raise LTLError(f"progression is how formulas go on; leave it at {EXACT} for reward machines")
        automaton = build_machines(machines, names, arguments.alphabet, limits=limits)
    else:
        automaton = build(formulas, names, arguments.alphabet, limits=limits, progression=arguments.progression)
    _check_arrays(automaton, limits)
    if arguments.dot:
        return to_dot(automaton)
    text = _described(automaton, arguments.show_rows, time.monotonic() - begin)
    if arguments.word is not None:
        word = [set(_split(step, ",")) for step in arguments.word.split(";")]
        for number, task in enumerate(tasks):
            shown = task.name if isinstance(task, RewardMachine) else task
            text += f"\n\nword, task {number}: {shown}\n{describe_word(automaton, word, number)}"
    return text


def _refuse_family(text: str, task: Formula | tuple[RewardMachine, ...], propositions: list[str]) -> None:
    """Refuse the name of a family, maybe misspelt, which would be read as a proposition."""
    word = text.strip()
    if not (isinstance(task, Formula) and task.op == "prop" and is_family(word, propositions)):
        return
    way_out = f"\nFor a proposition of this name write '\"{word}\"'."
    try:
        check_name(word)
    except LTLError as error:
        raise LTLError(f"{error}{way_out}") from None
    raise LTLError(
        f"{word} is a family of random tasks, and this command shows given ones; `sample` draws one{way_out}"
    )


def _check_arrays(automaton: Automaton, limits: Limits) -> None:
    """Refuse what `compile_tasks` would refuse as a table."""
    cuts = fitting_cuts(automaton.steps)
    check_entries(cuts, room_for(automaton.steps, cuts), automaton.alphabet, limits)
    check_tokens(len(automaton.tokens), max(len(tokens) for tokens in automaton.tokens), limits)


def _described(automaton: Automaton, asked: int | None, seconds: float) -> str:
    """All of a small table; of a large one, the first rows and what there is to know of all."""
    rows = len(automaton.verdict)
    most = asked if asked is not None else FIRST_ROWS if rows > MANY_ROWS else rows
    if most == 0 or most >= rows:
        return describe(automaton)
    longest = max(len(tokens) for tokens in automaton.tokens)
    return (
        f"{describe(automaton, most)}\n\n... and {rows - most:,} more rows, not listed: --show-rows NUMBER for more, "
        f"--show-rows 0 for all of them, with every transition\n"
        f"compiled in {seconds:.1f} s; the longest row has {longest:,} tokens"
    )


def _propositions(tasks: list[Formula] | list[RewardMachine]) -> tuple[str, ...]:
    """Return the paper's order where all propositions are one environment's, else alphabetical order."""
    used = {name for task in tasks for name in task.propositions()}
    for known in (ZONE_PROPOSITIONS, WATER_PROPOSITIONS):
        if used and used <= set(known):
            return known
    return tuple(sorted(used))


def _split(text: str, separator: str) -> list[str]:
    return [part.strip() for part in text.split(separator) if part.strip()]


if __name__ == "__main__":
    raise SystemExit(main())
