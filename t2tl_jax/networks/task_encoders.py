"""Task encoders: `TaskTable -> float32[rows, dim]`. The policy then reads `embedding[row]`.

An encoder maps the table, not the batch: every distinct formula is encoded once per gradient step, however many samples
of the batch are in that row. Learned and fixed representations are one program with another encoder.
"""

from dataclasses import dataclass, field
from typing import Literal, Protocol

import jax
import jax.numpy as jnp
from flax import linen as nn

from t2tl_jax.ltl import TaskTable
from t2tl_jax.networks.gru import GRUConfig, GRUTaskEncoder
from t2tl_jax.networks.rgcn import RGCNConfig, RGCNTaskEncoder
from t2tl_jax.networks.transformer import TokenTransformer, TransformerConfig


@dataclass(frozen=True)
class TaskEncoderConfig:
    """The part of a network's configuration that chooses its task encoder."""

    task_encoder: Literal["transformer", "one_hot", "rgcn", "gru"] = "transformer"
    """How a task becomes numbers: its formula read by a Transformer (T1TL), a graph network or a recurrent one, or the
    state of its automaton or reward machine as a unit vector (DFA, RM)."""
    transformer: TransformerConfig = field(default_factory=TransformerConfig)
    """The formula's Transformer."""
    rgcn: RGCNConfig = field(default_factory=RGCNConfig)
    """The formula's graph network."""
    gru: GRUConfig = field(default_factory=GRUConfig)
    """The formula's recurrent network."""
    one_hot_size: int = 16
    """Width of the one-hot code, at least the number of open rows; 1 gives the state's number instead (DFA_1)."""
    freeze_task_encoder: bool = False
    """Keep the task encoder as it is, for one that was pre-trained."""

    def __post_init__(self) -> None:
        if self.one_hot_size < 1:
            raise ValueError(f"one_hot_size must be at least 1, got {self.one_hot_size}")


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
    Size 1 is the published baseline DFA_1, one number for the state: row 2 + k, the k-th state in the table's order, is
    k + 1. That paper does not say from where it counts; from 1, true and false stay apart from the first state.
    """

    size: int

    def __call__(self, table: TaskTable) -> jax.Array:
        """float32[rows, size]; row 2 + k is the k-th unit vector, or the number k + 1 if the size is 1."""
        states = table.num_rows - 2
        if self.size == 1:
            return jnp.maximum(jnp.arange(table.num_rows, dtype=jnp.float32) - 1.0, 0.0)[:, None]
        if states > self.size:
            raise ValueError(
                f"a one-hot code of size {self.size} cannot tell {states} states apart; "
                f"set network.one_hot_size to {states} or more (or to 1, for the state's number)"
            )
        return jnp.eye(table.num_rows, self.size, k=-2)


def embedding_size(config: TaskEncoderConfig) -> int:
    """Numbers in the code of a task."""
    sizes = {"transformer": config.transformer.output, "rgcn": config.rgcn.output, "gru": config.gru.output}
    return sizes.get(config.task_encoder, config.one_hot_size)


def make_task_encoder(config: TaskEncoderConfig) -> nn.Module:
    """The module that `config.task_encoder` names."""
    if config.task_encoder == "transformer":
        return TransformerTaskEncoder(config.transformer)
    if config.task_encoder == "rgcn":
        return RGCNTaskEncoder(config.rgcn)
    if config.task_encoder == "gru":
        return GRUTaskEncoder(config.gru)
    return OneHotTaskEncoder(config.one_hot_size)


def attention_weights(encoder: TransformerTaskEncoder, params: dict, table: TaskTable) -> jax.Array:
    """Attention of every layer and head: float32[layers, rows, heads, L, L], query then key (padding has weight 0)."""
    _, state = encoder.apply({"params": params}, table, mutable=["intermediates"])
    layers = state["intermediates"]["transformer"]["encoder"]
    return jnp.stack([layers[f"layer_{i}"]["attention"]["attention_weights"][0] for i in range(encoder.config.layers)])
