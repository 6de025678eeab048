"""The task encoders, registered as a user's would be: `TaskTable -> float32[rows, code_size]`."""

from dataclasses import dataclass
from typing import ClassVar

import jax
import jax.numpy as jnp
from flax import linen as nn

from t2tl_jax import checks
from t2tl_jax.ltl import TaskTable
from t2tl_jax.networks.automaton_encoder import AutomatonConfig, AutomatonTaskEncoder
from t2tl_jax.networks.gru import GRUConfig, GRUTaskEncoder
from t2tl_jax.networks.joined import JoinedConfig, JoinedTaskEncoder
from t2tl_jax.networks.lookahead import LookaheadConfig, LookaheadTaskEncoder
from t2tl_jax.networks.rgcn import RGCNConfig, RGCNTaskEncoder
from t2tl_jax.networks.roles import RolesConfig, RolesTaskEncoder
from t2tl_jax.networks.task_encoder import ReadsTokens, TaskEncoderConfig
from t2tl_jax.networks.transformer import TokenTransformer, TransformerConfig
from t2tl_jax.registry import TASK_ENCODERS, register_task_encoder


class TransformerTaskEncoder(ReadsTokens, nn.Module):
    """The formula itself, read by a Transformer (T1TL, T2TL)."""

    config: TransformerConfig

    @nn.compact
    def __call__(self, table: TaskTable) -> jax.Array:
        """float32[rows, config.output], in (-1, 1)."""
        return TokenTransformer(self.config, table.vocabulary_size, name="transformer")(table.tokens, table.mask)


@dataclass(frozen=True)
class OneHotConfig(TaskEncoderConfig):
    """The automaton's state as a unit vector."""

    learned: ClassVar[bool] = False

    size: int = 16
    """Width of the code, at least the number of open rows; 1 gives the state's number instead (DFA_1)."""

    def __post_init__(self) -> None:
        checks.counts(self, "size")

    @property
    def code_size(self) -> int:
        """Numbers in the code of a task."""
        return self.size


class OneHotTaskEncoder(nn.Module):
    """The state of the automaton as a unit vector (the DFA and reward-machine baselines); no parameters.

    Rows 0 and 1, true and false, have no state left to tell: they are all zeros. No network ever reads them, since an
    episode ends there. A code that is wider than there are states ends in zeros.
    Size 1 is the published baseline DFA_1, one number for the state: row 2 + k, the k-th state in the table's order, is
    k + 1. That paper does not say from where it counts; from 1, true and false stay apart from the first state.
    """

    config: OneHotConfig

    def __call__(self, table: TaskTable) -> jax.Array:
        """float32[rows, size]; row 2 + k is the k-th unit vector, or the number k + 1 if the size is 1."""
        size, states = self.config.size, table.num_rows - 2
        if size == 1:
            return jnp.maximum(jnp.arange(table.num_rows, dtype=jnp.float32) - 1.0, 0.0)[:, None]
        if states > size:
            raise ValueError(
                f"a one-hot code of size {size} cannot tell {states} states apart; "
                f"set task_encoder.size to {states} or more (or to 1, for the state's number)"
            )
        return jnp.eye(table.num_rows, size, k=-2)


register_task_encoder("transformer", TransformerConfig, TransformerTaskEncoder)
register_task_encoder("rgcn", RGCNConfig, RGCNTaskEncoder)
register_task_encoder("gru", GRUConfig, GRUTaskEncoder)
register_task_encoder("one_hot", OneHotConfig, OneHotTaskEncoder)
register_task_encoder("lookahead", LookaheadConfig, LookaheadTaskEncoder)
register_task_encoder("roles", RolesConfig, RolesTaskEncoder)
register_task_encoder("automaton", AutomatonConfig, AutomatonTaskEncoder)
register_task_encoder("joined", JoinedConfig, JoinedTaskEncoder)


def make_task_encoder(config: TaskEncoderConfig) -> nn.Module:
    """The module that a configuration stands for; ValueError if its class is not registered."""
    return TASK_ENCODERS.maker(config)(config)


def attention_weights(encoder: TransformerTaskEncoder, params: dict, table: TaskTable) -> jax.Array:
    """Attention of every layer and head: float32[layers, rows, heads, L, L], query then key (padding has weight 0)."""
    _, state = encoder.apply({"params": params}, table, mutable=["intermediates"])
    layers = state["intermediates"]["transformer"]["encoder"]
    return jnp.stack([layers[f"layer_{i}"]["attention"]["attention_weights"][0] for i in range(encoder.config.layers)])
