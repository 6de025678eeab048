"""A state that is carried through the whole episode: a GRU takes one step with every step that is played.

Where a window is read anew at every step and forgets what is older, the state is what was made of all steps so far. It
is part of the carry. PPO learns from `Segment`s that begin with the state which acted there, and unrolls the GRU over
their steps with gradient: back-propagation through time that is cut at the start of a segment, from stored states as
in R2D2 (Kapturowski et al., ICLR 2019).

A memory cannot read the task, which is another one later. So of states that read it (`network.state=merged`) one state
is carried for each object, all by the same GRU, and these are merged by the task of the step that reads them.
"""

import jax
import jax.numpy as jnp
from flax import linen as nn

from t2tl_jax.networks.context_config import ContextConfig
from t2tl_jax.networks.initializers import unit_norm
from t2tl_jax.networks.parts import DenseOfParts
from t2tl_jax.networks.windows import Carried, Segment, empty_where, token_parts


class CarriedEncoder(nn.Module):
    """Tokens (action, reward, what was seen), a linear layer, a GRU, and a layer that reads its state: the parts of a
    GRU over windows."""

    config: ContextConfig
    num_actions: int | None = None  # of discrete actions, which become unit vectors; None for continuous ones

    def setup(self) -> None:
        """Name the parts; parameters live under these names in checkpoints."""
        reader = self.config.reader
        self.token = DenseOfParts(reader.width, kernel_init=unit_norm())
        self.cell = nn.GRUCell(reader.width)
        self.output = nn.Dense(reader.output, kernel_init=unit_norm())

    def __call__(self, remembered: jax.Array) -> jax.Array:
        """The context variable of states, or of what was merged of them: [..., D] -> [..., output] in (-1, 1)."""
        return jnp.tanh(self.output(remembered))

    def after(self, carry: Carried, action: jax.Array, reward: jax.Array, seen: jax.Array) -> Carried:
        """The state after a step in which `action` was taken and led to `reward` [...]; see `tokens`."""
        return Carried(self.cell(carry.state, self.tokens(action, reward, seen))[0])

    def states(self, segment: Segment, seen: jax.Array, after: bool = False) -> jax.Array:
        """The states at all steps of a segment, [..., S, H] or [..., S, n, H]; with `after` those that they lead to,
        before any new episode.

        seen [..., S, E] or [..., S, n, E] is what was seen in the steps.
        """

        def step(cell: nn.GRUCell, state: jax.Array, now: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array]:
            token, ended = now
            then, _ = cell(state, token)
            return empty_where(then, ended) if self.config.reset else then, then if after else state

        axis, tokens = segment.reward.ndim - 1, self.tokens(segment.action, segment.reward, seen)
        scan = nn.scan(step, variable_broadcast="params", split_rngs={"params": False}, in_axes=axis, out_axes=axis)
        return scan(self.cell, segment.start.state, (tokens, segment.ended))[1]

    def tokens(self, action: jax.Array, reward: jax.Array, seen: jax.Array) -> jax.Array:
        """seen [..., E] -> [..., H]; or of n objects, beside the same action and reward, [..., n, E] -> [..., n, H]."""
        return self.token(token_parts(action, reward, seen, self.num_actions))
