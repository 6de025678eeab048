"""The relational graph network of LTL2Action and of the paper's GNN baseline: messages climb the formula's tree.

A node is a token of the formula. Since tokens stand in prefix order, the first operand of an operator is the token
after it, and the tree needs no other data than the tokens: nothing is built on the host.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from flax import linen as nn

from t2tl_jax.ltl import TaskTable
from t2tl_jax.ltl.tokens import NUM_OPERANDS
from t2tl_jax.networks.initializers import unit_norm
from t2tl_jax.networks.task_encoder import ReadsTokens, TaskEncoderConfig

SELF, ARG, ARG1, ARG2 = range(4)
"""Relations: a node to itself; to its operator from the operand of a unary one, and from both of a binary one."""


@dataclass(frozen=True)
class RGCNConfig(TaskEncoderConfig):
    """Sizes of the graph network; the defaults are the published ones."""

    width: int = 32
    """Size of a node's vector."""
    layers: int = 8
    """Rounds of messages, all with the same weights; tokens more levels than this below the root are not heard."""
    output: int = 32
    """Size of the encoded task."""

    def __post_init__(self) -> None:
        if min(self.width, self.layers, self.output) < 1:
            raise ValueError(f"sizes of the graph network must be at least 1, got {self}")

    @property
    def rows_apart(self) -> bool:
        """A row is its tokens."""
        return True

    @property
    def code_size(self) -> int:
        """Numbers in the code of a task."""
        return self.output


def operands(tokens: jax.Array) -> jax.Array:
    """How many operands the tokens int32[..., L] have: int32[..., L], 0 for propositions and padding."""
    known = jnp.asarray((*NUM_OPERANDS, 0))
    return known[jnp.minimum(tokens, len(NUM_OPERANDS))]


def second_operand(tokens: jax.Array) -> jax.Array:
    """Position of the second operand of every binary operator: int32[..., L]; meaningless for other tokens.

    tokens int32[..., L], in prefix order. Works inside jit, on any table.
    """
    # Operands that are still to come before each token. It is back at an operator's level for the first time where the
    # operator's first operand is complete, and there the second one begins.
    change = operands(tokens) - 1
    level = jnp.cumsum(change, axis=-1) - change
    position = np.arange(tokens.shape[-1])
    same = (level[..., :, None] == level[..., None, :]) & (position[:, None] < position[None, :])
    return jnp.argmax(same, axis=-1)


class RelationalConvolution(nn.Module):
    """One round of messages from operands to operators: tanh(sum over relations of x W_relation + bias)."""

    width: int

    @nn.compact
    def __call__(self, x: jax.Array, tokens: jax.Array, second: jax.Array) -> jax.Array:
        """x [rows, L, D], tokens and second operands int32[rows, L] -> [rows, L, width]."""
        init = nn.initializers.glorot_uniform(batch_axis=0)
        weights = self.param("weights", init, (4, x.shape[-1], self.width))
        bias = self.param("bias", nn.initializers.zeros, (self.width,))
        sent = jnp.einsum("...i,rio->r...o", x, weights)
        count = operands(tokens)[..., None]
        following = jnp.roll(sent, -1, axis=-2)  # the last token has no operand, so that nothing comes round
        from_second = jnp.take_along_axis(sent[ARG2], second[..., None], axis=-2)
        received = (
            jnp.where(count == 1, following[ARG], 0.0)
            + jnp.where(count == 2, following[ARG1], 0.0)
            + jnp.where(count == 2, from_second, 0.0)
        )
        return jnp.tanh(sent[SELF] + received + bias)


class RGCNTaskEncoder(ReadsTokens, nn.Module):
    """The formula's tree, read by a relational graph network at its root.

    A token that the table masks is no node: it sends nothing, and what is below it is not heard.

    The published network has the weights of a node to itself twice (a relation and a self loop); their sum is one.
    """

    config: RGCNConfig

    @nn.compact
    def __call__(self, table: TaskTable) -> jax.Array:
        """float32[rows, config.output]; linear at the end, as published."""
        config, tokens = self.config, table.tokens
        second = second_operand(tokens)
        one_hot = jax.nn.one_hot(tokens, table.vocabulary_size)
        there = table.mask[..., None]
        start = jnp.where(there, nn.Dense(config.width, kernel_init=unit_norm(), name="input")(one_hot), 0.0)
        convolution = RelationalConvolution(config.width, name="convolution")
        h = start
        for _ in range(config.layers):
            h = jnp.where(there, convolution(jnp.concatenate([h, start], axis=-1), tokens, second), 0.0)
        return nn.Dense(config.output, kernel_init=unit_norm(), name="output")(h[:, 0])
