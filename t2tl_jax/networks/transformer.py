"""The Transformer encoder of the paper: tokens or vectors in, one vector out.

Defaults are the paper's text (sinusoidal positions, pre-LN, padding masked out). Every departure of the authors' code
is a switch: `norm="post"`, `positions="none"`, `masked=False`, `norm_after_pooling=True`, `t_fixup=True`.
"""

from dataclasses import dataclass
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np
from flax import linen as nn

from t2tl_jax.networks.initializers import joint_qkv, t_fixup_embedding, t_fixup_scale, unit_norm
from t2tl_jax.networks.task_encoder import SequenceEncoderConfig

LAYER_NORM_EPSILON = 1e-5

SHORT = 12
"""Up to this many tokens, attention multiplies and adds instead of calling for matrix products.

Head by head those are tiny, 8 x 4 by 4 x 8 in the context: gradient included, attention over 2,048 windows of 8 tokens
takes 40 ms with them on two CPU cores and 15 ms without. At 16 tokens nothing is left to gain, at 40 it is slower.
An H100 gains 15 to 40 %. Written out key by key, with a gradient of its own, it was no faster on an H200, and slower on
a CPU.
"""


@dataclass(frozen=True)
class TransformerConfig(SequenceEncoderConfig):
    """Sizes and switches of one Transformer encoder."""

    layers: int = 4
    """Number of encoder layers."""
    width: int = 64
    """Size of a token's vector."""
    heads: int = 8
    """Attention heads; must divide the width."""
    feed_forward: int = 256
    """Hidden size of the position-wise network."""
    output: int = 16
    """Size of the encoded task (the paper: 16 in ZoneEnv, 32 in WaterWorld)."""
    norm: Literal["pre", "post"] = "pre"
    """Layer norm before each block (paper) or after it (published code)."""
    positions: Literal["sinusoidal", "none"] = "sinusoidal"
    """Positional encoding: sinusoidal (paper) or none (published code, blind to the order of tokens)."""
    masked: bool = True
    """Keep padding out of attention and pooling; False reproduces the published code."""
    norm_after_pooling: bool = False
    """One more layer norm between pooling and the output layer (published code)."""
    t_fixup: bool = False
    """T-Fixup scaling of the initial weights (published code)."""

    @property
    def rows_apart(self) -> bool:
        """A row is its tokens."""
        return True

    def __post_init__(self) -> None:
        if self.layers < 1:
            raise ValueError(f"a Transformer needs at least one layer, got layers={self.layers}")
        if min(self.width, self.feed_forward, self.output) < 1:
            raise ValueError(f"sizes of a Transformer must be at least 1, got {self}")
        if self.heads < 1 or self.width % self.heads:
            raise ValueError(f"heads must divide width, got width={self.width} and heads={self.heads}")

    @property
    def reads_padding(self) -> bool:
        """Without its mask, as published, it reads padding like any token."""
        return not self.masked


def sinusoidal_positions(length: int, width: int) -> np.ndarray:
    """float32[length, width]: sine in the even columns, cosine in the odd ones (Vaswani et al., 2017, section 3.5)."""
    position = np.arange(length)[:, None]
    frequency = 10_000.0 ** (-np.arange(0, width, 2) / width)
    table = np.zeros((length, width), np.float32)
    table[:, 0::2] = np.sin(position * frequency)
    table[:, 1::2] = np.cos(position * frequency)[:, : width // 2]
    return table


def short_attention(
    query: jax.Array,
    key: jax.Array,
    value: jax.Array,
    mask: jax.Array | None = None,
    module: nn.Module | None = None,
) -> jax.Array:
    """What `nn.dot_product_attention` gives, to rounding: [B, L, heads, D] each, mask bool[B, 1, 1, L] of keys."""
    # Left to itself, XLA for CPUs fuses the projections' biases into these loops, which then gain nothing at all.
    query, key, value = jax.lax.optimization_barrier((query, key, value))
    query = query / query.shape[-1] ** 0.5
    score = (query[:, :, None] * key[:, None]).sum(-1)  # [B, queries, keys, heads]
    if mask is not None:
        score = jnp.where(mask[:, :, 0, :, None], score, jnp.finfo(score.dtype).min)
    weight = nn.softmax(score, axis=2)
    if module is not None:
        module.sow("intermediates", "attention_weights", jnp.moveaxis(weight, 3, 1))
    return (weight[..., None] * value[:, None]).sum(2)


class EncoderLayer(nn.Module):
    """Self-attention, then a position-wise network, each beside a skip: x' = MSA(LN x) + x, then MLP(LN x') + x'."""

    config: TransformerConfig
    t_fixup_layers: int  # which T-Fixup scales the weights for

    @nn.compact
    def __call__(self, x: jax.Array, mask: jax.Array) -> jax.Array:
        """x [B, L, width], mask bool[B, L] -> [B, L, width]. Sows `attention_weights` [B, heads, L, L]."""
        config = self.config
        scale = t_fixup_scale(self.t_fixup_layers) if config.t_fixup else 1.0
        attention = nn.MultiHeadDotProductAttention(
            num_heads=config.heads,
            kernel_init=joint_qkv(scale * 2**0.5 if config.t_fixup else 1.0),
            out_kernel_init=unit_norm(scale),
            attention_fn=short_attention if x.shape[1] <= SHORT else nn.dot_product_attention,
            name="attention",
        )

        def attend(y: jax.Array) -> jax.Array:
            # Keys are masked; rows of padded queries are computed too, and dropped by the pooling.
            return attention(y, mask=mask[:, None, None, :] if config.masked else None, sow_weights=True)

        def feed_forward(y: jax.Array) -> jax.Array:
            y = nn.relu(nn.Dense(config.feed_forward, kernel_init=unit_norm(scale), name="feed_forward_in")(y))
            return nn.Dense(config.width, kernel_init=unit_norm(scale), name="feed_forward_out")(y)

        norm_1 = nn.LayerNorm(epsilon=LAYER_NORM_EPSILON, name="norm_1")
        norm_2 = nn.LayerNorm(epsilon=LAYER_NORM_EPSILON, name="norm_2")
        if config.norm == "pre":
            x = x + attend(norm_1(x))
            return x + feed_forward(norm_2(x))
        x = norm_1(x + attend(x))
        return norm_2(x + feed_forward(x))


class TransformerEncoder(nn.Module):
    """Encoder layers, final layer norm, mean over the tokens, tanh head."""

    config: TransformerConfig
    t_fixup_layers: int | None = None  # where T-Fixup is to scale for another number of layers than there are

    @nn.compact
    def __call__(self, x: jax.Array, mask: jax.Array) -> jax.Array:
        """x [B, L, width] embedded tokens, mask bool[B, L] (True = a real token) -> [B, output] in (-1, 1)."""
        config = self.config
        if config.positions == "sinusoidal":
            x = x + sinusoidal_positions(x.shape[1], config.width)
        for layer in range(config.layers):
            x = EncoderLayer(config, self.t_fixup_layers or config.layers, name=f"layer_{layer}")(x, mask)
        x = nn.LayerNorm(epsilon=LAYER_NORM_EPSILON, name="final_norm")(x)
        x = jnp.mean(x, axis=1, where=mask[:, :, None] if config.masked else None)
        if config.norm_after_pooling:
            x = nn.LayerNorm(epsilon=LAYER_NORM_EPSILON, name="pooled_norm")(x)
        return jnp.tanh(nn.Dense(config.output, kernel_init=unit_norm(), name="output")(x))


class TokenTransformer(nn.Module):
    """A Transformer encoder over token ids."""

    config: TransformerConfig
    vocabulary_size: int

    @nn.compact
    def __call__(self, tokens: jax.Array, mask: jax.Array) -> jax.Array:
        """tokens int32[B, L], mask bool[B, L] -> [B, output]."""
        config = self.config
        init = t_fixup_embedding(config.width, config.layers) if config.t_fixup else nn.initializers.normal(1.0)
        embed = nn.Embed(self.vocabulary_size, config.width, embedding_init=init, name="word_embedding")
        return TransformerEncoder(config, name="encoder")(embed(tokens), mask)
