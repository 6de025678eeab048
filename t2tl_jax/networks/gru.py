"""A recurrent network that reads from left to right: the plainest reader of formulas and windows, to compare with."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from flax import linen as nn

from t2tl_jax.ltl import TaskTable
from t2tl_jax.networks.initializers import unit_norm
from t2tl_jax.networks.task_encoder import ReadsTokens, SequenceEncoderConfig


@dataclass(frozen=True)
class GRUConfig(SequenceEncoderConfig):
    """Sizes of the recurrent network."""

    width: int = 64
    """Size of a token's vector and of the recurrent state."""
    output: int = 16
    """Size of the encoded task."""

    def __post_init__(self) -> None:
        if min(self.width, self.output) < 1:
            raise ValueError(f"sizes of the recurrent network must be at least 1, got {self}")

    @property
    def rows_apart(self) -> bool:
        """A row is its tokens."""
        return True


def last_state(cell: nn.GRUCell, tokens: jax.Array, mask: jax.Array) -> jax.Array:
    """The state after the last real token, [B, width]: tokens [B, L, width], mask bool[B, L] (True = a real token).

    Over padding the state stands still, be it before or behind the tokens; of no token at all it is 0.
    """

    def step(cell: nn.GRUCell, state: jax.Array, token: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, tuple[()]]:
        x, real = token
        return jnp.where(real[:, None], cell(state, x)[0], state), ()

    scan = nn.scan(step, variable_broadcast="params", split_rngs={"params": False}, in_axes=1)
    state, _ = scan(cell, jnp.zeros((len(tokens), cell.features), tokens.dtype), (tokens, mask))
    return state


class GRUTaskEncoder(ReadsTokens, nn.Module):
    """The formula's tokens, read by a GRU; its state after the last real token is the code."""

    config: GRUConfig

    @nn.compact
    def __call__(self, table: TaskTable) -> jax.Array:
        """float32[rows, config.output], in (-1, 1)."""
        config = self.config
        embed = nn.Embed(
            table.vocabulary_size, config.width, embedding_init=nn.initializers.normal(1.0), name="word_embedding"
        )
        state = last_state(nn.GRUCell(config.width, name="cell"), embed(table.tokens), table.mask)
        return jnp.tanh(nn.Dense(config.output, kernel_init=unit_norm(), name="output")(state))


class GRUWindowReader(nn.Module):
    """The same over the tokens of a context window, oldest first."""

    config: GRUConfig

    @nn.compact
    def __call__(self, x: jax.Array, mask: jax.Array) -> jax.Array:
        """x [B, K, width], mask bool[B, K] (True = a step of the episode) -> [B, output] in (-1, 1)."""
        state = last_state(nn.GRUCell(self.config.width, name="cell"), x, mask)
        return jnp.tanh(nn.Dense(self.config.output, kernel_init=unit_norm(), name="output")(state))
