"""The context: the last steps of an episode, read by a second Transformer (T2TL) or another reader of sequences.

A policy with context carries one `Window` per environment: empty at the start of an episode, one token longer after
every step, the newest token always in the last slot. Window functions take one window or any batch of them.

The windows of successive steps overlap. So PPO learns from `Segment`s: S steps and the window at the first of them, in
which every observation is embedded and every token is made once, and then stacked to the S windows.

States that read the task (`network.state=merged`) are others for every task. Their windows keep observations, and each
is merged by the task of the step that reads the window: where did I see what I need now? So observations are stacked
instead of tokens, and every token is made K times.

With `carried=True` a policy carries a GRU's state instead, through the whole episode: see `carried.py`.
"""

from dataclasses import dataclass, field, replace
from typing import Any, Literal, TypeAlias, TypeVar

import jax
import jax.numpy as jnp
from flax import linen as nn
from flax import struct

from t2tl_jax.networks.gru import GRUConfig, GRUWindowReader
from t2tl_jax.networks.initializers import t_fixup_embedding, unit_norm
from t2tl_jax.networks.task_encoder import SequenceEncoderConfig
from t2tl_jax.networks.transformer import TransformerConfig, TransformerEncoder
from t2tl_jax.registry import CONTEXT_READERS, register_context_reader

T = TypeVar("T")


@dataclass(frozen=True)
class ContextConfig:
    """What the window holds, and who reads it."""

    length: int = 8
    """Steps that the window holds; a carried state has none."""
    reader: SequenceEncoderConfig = field(
        default_factory=lambda: TransformerConfig(layers=1, width=32, feed_forward=128)
    )
    """Who reads the window: a Transformer, by default of the sizes that the published code comes down to (unless it is
    masked, empty slots count as tokens of zeros), a GRU from the oldest step to the newest, or any other that is
    registered."""
    carried: bool = False
    """Carry the reader's state through the whole episode, instead of reading the last steps anew at every step. Needs a
    GRU, which in the update is unrolled over a segment from the state at its start: gradients reach back to there, so
    segments should be longer."""
    reset: bool = True
    """Empty the window at the start of every episode (paper); the published code never does."""
    first_token: Literal["none", "made_up"] = "none"
    """What PPO's windows hold when a training begins: nothing (paper), or one token that no step has made, of an action
    drawn uniformly, reward 0 and the first observation (published code). An empty window is zeros to the published
    reader, whose gradient there can be very large. Evaluations begin with empty windows in either case. Needs
    reset=False."""
    aligned: bool = True
    """Update every sample with its own window; False gives it that of another sample, as the published code does."""
    halved: bool = False
    """Halve the given layers, width and feed_forward but not T-Fixup's factors, as the published code does in silence
    (its flags say 2, 64 and 256)."""
    recompute: bool = True
    """Keep observations, and embed them anew with gradient in the update; False keeps the embedding made when acting
    (published code), through which no gradient flows. States that read the task (merged) are made anew at every step:
    they need True, and go into the tokens by themselves, without the layers of the environment encoder."""
    segment_length: int = 8
    """PPO draws its minibatches in pieces of so many successive steps, which share the work on their windows or their
    carried state; must divide unroll_length. 1 draws every step by itself, as the published code does, and is several
    times slower."""

    def __post_init__(self) -> None:
        if self.length < 1:
            raise ValueError(f"a context window holds at least one step, got length={self.length}")
        if self.segment_length < 1:
            raise ValueError(f"a segment holds at least one step, got segment_length={self.segment_length}")
        if not self.aligned and self.segment_length > 1:
            raise ValueError(
                "aligned=False gives every step the window of another one, so steps share nothing; it needs "
                f"segment_length=1, got segment_length={self.segment_length}"
            )
        if self.carried and not isinstance(self.reader, GRUConfig):
            raise ValueError(
                "carried=True needs a reader with a state, network.context.reader=gru, got a reader of "
                f"{type(self.reader).__name__}"
            )
        if self.carried and self.length != ContextConfig.length:
            raise ValueError(
                f"a state that is carried has no window, so that its length={self.length} would mean nothing: leave "
                f"it at {ContextConfig.length}, or use carried=False"
            )
        if self.carried and self.segment_length < 2:
            raise ValueError(
                "a carried state is learned over the steps of a segment, and the first of them reads the state that "
                f"was stored: carried=True needs segment_length=2 or more, got segment_length={self.segment_length}"
            )
        if self.carried and not (self.aligned and self.recompute):
            raise ValueError(
                "with carried=True there are no windows to misalign and no embeddings to keep; it needs aligned=True "
                f"and recompute=True, got aligned={self.aligned} and recompute={self.recompute}"
            )
        if self.first_token != "none" and self.carried:
            raise ValueError(
                f"first_token={self.first_token} is put into a window, and a state that is carried has none; use "
                "first_token=none, or carried=False"
            )
        if self.first_token != "none" and self.reset:
            raise ValueError(
                f"with reset=True every episode begins with an empty window; first_token={self.first_token} needs "
                "reset=False"
            )
        if self.halved and not isinstance(self.reader, TransformerConfig):
            raise ValueError(
                f"halved=True is a mistake in building a Transformer, got a reader of {type(self.reader).__name__}"
            )
        if isinstance(self.reader, TransformerConfig) and self.halved and self.reader.layers < 2:
            raise ValueError(
                f"halved=True needs a context Transformer of two layers or more, got layers={self.reader.layers}"
            )

    @property
    def encoder(self) -> SequenceEncoderConfig:
        """The reader as it is built."""
        if not self.halved:
            return self.reader
        sizes = {name: getattr(self.reader, name) // 2 for name in ("layers", "width", "feed_forward")}
        return replace(self.reader, **sizes)


@struct.dataclass
class Window:
    """The last K steps of one environment, oldest first; while the episode is younger, the first slots are empty."""

    action: jax.Array  # [..., K, A], or int32[..., K] where actions are discrete
    reward: jax.Array  # float32[..., K]
    seen: jax.Array  # float32[..., K, D]: what the action was taken on, the observation or its embedding
    valid: jax.Array  # bool[..., K], False for an empty slot


@struct.dataclass
class Carried:
    """What a GRU made of all steps of the episode so far; zeros before the first one."""

    state: jax.Array  # float32[..., H], or [..., n, H] where each of n objects is remembered by itself


Carry: TypeAlias = Window | Carried | tuple[()]
"""What a policy remembers of an episode: a window or a carried state, or nothing at all without context."""


@struct.dataclass
class Segment:
    """S successive steps of one environment, and what is needed for the windows or carried states of all of them."""

    start: Any  # of the first step: a `Window` of [..., K] slots, or a `Carried` of [...]
    action: jax.Array  # [..., S, A], or int32[..., S] where actions are discrete
    reward: jax.Array  # float32[..., S]
    ended: jax.Array  # bool[..., S], the episode ended with this step
    seen: jax.Array | None  # float32[..., S, E], embeddings made when acting; None where they are made anew


def empty_window(length: int, action: jax.Array, seen_size: int) -> Window:
    """The window of one environment before its first step; `action` is any one action, for its shape and dtype."""
    return Window(
        action=jnp.zeros((length, *action.shape), action.dtype),
        reward=jnp.zeros(length),
        seen=jnp.zeros((length, seen_size)),
        valid=jnp.zeros(length, bool),
    )


def append(window: Window, action: jax.Array, reward: jax.Array, seen: jax.Array) -> Window:
    """One slot more, for a step in which `action` was taken on `seen` and led to `reward`: K + 1 slots.

    Without the newest slot this is the window at the start of the step, without the oldest the one after it.
    """
    axis = reward.ndim  # of the slots: behind the leading axes, which all fields share

    def add(old: jax.Array, new: jax.Array) -> jax.Array:
        return jnp.concatenate([old, jnp.expand_dims(new.astype(old.dtype), axis)], axis)

    return jax.tree.map(add, window, Window(action, reward, seen, jnp.ones(reward.shape, bool)))


def without_oldest(carry: Carry) -> Carry:
    """The carry less its first slot."""
    return _slots(carry, slice(1, None))


def without_newest(carry: Carry) -> Carry:
    """The carry less its last slot."""
    return _slots(carry, slice(None, -1))


def _slots(carry: Carry, chosen: slice) -> Carry:
    if not isinstance(carry, Window):
        return carry
    leading = (slice(None),) * (carry.reward.ndim - 1)
    return jax.tree.map(lambda x: x[*leading, chosen], carry)


def empty_where(carry: T, ended: jax.Array) -> T:
    """The carry emptied where `ended` bool[...], one flag per environment."""

    def clear(x: jax.Array) -> jax.Array:
        return jnp.where(ended.reshape(ended.shape + (1,) * (x.ndim - ended.ndim)), jnp.zeros_like(x), x)

    return jax.tree.map(clear, carry)


def token_parts(action: jax.Array, reward: jax.Array, seen: jax.Array, num_actions: int | None) -> jax.Array:
    """Side by side what a token is made of: action [..., A] or int32[...], reward [...], seen [..., E]; or what the
    tokens of n objects are made of, of which [..., n, E] was seen."""
    action = action if num_actions is None else jax.nn.one_hot(action, num_actions)
    done = jnp.concatenate([action, reward[..., None]], axis=-1)
    if seen.ndim > done.ndim:
        done = jnp.broadcast_to(done[..., None, :], (*seen.shape[:-1], done.shape[-1]))
    return jnp.concatenate([done, seen], axis=-1)


def stack_windows(slots: jax.Array, axis: int, steps: int, after: bool) -> jax.Array:
    """The windows of S `steps` from a sequence of K + S slots along `axis`: [..., K + S, ...] -> [..., S, K, ...].

    That of step s are the K slots before its own; with `after`, the K that end with its own. K slices instead of one
    gather, whose gradient would be a scatter.
    """
    length = slots.shape[axis] - steps
    slices = [jax.lax.slice_in_dim(slots, k + after, k + after + steps, axis=axis) for k in range(length)]
    return jnp.stack(slices, axis + 1)


def valid_in_windows(segment: Segment, reset: bool, after: bool) -> jax.Array:
    """Which slots of the windows of `stack_windows` are filled, with `reset` by the own episode: bool[..., S, K]."""
    start, axis, steps = segment.start, segment.reward.ndim - 1, segment.reward.shape[-1]
    filled = jnp.concatenate([start.valid, jnp.ones_like(segment.ended)], axis)
    valid = stack_windows(filled, axis, steps, after)
    if not reset:
        return valid
    episode = jnp.cumsum(segment.ended, axis) - segment.ended  # how many ended before a step
    of_slot = jnp.concatenate([jnp.zeros(start.valid.shape, episode.dtype), episode], axis)
    return valid & (stack_windows(of_slot, axis, steps, after) == episode[..., None])


def windows_of(segment: Segment, obs: jax.Array, reset: bool, after: bool) -> Window:
    """The windows of all steps of a segment, or with `after` those that they lead to, in full: [..., S] of them.

    obs [..., S, O] are the observations of the steps. A slot of another episode is not valid, but not emptied.
    """
    start, axis, steps = segment.start, segment.reward.ndim - 1, segment.reward.shape[-1]

    def stacked(before: jax.Array, during: jax.Array) -> jax.Array:
        return stack_windows(jnp.concatenate([before, during], axis), axis, steps, after)

    return Window(
        action=stacked(start.action, segment.action),
        reward=stacked(start.reward, segment.reward),
        seen=stacked(start.seen, obs),
        valid=valid_in_windows(segment, reset, after),
    )


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
        self.token = nn.Dense(config.width, kernel_init=init)
        self.encoder = (
            TransformerEncoder(config, t_fixup_layers=layers)
            if isinstance(config, TransformerConfig)
            else CONTEXT_READERS.maker(config)(config)
        )

    def __call__(self, window: Window, embedding: jax.Array) -> jax.Array:
        """window of [..., K] slots, embedding [..., K, E] of what was seen in them -> [..., output].

        The code of an empty window is 0 (the paper's "set the context variable to zero") unless it is not masked.
        """
        slots = token_parts(window.action, window.reward, embedding, self.num_actions)
        return self.read(self.token(slots), self.empty(slots), window.valid)

    def segment(self, segment: Segment, before: jax.Array, during: jax.Array, after: bool = False) -> jax.Array:
        """The codes of a segment's S windows, or of those after each step: [..., S, output].

        before [..., K, E] embeds what was seen in the slots of the first window, during [..., S, E] in the steps.
        """
        start, axis, steps = segment.start, segment.reward.ndim - 1, segment.reward.shape[-1]
        action, reward, embedding = (
            jnp.concatenate(parts, axis)
            for parts in ((start.action, segment.action), (start.reward, segment.reward), (before, during))
        )
        slots = token_parts(action, reward, embedding, self.num_actions)
        tokens = stack_windows(self.token(slots), axis, steps, after)
        return self.read(tokens, self.empty(slots), valid_in_windows(segment, self.config.reset, after))

    def empty(self, slots: jax.Array) -> jax.Array:
        """The token of an empty slot, [width]: that of zeros."""
        return self.token(jnp.zeros_like(slots, shape=slots.shape[-1:]))

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

    def context(self, carry: Carry | Segment, embedding: jax.Array | None = None, after: bool = False) -> jax.Array:
        """The context variable of every window, [..., output], or of every step of segments, [..., S, output].

        Segments whose embeddings are made anew need the `embedding` [..., S, E] of the steps' observations. With
        `after`, the windows are those that a step leads to, before any new episode.
        """
        carry = _remembered(carry)
        window = carry.start if isinstance(carry, Segment) else carry
        seen = self.see(window.seen) if self.config.context.recompute else window.seen
        if isinstance(carry, Window):
            return self.context_encoder(carry, seen)
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


register_context_reader("transformer", TransformerConfig, TransformerEncoder)
register_context_reader("gru", GRUConfig, GRUWindowReader)
