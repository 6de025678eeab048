"""What a representation of tasks offers: a module from the task table to one vector a row, and its configuration.

An encoder maps the table, not the batch: the policy reads `embedding[row]`, so every distinct formula is encoded once
per gradient step, however many samples of the batch are in that row. Learned and fixed representations are one program
with another encoder.
"""

from dataclasses import dataclass, replace
from typing import ClassVar, Protocol

import jax
import jax.numpy as jnp

from t2tl_jax.ltl import TaskTable


@dataclass(frozen=True)
class TaskEncoderConfig:
    """Base class of every task encoder's configuration; `register_task_encoder` joins it to the module that it makes.

    A subclass has a field or property `code_size`, the numbers in the code of a task.
    """

    learned: ClassVar[bool] = True
    """Whether the encoder reads formulas with parameters of its own, which can be pre-trained and carry over to tasks
    that were not seen before. Codes that are not learned have length 1."""

    @property
    def carries_over(self) -> bool:
        """Whether the code of a row says what the row means, so that tasks make sense that were not seen before."""
        return self.learned

    @property
    def reads_tokens(self) -> bool:
        """Whether the code is made of the formula's tokens, each of which can be left out to see what it is for."""
        return self.learned

    @property
    def reads_transitions(self) -> bool:
        """Whether the code is made of the table's transitions, so that rows of the same text may differ in it."""
        return False

    def letters_told(self, table: TaskTable) -> jax.Array:
        """Of one that reads transitions: the letters that its code tells apart, int32[letters]; by default each
        proposition by itself."""
        return table.letter(jnp.eye(len(table.propositions), dtype=bool))

    @property
    def rows_apart(self) -> bool:
        """Whether the module can encode some rows without the others: whether it is a `RowEncoder`. Of a large table
        only the rows that a minibatch holds are then encoded."""
        return False

    @property
    def code_size(self) -> int:
        """Numbers in the code of a task."""
        raise NotImplementedError

    @property
    def propositions_told(self) -> int | None:
        """Of how many propositions the code speaks, of each by itself; None for one that does not."""
        return None

    def by_proposition(self, code: jax.Array) -> tuple[jax.Array, jax.Array]:
        """What codes [..., dim] say of each proposition, [..., propositions_told, K], and what else, [..., rest]."""
        raise NotImplementedError

    @property
    def reads_padding(self) -> bool:
        """Whether the code of a formula depends on how much padding stands behind it."""
        return False


@dataclass(frozen=True)
class SequenceEncoderConfig(TaskEncoderConfig):
    """Base class of those that read a sequence of vectors: a formula's tokens, or the tokens of a context window.

    A subclass has fields `width` and `output`.
    """

    @property
    def width(self) -> int:
        """Size of a token's vector."""
        raise NotImplementedError

    @property
    def output(self) -> int:
        """Size of the code."""
        raise NotImplementedError

    @property
    def code_size(self) -> int:
        """Numbers in the code."""
        return self.output


class TaskEncoder(Protocol):
    """What the networks need of a representation of tasks."""

    def __call__(self, table: TaskTable) -> jax.Array:
        """Encode every row of the table: float32[rows, code_size].

        What `table.mask` leaves out is not read, also in the middle of a formula: so one sees what a token is for.
        """
        ...


class RowEncoder(TaskEncoder, Protocol):
    """What else is needed of one whose configuration says `rows_apart`."""

    def of_rows(self, table: TaskTable, rows: jax.Array, known: jax.Array | None = None) -> jax.Array:
        """Encode some rows of the table, as a call encodes all: float32[k, code_size].

        Args:
            table: the whole table.
            rows: int32[k].
            known: float32[k, code_size], the codes that these rows had with earlier parameters, if there are any; what
                does not depend on parameters can be taken from there.
        """
        ...


class ReadsTokens:
    """A `RowEncoder` of modules that read the tokens of a row with their mask, and nothing else of the table."""

    def of_rows(self, table: TaskTable, rows: jax.Array, known: jax.Array | None = None) -> jax.Array:
        """See `RowEncoder`."""
        del known
        return self(replace(table, tokens=table.tokens[rows], mask=table.mask[rows]))  # type: ignore[operator]
