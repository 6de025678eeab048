"""Automata as text for people: a listing, the verdicts along a word, and Graphviz source."""

from collections.abc import Collection, Sequence

from t2tl_jax.ltl.compiler.automaton import Automaton
from t2tl_jax.ltl.compiler.cubes import guard
from t2tl_jax.ltl.errors import TooLargeError

MOST_DRAWN = 4096
"""Most rows of a picture; Graphviz draws no more in a time that anybody waits."""

FEW_TARGETS = 20
"""Most rows after one whose transitions are listed where a table is described in short."""

_VERDICT = {1: "true", -1: "false", 0: "open"}


def describe(automaton: Automaton, most: int | None = None) -> str:
    """Return a listing of rows (verdict, formula and tokens, or state) with their transitions; rows in which nothing
    can change (true and false) list none.

    Args:
        automaton: what to describe.
        most: how many rows to list, the first ones; of a table with more, only transitions from rows that lead to few
            others. None for all of it.
    """
    rows, letters = len(automaton.verdict), automaton.steps.num_letters
    tasks = len(automaton.initial_row)
    lines = [
        f"{rows:,} rows, {tasks:,} task{'s' * (tasks != 1)}, {letters:,} letters "
        f"({automaton.alphabet} of {', '.join(automaton.used) or 'no propositions'})"
    ]
    starts = automaton.initial_row.tolist()
    listed = rows if most is None else min(rows, most)
    for row in range(listed):
        begins = [str(task) for task, start in enumerate(starts) if start == row]
        mark = f"   <- task {', '.join(begins)}" if begins else ""
        lines.append(f"\nrow {row} [{_VERDICT[int(automaton.verdict[row])]}]{mark}")
        if automaton.states:
            lines.append(f"  state    {automaton.text(row)}")
        else:
            lines.append(f"  formula  {automaton.text(row)}")
            lines.append(f"  tokens   {len(automaton.tokens[row])}: {' '.join(map(str, automaton.tokens[row]))}")
        if listed < rows and automaton.steps.reaches_more_than(row, FEW_TARGETS):
            lines.append(f"  -> more than {FEW_TARGETS} {'rows' if automaton.pays is None else 'rows or rewards'}")
        elif automaton.verdict[row] == 0:
            lines += [f"  -> {target:<4d}  {condition}" for target, condition in transitions(automaton, row)]
    return "\n".join(lines)


def successors(automaton: Automaton, row: int) -> list[int]:
    """Return the rows that some letter leads to, the row itself first."""
    targets = {outcome % automaton.stride for outcome in automaton.steps.outcomes_of(row)}
    return sorted(targets, key=lambda target: (target != row, target))


def transitions(automaton: Automaton, row: int) -> list[tuple[int, str]]:
    """Return the rows that some letter leads to and when; for reward machines, one entry per reward (`guard / 1`)."""
    found, stride = [], automaton.stride
    for target in successors(automaton, row):
        outcomes = [outcome for outcome in automaton.steps.outcomes_of(row) if outcome % stride == target]
        if automaton.pays is None:
            found.append((target, guard(automaton, row, outcomes)))
            continue
        for reward, outcome in sorted((float(automaton.pays[outcome // stride]), outcome) for outcome in outcomes):
            pays = f" / {reward:g}" if reward else ""
            found.append((target, guard(automaton, row, [outcome]) + pays))
    return found


def describe_word(automaton: Automaton, word: Sequence[Collection[str]], task: int = 0) -> str:
    """Return one line per step of a word: the label, the verdict after it, and the formula that remains.

    Raises:
        UnknownPropositionError: for a label with a proposition that the environment does not have.
    """
    row = int(automaton.initial_row[task])
    lines = [f"{'start':<20}  {_VERDICT[int(automaton.verdict[row])]:<5}  row {row}: {automaton.text(row)}"]
    for step, label in enumerate(word, 1):
        row, _ = automaton.follow(row, automaton.letter(label))
        shown = f"{step} {{{', '.join(sorted(label))}}}"
        lines.append(f"{shown:<20}  {_VERDICT[int(automaton.verdict[row])]:<5}  row {row}: {automaton.text(row)}")
    return "\n".join(lines)


def to_dot(automaton: Automaton) -> str:
    """Return the reachable part of the automaton as Graphviz text.

    Raises:
        TooLargeError: for so many rows that nothing draws them.
    """
    if (rows := len(automaton.verdict)) > MOST_DRAWN:
        raise TooLargeError(f"{rows:,} rows cannot be drawn, {MOST_DRAWN:,} at most; a listing needs no picture")
    lines = ["digraph tasks {", "  rankdir=LR;", '  node [shape=box, style=rounded, fontname="monospace"];']
    reached = list(dict.fromkeys(automaton.initial_row.tolist()))
    for row in reached:
        reached += [target for target in successors(automaton, row) if target not in reached]
    for row in sorted(reached):
        verdict = int(automaton.verdict[row])
        style = {1: ', peripheries=2, color="darkgreen"', -1: ', color="firebrick"', 0: ""}[verdict]
        lines.append(f"  {row} [label={_quoted(f'{row}: {automaton.text(row)}')}{style}];")
    for task, start in enumerate(automaton.initial_row.tolist()):
        lines += [f'  task{task} [shape=plaintext, label="task {task}"];', f"  task{task} -> {start};"]
    for row in sorted(reached):
        for target, condition in transitions(automaton, row):
            lines.append(f"  {row} -> {target} [label={_quoted(condition)}];")
    return "\n".join([*lines, "}"])


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
