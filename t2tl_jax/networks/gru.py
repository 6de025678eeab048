"""A recurrent network that reads the formula from left to right: the plainest reader of sequences, to compare with."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from flax import linen as nn

from t2tl_jax.ltl import TaskTable
from t2tl_jax.networks.initializers import unit_norm
from t2tl_jax.networks.task_encoder import TaskEncoderConfig


@dataclass(frozen=True)
class GRUConfig(TaskEncoderConfig):
    """Sizes of the recurrent network."""

    width: int = 64
    """Size of a token's vector and of the recurrent state."""
    output: int = 16
    """Size of the encoded task."""

    def __post_init__(self) -> None:
        if min(self.width, self.output) < 1:
            raise ValueError(f"sizes of the recurrent network must be at least 1, got {self}")

    @property
    def code_size(self) -> int:
        """Numbers in the code of a task."""
        return self.output


class GRUTaskEncoder(nn.Module):
    """The formula's tokens, read by a GRU; its state after the last real token is the code."""

    config: GRUConfig

    @nn.compact
    def __call__(self, table: TaskTable) -> jax.Array:
        """float32[rows, config.output], in (-1, 1)."""
        config = self.config
        embed = nn.Embed(
            table.vocabulary_size, config.width, embedding_init=nn.initializers.normal(1.0), name="word_embedding"
        )
        # Real tokens come first, so the state after as many steps as there are of them has seen no other.
        order = jnp.argsort(~table.mask, axis=-1, stable=True)
        tokens = jnp.take_along_axis(table.tokens, order, axis=-1)
        reader = nn.RNN(nn.GRUCell(config.width, name="cell"), return_carry=True)
        state, _ = reader(embed(tokens), seq_lengths=table.mask.sum(axis=-1))
        return jnp.tanh(nn.Dense(config.output, kernel_init=unit_norm(), name="output")(state))
