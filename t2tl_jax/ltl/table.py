"""The task table: tasks as arrays, so that a task state is one row number and progression is a gather or two."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import flax.struct
import jax
import jax.numpy as jnp
import numpy as np

from t2tl_jax.ltl import lookup
from t2tl_jax.ltl import tokens as vocabulary
from t2tl_jax.ltl.compiler.alphabet import AT_MOST_ONE
from t2tl_jax.ltl.compiler.automaton import Automaton, build, stride
from t2tl_jax.ltl.compiler.budget import Limits
from t2tl_jax.ltl.compiler.machine_automaton import build_machines
from t2tl_jax.ltl.compiler.parts import check_entries, check_tokens, fitting_cuts, read, room_for, written
from t2tl_jax.ltl.compiler.states import EXACT
from t2tl_jax.ltl.errors import LTLError, TooLargeError, no_formulas
from t2tl_jax.ltl.formula import Formula
from t2tl_jax.ltl.reward_machine import RewardMachine
from t2tl_jax.ltl.tasks import resolve


@flax.struct.dataclass
class TaskTable:
    """Every formula that progression can reach from a set of tasks, one row each; or every state of reward machines.

    Rows of formulas are classes with the same meaning; each shows its shortest formula. Row 0 is true, row 1 is false.
    Only names are static: two tables of equal shapes over the same propositions share one compiled program.

    Attributes:
        tokens: int32 `[rows, length]`, token ids in prefix order, padded with 0 on the right; all padding for the open
            rows of reward machines.
        mask: bool `[rows, length]`, True at tokens, False at padding.
        branches: where letters lead. Letters over few propositions are looked up at once, in one array int32
            `[letters, rows]`. Those over many are read in parts, the highest propositions first, each in an array
            `[values of the part, nodes]`; the nodes of the first are the rows. An entry below `num_outcomes` is the
            outcome, whatever the other parts are; any other one, less that number, is a node of the next array.
        verdict: int8 `[rows]`, +1 when every continuation satisfies the row, -1 when none does, 0 while open.
        initial_row: int32 `[tasks]`, the row in which each task starts.
        letter_weights: int32 `[P]`, how labels become letters; 0 for propositions that no formula uses.
        propositions: the environment's propositions, in its order (static).
        alphabet: "every_subset" or "at_most_one" (static).
        pays: float32 `[rewards]`, what the transitions of reward machines pay; None where the verdict is the reward.
            An outcome is a row; for reward machines it is the row `outcome % stride` with `pays[outcome // stride]`.
        states: names of the rows of reward machines, empty for formulas (static).
        starts: bool `[rows]`, the open rows in which an episode may begin; None for all of them.
    """

    tokens: jax.Array
    mask: jax.Array
    branches: tuple[jax.Array, ...]
    verdict: jax.Array
    initial_row: jax.Array
    letter_weights: jax.Array
    propositions: tuple[str, ...] = flax.struct.field(pytree_node=False)
    alphabet: str = flax.struct.field(pytree_node=False)
    pays: jax.Array | None = None
    states: tuple[str, ...] = flax.struct.field(pytree_node=False, default=())
    starts: jax.Array | None = None

    # ----- inside jit -----

    def letter(self, labels: jax.Array) -> jax.Array:
        """Return the letter of each label vector.

        With "at_most_one", a vector with several true propositions gets the letter of the last of them, in the
        environment's order, that the formulas use.

        Args:
            labels: bool `[..., P]`, which of the environment's propositions are true.

        Returns:
            int32 `[...]`; with "every_subset" the bit set of the true ones among those that the formulas use.
        """
        weights = jnp.where(jnp.asarray(labels, bool), self.letter_weights, 0)
        letter = weights.max(-1, initial=0) if self.alphabet == AT_MOST_ONE else weights.sum(-1)
        return letter.astype(jnp.int32)

    def progress(self, row: jax.Array, letter: jax.Array) -> jax.Array:
        """Return the rows int32 `[...]` that follow `row` after `letter` (both int32 `[...]`)."""
        return self._row_of(lookup.outcome(self.branches, self.num_outcomes, row, letter))

    def reward(self, row: jax.Array) -> jax.Array:
        """Return float32 `[...]`: +1 for a true row, -1 for a false one, 0 while the task is open.

        Raises:
            LTLError: for reward machines, which pay by transition; see `step`.
        """
        if self.pays is not None:
            raise LTLError("reward machines pay by transition, not by row: use step(row, letter)")
        return self.verdict[row].astype(jnp.float32)

    def step(self, row: jax.Array, letter: jax.Array) -> tuple[jax.Array, jax.Array]:
        """Return the rows that follow `row` after `letter`, and the rewards: `progress` and what that pays.

        Args:
            row: int32 `[...]`.
            letter: int32 `[...]`.

        Returns:
            int32 `[...]` and float32 `[...]`.
        """
        return self.meaning(lookup.outcome(self.branches, self.num_outcomes, row, letter))

    def step_all(self, letter: jax.Array) -> tuple[jax.Array, jax.Array]:
        """Return what `step` gives from every row: one transition seen by all tasks and sub-tasks at once.

        Only the rows that `is_open` marks are tasks that were still to do; mask the others.

        Args:
            letter: int32 `[...]`.

        Returns:
            int32 `[rows, ...]` and float32 `[rows, ...]`, row k for the task state k.
        """
        if self.pays is not None and len(self.branches) == 1:
            # To look up what outcomes mean costs more for every letter of a batch than for every letter that there is.
            row, reward = (jnp.moveaxis(meaning[letter], -1, 0) for meaning in self.meaning(self.branches[0]))
            return row, reward
        return self.meaning(lookup.outcome_in_all(self.branches, self.num_outcomes, letter))

    def _row_of(self, outcome: jax.Array) -> jax.Array:
        return outcome if self.pays is None else outcome & (self.stride - 1)

    def meaning(self, outcome: jax.Array) -> tuple[jax.Array, jax.Array]:
        """Return the rows int32 `[...]` of outcomes (int32 `[...]`), and what reaching them pays, float32 `[...]`."""
        row = self._row_of(outcome)
        if self.pays is None:
            return row, self.reward(row)
        return row, self.pays[outcome >> self.stride.bit_length() - 1]

    @property
    def is_open(self) -> jax.Array:
        """Rows that are neither true nor false: bool `[rows]`."""
        return self.verdict == 0

    # ----- on the host -----

    @property
    def num_rows(self) -> int:
        """Rows of the table, true and false included."""
        return self.tokens.shape[-2]

    @property
    def num_tasks(self) -> int:
        """Tasks that start in this table."""
        return self.initial_row.shape[-1]

    @property
    def num_outcomes(self) -> int:
        """What a letter can lead to: the rows, or of reward machines the rows with each of the rewards, see `pays`."""
        return self.num_rows if self.pays is None else self.stride * self.pays.shape[-1]

    @property
    def stride(self) -> int:
        """See `pays`."""
        return stride(self.num_rows)

    @property
    def num_letters(self) -> int:
        """How many letters there are."""
        return math.prod(branch.shape[-2] for branch in self.branches)

    @property
    def next_row(self) -> jax.Array:
        """The row that each letter leads to, for a look at it: int32 `[rows, letters]`.

        Raises:
            TooLargeError: for letters that are read in parts; see `progress` and `step_all`.
        """
        return self._row_of(self._at_once())

    @property
    def transition_reward(self) -> jax.Array | None:
        """What each letter pays in reward machines: float32 `[rows, letters]`; None for formulas. Raises as
        `next_row`."""
        return None if self.pays is None else self.pays[self._at_once() // self.stride]

    def _at_once(self) -> jax.Array:
        if len(self.branches) > 1:
            raise TooLargeError(
                f"{self.num_rows:,} rows of {self.num_letters:,} letters are not kept as one array; look letters up "
                "with progress(row, letter) or step_all(letter)"
            )
        return jnp.swapaxes(self.branches[0], -1, -2)

    @property
    def vocabulary_size(self) -> int:
        """Rows that an embedding of the tokens needs; depends on the environment's propositions only.

        Raises:
            LTLError: for reward machines, whose rows have no tokens: every encoder that reads tokens stops here.
        """
        if self.states:
            raise no_formulas()
        return vocabulary.vocabulary_size(len(self.propositions))

    def formula(self, row: int) -> Formula:
        """Return the formula that a row shows (not inside jit).

        Raises:
            LTLError: for reward machines; see `text`.
        """
        if self.states:
            raise no_formulas()
        return vocabulary.decode(np.asarray(self.tokens[row]).tolist(), self.propositions)

    def text(self, row: int) -> str:
        """Return what a row shows, as text: its formula, or the name of its state (not inside jit)."""
        return self.states[row] if self.states else str(self.formula(row))

    def automaton(self) -> Automaton:
        """Return the same content as NumPy arrays, without padding (not inside jit)."""
        rows = [tuple(t for t in row if t != vocabulary.PADDING) for row in np.asarray(self.tokens).tolist()]
        weights = np.asarray(self.letter_weights)
        return Automaton(
            tokens=tuple(rows),
            steps=read([np.asarray(branch) for branch in self.branches], self.num_outcomes, self.alphabet),
            verdict=np.asarray(self.verdict),
            initial_row=np.asarray(self.initial_row),
            letter_weights=weights,
            propositions=self.propositions,
            used=tuple(name for name, weight in zip(self.propositions, weights, strict=True) if weight),
            alphabet=self.alphabet,
            states=self.states,
            pays=None if self.pays is None else np.asarray(self.pays),
        )

    def describe(self) -> str:
        """Return a readable listing: each row's formula or state, verdict, and transitions (not inside jit)."""
        from t2tl_jax.ltl.describe import describe  # only a person waits for it

        return describe(self.automaton())


def compile_tasks(
    formulas: str | Formula | Iterable[str | Formula],
    propositions: Sequence[str],
    alphabet: str = "every_subset",
    *,
    length: int | None = None,
    max_rows: int | None = None,
    limits: Limits | None = None,
    progression: str = EXACT,
) -> TaskTable:
    """Compile co-safe LTL tasks to a table, on the host.

    Args:
        formulas: one or more formulas, as text or parsed. Rows are shared between tasks.
        propositions: the environment's propositions, in its order; they fix the token ids and the order of labels.
        alphabet: "every_subset" (2^n letters for n used propositions) or "at_most_one" (n + 1 letters; for
            environments where at most one proposition is true at each step).
        length: tokens per row; by default those of the longest row.
        max_rows: refuse tasks with more rows than this; by default those of `limits`.
        limits: how large the table may become.
        progression: "exact", the usual rules, by which verdicts are those of the formulas as written; or "paper", which
            adds the last case of the paper's definition 2: a satisfied proposition is dropped. Of the 9 tokens of
            `phi_zone_prime` it leaves 4 after Black, `!Yellow U White`, where the usual rules keep the whole task
            beside that as a second chance (14). It contradicts the paper's theorem 1: Black, Yellow, Black, White
            satisfies `phi_zone_prime`, and is judged false at Yellow. Of `phi_zone`, `phi_safe` and `phi_water`, whose
            goals all have the same guard, both make the same table.

    Raises:
        LTLSyntaxError, NotCoSafeError, UnknownPropositionError: as the formulas deserve.
        TooLargeError: too many rows, letters or nodes, or a row that does not fit into `length`.
    """
    limits = _limits(limits, max_rows)
    automaton = build(formulas, propositions, alphabet, limits=limits, progression=progression)
    return _to_table(automaton, length, limits)


def compile_reward_machines(
    machines: RewardMachine | Iterable[RewardMachine],
    propositions: Sequence[str],
    alphabet: str = "every_subset",
    *,
    length: int | None = None,
    max_rows: int | None = None,
    limits: Limits | None = None,
) -> TaskTable:
    """Compile reward machines to one table, on the host.

    Row 0 is `done`, row 1 is `fail`; the states follow, machine by machine, each machine's in its own order. Nothing is
    merged, so an open row minus 2 is the index of (machine, state) in the published one-hot code. The verdict tells
    success from failure whatever the machines pay.

    Args:
        machines: one or more machines.
        propositions: the environment's propositions, in its order.
        alphabet: as in `compile_tasks`.
        length: columns of `tokens`, which hold nothing here.
        max_rows, limits: as in `compile_tasks`.

    Raises:
        UnknownPropositionError: for a guard over other propositions.
        TooLargeError: too many rows or letters.
    """
    limits = _limits(limits, max_rows)
    return _to_table(build_machines(machines, propositions, alphabet, limits=limits), length, limits)


def compile_named(
    text: str,
    propositions: Sequence[str],
    alphabet: str = "every_subset",
    *,
    length: int | None = None,
    limits: Limits | None = None,
    progression: str = EXACT,
) -> TaskTable:
    """Compile a task as a configuration names it.

    Args:
        text: a formula, the name of a formula (`phi_water`) or of reward machines (`rm_t10`, `rm_water`), or the path
            of a reward machine's file (`*.rm`).
        propositions: as in `compile_tasks`.
        alphabet: as in `compile_tasks`.
        length, limits: as in `compile_tasks`.
        progression: as in `compile_tasks`; of reward machines, which progress nothing, only "exact".

    Raises:
        UnknownTaskError: an unknown name (with the nearest), or a file that cannot be read.
        LTLError: anything else that is wrong with the task.
    """
    task = resolve(text)
    if isinstance(task, Formula):
        return compile_tasks(task, propositions, alphabet, length=length, limits=limits, progression=progression)
    if progression != EXACT:
        raise LTLError(f"progression is how formulas go on, and {text} is a reward machine; leave it at {EXACT}")
    return compile_reward_machines(task, propositions, alphabet, length=length, limits=limits)


def _limits(limits: Limits | None, max_rows: int | None) -> Limits:
    limits = Limits() if limits is None else limits
    if not isinstance(limits, Limits):
        raise LTLError(f"limits are Limits(...), got {limits!r:.100}")
    return limits if max_rows is None else replace(limits, max_rows=max_rows)


def _to_table(automaton: Automaton, length: int | None, limits: Limits) -> TaskTable:
    """Pad the tokens to `length` and put the arrays on the device."""
    if length is not None and not isinstance(length, int | np.integer):
        raise LTLError(f"length is a whole number of tokens, got {length!r:.100}")
    cuts = fitting_cuts(automaton.steps)
    check_entries(cuts, room_for(automaton.steps, cuts), automaton.alphabet, limits)
    longest = max(len(row) for row in automaton.tokens)
    if length is None:
        length = longest
    elif length < longest:
        raise TooLargeError(
            f"the longest row has {longest} tokens and does not fit into length={length}: give {longest} or more, or "
            f"none (of a run --task-length {longest}, or 0)"
        )
    check_tokens(len(automaton.tokens), length, limits)
    tokens = np.zeros((len(automaton.tokens), length), np.int32)
    for index, row in enumerate(automaton.tokens):
        tokens[index, : len(row)] = row
    arrays: dict[str, Any] = {
        "tokens": tokens,
        "mask": tokens != vocabulary.PADDING,
        "branches": written(automaton.steps, cuts),
        "verdict": automaton.verdict,
        "initial_row": automaton.initial_row,
        "letter_weights": automaton.letter_weights,
    }
    if automaton.pays is not None:
        arrays["pays"] = automaton.pays
    return TaskTable(
        **jax.device_put(arrays),
        propositions=automaton.propositions,
        alphabet=automaton.alphabet,
        states=automaton.states,
    )
