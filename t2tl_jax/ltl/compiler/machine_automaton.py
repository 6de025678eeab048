"""From reward machines to the automaton that all of them share, in plain NumPy."""

from collections.abc import Iterable, Sequence

import numpy as np

from t2tl_jax.ltl.compiler.alphabet import AT_MOST_ONE, EVERY_SUBSET, check_cells, check_names, letter_weights
from t2tl_jax.ltl.compiler.automaton import Automaton
from t2tl_jax.ltl.compiler.budget import MAX_ROWS
from t2tl_jax.ltl.errors import TooLargeError
from t2tl_jax.ltl.reward_machine import DONE, FAIL, STAY, RewardMachine, truth
from t2tl_jax.ltl.tokens import OPERATOR_ID


def build_machines(
    machines: RewardMachine | Iterable[RewardMachine],
    propositions: Sequence[str],
    alphabet: str = EVERY_SUBSET,
    *,
    max_rows: int = MAX_ROWS,
) -> Automaton:
    """Write reward machines out as one automaton; `compile_reward_machines` documents arguments, rows and errors."""
    tasks = [machines] if isinstance(machines, RewardMachine) else list(machines)
    for machine in tasks:
        machine.check_propositions(propositions)
    guards = [transition.guard for machine in tasks for transition in machine.transitions]
    names, used = check_names(guards, propositions, alphabet)
    first_row = [2]
    for machine in tasks:
        first_row.append(first_row[-1] + len(machine.states))
    num_rows = first_row.pop()
    if num_rows > max_rows:
        raise TooLargeError(f"the table needs {num_rows:,} rows; the limit is max_rows={max_rows:,}: raise it")
    check_cells(num_rows, len(used), alphabet)

    values = _values([names[index] for index in used], alphabet)
    letters = len(used) + 1 if alphabet == AT_MOST_ONE else 2 ** len(used)
    next_row = np.zeros((num_rows, letters), np.int32)
    next_row[1] = 1
    rewards = np.zeros((num_rows, letters), np.float32)
    for machine, first in zip(tasks, first_row, strict=True):
        _fill(machine, first, values, next_row, rewards)
    return Automaton(
        tokens=((OPERATOR_ID["True"],), (OPERATOR_ID["False"],), *[()] * (num_rows - 2)),
        next_row=next_row,
        verdict=np.array([1, -1] + [0] * (num_rows - 2), np.int8),
        initial_row=np.array(
            [first + machine.states.index(machine.start) for machine, first in zip(tasks, first_row, strict=True)],
            np.int32,
        ),
        letter_weights=letter_weights(len(names), used, alphabet),
        propositions=names,
        used=tuple(names[index] for index in used),
        alphabet=alphabet,
        states=(DONE, FAIL, *[f"{machine.name}.{state}" for machine in tasks for state in machine.states]),
        rewards=rewards,
    )


def _values(used: list[str], alphabet: str) -> dict[str, np.ndarray]:
    """Return per proposition bool `[letters]`: in which letters it is true."""
    if alphabet == AT_MOST_ONE:
        letters = np.arange(len(used) + 1)
        return {name: letters == j + 1 for j, name in enumerate(used)}
    letters = np.arange(2 ** len(used))
    return {name: (letters >> j & 1).astype(bool) for j, name in enumerate(used)}


def _fill(
    machine: RewardMachine, first: int, values: dict[str, np.ndarray], next_row: np.ndarray, rewards: np.ndarray
) -> None:
    """Write the rows of one machine, which begin at `first`, into `next_row` and `rewards`."""
    row_of = {DONE: 0, FAIL: 1} | {state: first + index for index, state in enumerate(machine.states)}
    for state in machine.states:
        row = row_of[state]
        left = np.ones(next_row.shape[1], bool)  # letters that no line has taken yet
        for transition in machine.lines_of(state):
            taken = left & truth(transition.guard, values)
            next_row[row, taken] = row_of[transition.target]
            rewards[row, taken] = transition.reward
            left &= ~taken
        next_row[row, left] = row if machine.otherwise == STAY else row_of[machine.otherwise]
        rewards[row, left] = machine.otherwise_reward
