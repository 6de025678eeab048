"""The context: the last steps of an episode, read by a second Transformer (T2TL) or another reader of sequences.

A policy with context carries a window, which is read at every step; windows and segments are in `windows.py`. Of a
segment every observation is embedded and every token is made once, and then stacked to the S windows.

States that read the task (`network.state=merged`) are others for every task. Their windows keep observations, and each
is merged by the task of the step that reads the window: where did I see what I need now? So observations are stacked
instead of tokens, and every token is made K times.

With `carried=True` a policy carries a GRU's state instead, through the whole episode: see `carried.py`.
"""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
from flax import linen as nn

from t2tl_jax.networks.context_config import ContextConfig
from t2tl_jax.networks.initializers import t_fixup_embedding, unit_norm
from t2tl_jax.networks.parts import DenseOfParts
from t2tl_jax.networks.transformer import TransformerConfig, TransformerEncoder
from t2tl_jax.networks.windows import (
    Carried,
    Carry,
    Segment,
    Tokens,
    Window,
    append,
    empty_where,
    empty_window,
    stack_windows,
    token_parts,
    valid_in_windows,
    windows_of,
    without_oldest,
)
from t2tl_jax.registry import CONTEXT_READERS


class ContextEncoder(nn.Module):
    """Tokens (action, reward, what was made of the observation), a linear layer, and a reader as the formula's."""

    config: ContextConfig
    num_actions: int | None = None  # of discrete actions, which become unit vectors; None for continuous ones

    def setup(self) -> None:
        """Name the parts; parameters live under these names in checkpoints."""
        flags, config = self.config.reader, self.config.encoder
        init, layers = unit_norm(), None
        if isinstance(flags, TransformerConfig) and flags.t_fixup:
            # T-Fixup's factors use the sizes before halving, as published.
            init, layers = t_fixup_embedding(flags.width, flags.layers), flags.layers
        self.token = DenseOfParts(config.width, kernel_init=init)
        self.encoder = (
            TransformerEncoder(config, t_fixup_layers=layers)
            if isinstance(config, TransformerConfig)
            else CONTEXT_READERS.maker(config)(config)
        )

    def __call__(self, window: Window, embedding: jax.Array) -> jax.Array:
        """window of [..., K] slots, embedding [..., K, E] of what was seen in them -> [..., output].

        The code of an empty window is 0 (the paper's "set the context variable to zero") unless it is not masked.
        """
        return self.of_tokens(self.tokens(window, embedding))

    def tokens(self, window: Window, embedding: jax.Array) -> Tokens:
        """Those of a window, from its [..., K] slots and the embedding [..., K, E] of what was seen in them."""
        parts = token_parts(window.action, window.reward, embedding, self.num_actions)
        return Tokens(self.token(parts), window.valid, self.empty(parts))

    def of_tokens(self, made: Tokens) -> jax.Array:
        """Tokens of [..., K] slots -> [..., output], as for the window that they are of."""
        return self.read(made.tokens, made.empty, made.valid)

    def segment(self, segment: Segment, before: jax.Array, during: jax.Array, after: bool = False) -> jax.Array:
        """The codes of the windows of a segment's S steps, or of those after each step: [..., S, output].

        before [..., K, E] embeds what was seen in the K slots of the first window, during [..., S, E] in the steps.
        """
        start, axis, steps = segment.start, segment.reward.ndim - 1, segment.reward.shape[-1]
        action, reward, embedding = (
            jnp.concatenate(parts, axis)
            for parts in ((start.action, segment.action), (start.reward, segment.reward), (before, during))
        )
        parts = token_parts(action, reward, embedding, self.num_actions)
        tokens = stack_windows(self.token(parts), axis, steps, after)
        return self.read(tokens, self.empty(parts), valid_in_windows(segment, self.config.reset, after))

    def empty(self, parts: Sequence[jax.Array]) -> jax.Array:
        """The token of an empty slot, [width]: that of zeros."""
        return self.token([jnp.zeros_like(part, shape=part.shape[-1:]) for part in parts])

    def read(self, tokens: jax.Array, empty: jax.Array, valid: jax.Array) -> jax.Array:
        """tokens [..., K, width], valid bool[..., K] (elsewhere stands the token `empty` [width]) -> [..., output]."""
        config = self.config.encoder
        x = jnp.where(valid[..., None], tokens, empty)
        started = valid.any(axis=-1, keepdims=True)
        # The mean of no tokens has no gradient, so an empty window is read as a full one and its code dropped below.
        mask = valid | ~started
        code = self.encoder(x.reshape(-1, *x.shape[-2:]), mask.reshape(-1, mask.shape[-1]))
        code = code.reshape(*x.shape[:-2], config.output)
        return code if config.reads_padding else jnp.where(started, code, 0.0)


class RecurrentNetwork(nn.Module):
    """What a policy's network does with its carry. A subclass makes `context_encoder`, `see` and `blank`, and
    `see_for` if it takes states that read the task, `see_apart` and `apart` if its state can be carried.

    Without context every carry is `()`.
    """

    config: Any  # of the network; has a field `context`, a `ContextConfig` or None

    def see(self, obs: jax.Array) -> jax.Array:
        """The embedding of an observation that tokens hold: [..., O] -> [..., E]."""
        raise NotImplementedError

    def see_for(self, obs: jax.Array, task: jax.Array) -> jax.Array:
        """What tokens hold of states that read the task: [..., O] and [..., dim], broadcast -> [..., E]."""
        raise NotImplementedError

    def see_apart(self, obs: jax.Array) -> jax.Array:
        """What a carried state learns of an observation, whatever the task: [..., O] -> [..., E] or [..., n, E]."""
        raise NotImplementedError

    @nn.nowrap
    def blank(self, observation_size: int) -> tuple[jax.Array, int]:
        """Any one action, and the size E of the embedding."""
        raise NotImplementedError

    @property
    @nn.nowrap
    def apart(self) -> tuple[int, ...]:
        """(n,) where one state is carried for each of n objects, () where it is one for all."""
        raise NotImplementedError

    @nn.nowrap
    def begin(self, observation_size: int) -> Carry:
        """The carry of one environment at the start of an episode; needs no parameters."""
        context = self.config.context
        if context is None:
            return ()
        if context.carried:
            return Carried(jnp.zeros((*self.apart, context.reader.width)))
        action, embedding_size = self.blank(observation_size)
        return empty_window(context.length, action, observation_size if context.recompute else embedding_size)

    def extend(self, carry: Carry, obs: jax.Array, action: jax.Array, reward: jax.Array) -> Carry:
        """The carry and the step that followed, one slot more: `action` on `obs` [..., O] led to `reward` [...]."""
        if not isinstance(carry, Window):
            return carry
        return append(carry, action, reward, obs if self.config.context.recompute else self.see(obs))

    def remember(self, carry: Carry, obs: jax.Array, action: jax.Array, reward: jax.Array) -> Carry:
        """The carry after a step."""
        if isinstance(carry, Carried):
            return self.context_encoder.after(carry, action, reward, self.see_apart(obs))
        return without_oldest(self.extend(carry, obs, action, reward))

    @nn.nowrap
    def next_episode(self, carry: Carry, ended: jax.Array) -> Carry:
        """The carry to go on with: emptied where the episode `ended` bool[...], unless it is never to be."""
        if not isinstance(carry, Window | Carried) or not self.config.context.reset:
            return carry
        return empty_where(carry, ended)

    def tokens(self, window: Window) -> Tokens:
        """Those of a window, to be read later by `context`."""
        seen = self.see(window.seen) if self.config.context.recompute else window.seen
        return self.context_encoder.tokens(window, seen)

    def context(
        self, carry: Carry | Tokens | Segment, embedding: jax.Array | None = None, after: bool = False
    ) -> jax.Array:
        """The context variable of every window, [..., output], or of every step of segments, [..., S, output].

        Segments whose embeddings are made anew need the `embedding` [..., S, E] of the steps' observations. With
        `after`, the windows are those that a step leads to, before any new episode.
        """
        if isinstance(carry, Tokens):
            return self.context_encoder.of_tokens(carry)
        carry = _remembered(carry)
        if isinstance(carry, Window):
            return self.context_encoder.of_tokens(self.tokens(carry))
        seen = self.see(carry.start.seen) if self.config.context.recompute else carry.start.seen
        return self.context_encoder.segment(carry, seen, embedding if carry.seen is None else carry.seen, after)

    def context_for(self, carry: Carry | Segment, obs: jax.Array, task: jax.Array, after: bool = False) -> jax.Array:
        """`context` where states read the task: all that a window holds is read for the `task` of its step.

        task [..., dim], of segments [..., S, dim] with the observations `obs` [..., S, O] of the steps; with `after`
        that of the states they lead to.
        """
        carry = _remembered(carry)
        window = windows_of(carry, obs, self.config.context.reset, after) if isinstance(carry, Segment) else carry
        return self.context_encoder(window, self.see_for(window.seen, task[..., None, :]))


def _remembered(carry: Any) -> Window | Segment:
    """The carry of a network with context; ValueError for one without."""
    if not isinstance(carry, Window | Segment):
        raise ValueError(f"a network with context needs a window, got {type(carry).__name__}")
    return carry
