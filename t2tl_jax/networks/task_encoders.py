"""Task encoders: `TaskTable -> float32[rows, dim]`. The policy then reads `embedding[row]`.

An encoder maps the table, not the batch: every distinct formula is encoded once per gradient step, however many samples
of the batch are in that row. Learned and fixed representations are one program with another encoder.
"""

from typing import Literal, Protocol

import jax
import jax.numpy as jnp
from flax import linen as nn

from t2tl_jax.ltl import TaskTable
from t2tl_jax.networks.transformer import TokenTransformer, TransformerConfig


class TaskEncoder(Protocol):
    """What the actor-critic needs of a representation of tasks."""

    def __call__(self, table: TaskTable) -> jax.Array:
        """Encode every row of the table: float32[rows, dim]."""
        ...


class TransformerTaskEncoder(nn.Module):
    """The formula itself, read by a Transformer (T1TL, T2TL)."""

    config: TransformerConfig

    @nn.compact
    def __call__(self, table: TaskTable) -> jax.Array:
        """float32[rows, config.output], in (-1, 1)."""
        return TokenTransformer(self.config, table.vocabulary_size, name="transformer")(table.tokens, table.mask)


class OneHotTaskEncoder(nn.Module):
    """The state of the automaton as a unit vector (the DFA and reward-machine baselines); no parameters.

    Rows 0 and 1, true and false, have no state left to tell: they are all zeros, as in the published one-hot codes.
    """

    size: int

    def __call__(self, table: TaskTable) -> jax.Array:
        """float32[rows, size]; row 2 + k is the k-th unit vector."""
        states = table.num_rows - 2
        if states > self.size:
            raise ValueError(
                f"a one-hot code of size {self.size} cannot tell {states} states apart; "
                f"set network.one_hot_size to {states} or more"
            )
        return jnp.eye(table.num_rows, self.size, k=-2)


class EncoderChoice(Protocol):
    """The part of a network's configuration that chooses its task encoder."""

    @property
    def task_encoder(self) -> Literal["transformer", "one_hot"]: ...  # noqa: D102
    @property
    def transformer(self) -> TransformerConfig: ...  # noqa: D102
    @property
    def one_hot_size(self) -> int: ...  # noqa: D102


def make_task_encoder(config: EncoderChoice) -> nn.Module:
    """The module that `config.task_encoder` names."""
    if config.task_encoder == "transformer":
        return TransformerTaskEncoder(config.transformer)
    return OneHotTaskEncoder(config.one_hot_size)


def attention_weights(encoder: TransformerTaskEncoder, params: dict, table: TaskTable) -> jax.Array:
    """Attention of every layer and head: float32[layers, rows, heads, L, L], query then key (padding has weight 0)."""
    _, state = encoder.apply({"params": params}, table, mutable=["intermediates"])
    layers = state["intermediates"]["transformer"]["encoder"]
    return jnp.stack([layers[f"layer_{i}"]["attention"]["attention_weights"][0] for i in range(encoder.config.layers)])
