"""Two task encoders side by side: a code that is both codes."""

from dataclasses import dataclass, field

import jax
import jax.numpy as jnp
from flax import linen as nn

from t2tl_jax.ltl import TaskTable
from t2tl_jax.networks.lookahead import LookaheadConfig
from t2tl_jax.networks.task_encoder import TaskEncoderConfig
from t2tl_jax.networks.transformer import TransformerConfig
from t2tl_jax.registry import TASK_ENCODERS


@dataclass(frozen=True)
class JoinedConfig(TaskEncoderConfig):
    """Any two encoders."""

    first: TaskEncoderConfig = field(default_factory=LookaheadConfig)
    """Whose code comes first."""
    second: TaskEncoderConfig = field(default_factory=TransformerConfig)
    """Whose code comes second."""

    @property
    def learned(self) -> bool:  # type: ignore[override]
        """Whether one of them is."""
        return self.first.learned or self.second.learned

    @property
    def code_size(self) -> int:
        """Numbers of both."""
        return self.first.code_size + self.second.code_size

    @property
    def reads_padding(self) -> bool:
        """Whether one of them does."""
        return self.first.reads_padding or self.second.reads_padding

    @property
    def carries_over(self) -> bool:
        """Whether both do: a network can come to rely on either."""
        return self.first.carries_over and self.second.carries_over

    @property
    def rows_apart(self) -> bool:
        """Whether what has parameters can."""
        return self.learned and all(part.rows_apart or not part.learned for part in (self.first, self.second))

    @property
    def reads_tokens(self) -> bool:
        """Whether one of them does."""
        return self.first.reads_tokens or self.second.reads_tokens

    @property
    def reads_transitions(self) -> bool:
        """Whether one of them does."""
        return self.first.reads_transitions or self.second.reads_transitions

    def letters_told(self, table: TaskTable) -> jax.Array:
        """As the first of them that reads transitions."""
        return (self.first if self.first.reads_transitions else self.second).letters_told(table)

    @property
    def propositions_told(self) -> int | None:
        """As many as the first tells of, or else the second."""
        told = self.first.propositions_told
        return self.second.propositions_told if told is None else told

    def by_proposition(self, code: jax.Array) -> tuple[jax.Array, jax.Array]:
        """What one of them says, the first if it can; the other's code belongs to the rest."""
        first, second = code[..., : self.first.code_size], code[..., self.first.code_size :]
        speaks, of, other = self.first, first, second
        if self.first.propositions_told is None:
            speaks, of, other = self.second, second, first
        told, rest = speaks.by_proposition(of)
        return told, jnp.concatenate([rest, other], axis=-1)


class JoinedTaskEncoder(nn.Module):
    """The codes of two encoders, one behind the other."""

    config: JoinedConfig

    def setup(self) -> None:
        """Name the parts."""
        self.first = TASK_ENCODERS.maker(self.config.first)(self.config.first)
        self.second = TASK_ENCODERS.maker(self.config.second)(self.config.second)

    def __call__(self, table: TaskTable) -> jax.Array:
        """float32[rows, code_size]."""
        return jnp.concatenate([self.first(table), self.second(table)], axis=-1)

    def of_rows(self, table: TaskTable, rows: jax.Array, known: jax.Array | None = None) -> jax.Array:
        """See `RowEncoder`: a part without parameters stays as it was."""
        parts, before = [], 0
        for part, encoder in ((self.config.first, self.first), (self.config.second, self.second)):
            code = None if known is None else known[:, before : before + part.code_size]
            before += part.code_size
            if part.learned:
                code = encoder.of_rows(table, rows, code)
            parts.append(encoder(table)[rows] if code is None else code)
        return jnp.concatenate(parts, axis=-1)
