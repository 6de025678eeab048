"""What a policy remembers of an episode: windows of the last steps, or carried states; and segments, to learn from.

A policy with context carries one `Window` per environment: empty at the start of an episode, one token longer after
every step, the newest token always in the last slot. Window functions take one window or any batch of them. Or it
carries the state of a GRU instead, as `Carried`.

The windows of successive steps overlap. So PPO learns from `Segment`s: S steps and the window at the first of them, of
which the windows of all S steps are stacked.
"""

from typing import Any, TypeAlias, TypeVar

import jax
import jax.numpy as jnp
from flax import struct

T = TypeVar("T")


@struct.dataclass
class Window:
    """The last K steps of one environment, oldest first; while the episode is younger, the first slots are empty."""

    action: jax.Array  # [..., K, A], or int32[..., K] where actions are discrete
    reward: jax.Array  # float32[..., K]
    seen: jax.Array  # float32[..., K, D]: what the action was taken on, the observation or its embedding
    valid: jax.Array  # bool[..., K], False for an empty slot


@struct.dataclass
class Tokens:
    """A window whose tokens are made already: once for windows that hold the same steps."""

    tokens: jax.Array  # float32[..., K, width]
    valid: jax.Array  # bool[..., K], False for an empty slot
    empty: jax.Array  # float32[width], the token of an empty slot


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


def newest(carry: Carry) -> Carry:
    """The carry's last slot alone."""
    return _slots(carry, slice(-1, None))


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


def token_parts(
    action: jax.Array, reward: jax.Array, seen: jax.Array, num_actions: int | None
) -> tuple[jax.Array, jax.Array]:
    """What a token is made of, for `DenseOfParts`: what was done and what it led to, [..., A + 1], and what was seen.

    action [..., A] or int32[...], reward [...], seen [..., E]; or [..., n, E] of n objects, which have a token each.
    """
    action = action if num_actions is None else jax.nn.one_hot(action, num_actions)
    done = jnp.concatenate([action, reward[..., None]], axis=-1)
    return done if seen.ndim == done.ndim else done[..., None, :], seen


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
