"""Replay in which overlapping context windows are stored once.

The window of a step holds the K steps before it, which replay holds as well: those of the same environment, N places
before, 2 N places before, and so on. So each step is stored alone, with the number of slots that its window had, and
windows are put together when a batch is drawn. What is drawn is what would be if every window were stored whole; for
that the oldest steps that can be drawn still need K steps of each environment before them, which are kept behind.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import flashbax
import jax
import jax.numpy as jnp
import optax
from flax import struct

from t2tl_jax.agents.td_learning import Transition
from t2tl_jax.networks.context_config import ContextConfig
from t2tl_jax.networks.windows import Window


@struct.dataclass
class Slot:
    """What of a transition's window is not stored elsewhere."""

    reward: jax.Array  # float32, of the step as a token has it
    seen: Any  # float32[E], the embedding made when acting; () where tokens hold the observation itself
    filled: jax.Array  # int32, slots of the window and the step that are not empty


class Replay(NamedTuple):
    """A ring of transitions, as pure functions.

    init(transition) -> state, empty, for transitions of these shapes
    add(state, transitions) -> state with those of one step of all N environments, leading axis [N]
    sample(state, key) -> transitions drawn with replacement from the newest ones, leading axis [batch]
    """

    init: Callable[[Transition], Any]
    add: Callable[[Any, Transition], Any]
    sample: Callable[[Any, jax.Array], Transition]


def make_replay(size: int, batch_size: int, num_envs: int, context: ContextConfig | None) -> Replay:
    """A replay that draws batches from the `size` newest transitions; `context` says what their windows hold."""
    behind = 0 if context is None else context.length * num_envs
    ring = flashbax.make_item_buffer(size + behind, min_length=1, sample_batch_size=1, add_batches=True)

    def stored(given: Transition) -> Transition:
        steps = given.steps
        if not isinstance(steps, Window):
            return given
        assert context is not None
        seen = () if context.recompute else steps.seen[..., -1, :]
        return replace(given, steps=Slot(steps.reward[..., -1], seen, steps.valid.sum(-1, dtype=jnp.int32)))

    def init(blank: Transition) -> Any:
        """Zeros: from JAX 0.11 on flashbax leaves memory as it was, and a checkpoint in which a byte of a bool is
        neither 0 nor 1 cannot be read back."""
        return optax.tree.zeros_like(ring.init(stored(blank)))

    def sample(state: Any, key: jax.Array) -> Transition:
        held, steps = size + behind, state.experience
        count = jnp.where(state.is_full, size, jnp.minimum(state.current_index, size))
        _, key = jax.random.split(key)  # as in flashbax, so that the same key draws the same transitions
        oldest = state.current_index - count
        drawn = (oldest + jax.random.randint(key, (batch_size,), 0, count)) % held
        batch = jax.tree.map(lambda x: x[0, drawn], steps)
        if not isinstance(steps.steps, Slot):
            return batch
        assert context is not None
        back = jnp.arange(context.length, -1, -1)
        place = (drawn[:, None] - num_envs * back) % held
        valid = back < batch.steps.filled[:, None]

        def slots(x: jax.Array) -> jax.Array:
            values = x[0, place]
            return jnp.where(valid.reshape(*valid.shape, *[1] * (values.ndim - 2)), values, 0)

        seen = steps.obs if context.recompute else steps.steps.seen
        return replace(batch, steps=Window(slots(steps.action), slots(steps.steps.reward), slots(seen), valid))

    return Replay(
        init=init,
        add=lambda state, given: ring.add(state, stored(given)),
        sample=sample,
    )
