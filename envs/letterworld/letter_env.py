"""LetterWorld: letters on a grid whose edges are joined, after LTL2Action and DeepLTL.

The agent starts in cell (0, 0) and moves by one cell; the letter of its cell holds. The base reward is 0 and no episode
ends by itself: what the letters mean is up to the task. The agent sees the whole grid, rolled so that it is in the
middle.
"""

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct
from jax.typing import ArrayLike

from envs.letterworld import maps
from envs.letterworld.config import LetterWorldConfig
from envs.letterworld.view import make_view
from envs.streams import one_each, stream
from t2tl_jax.env import Alphabet, LabelledEnv, Purpose, State
from t2tl_jax.objects import Objects
from t2tl_jax.view import View

MOVES = ((-1, 0), (1, 0), (0, -1), (0, 1))
"""Rows and columns that each action adds: up, down, left, right."""

NUM_ACTIONS = len(MOVES)
"""Numbers of `MOVES`."""


@struct.dataclass
class LetterWorldParams:
    """The maps that a reset chooses from."""

    maps: jax.Array | np.ndarray
    """``int8[m, size, size]``: the letter of each cell, -1 for none."""


@struct.dataclass
class LetterState:
    """Everything that changes from episode to episode or from step to step."""

    position: jax.Array
    """``int32[2]``: row and column of the agent's cell."""
    seen: jax.Array
    """``int8[size, size]``: the letter of each cell, -1 for none, with the agent's cell in the middle."""


class LetterWorld(LabelledEnv):
    """One agent on one grid. An action is an ``int32`` scalar below 4, see `MOVES`.

    Args:
        config: grid and letters.

    Raises:
        ValueError: for letters that cannot be placed.
    """

    def __init__(self, config: LetterWorldConfig | None = None) -> None:
        self.config = config or LetterWorldConfig()
        self.make_params(0)  # letters that do not fit are refused here

    def make_params(self, seed: int, purpose: Purpose = "training") -> LetterWorldParams:
        """A pool of random maps, another one for every seed and purpose; by seed, one map for all purposes."""
        pool_seed = self.config.pool_seed
        if self.config.layout == "by_seed":
            return self._pool(1, stream(pool_seed, seed, "training"))
        return self._pool(self.config.pool_size, stream(pool_seed, seed, purpose))

    @property
    def renewable(self) -> bool:
        """On random maps."""
        return self.config.layout == "random"

    def renewed_params(self, seed: int, renewal: int) -> LetterWorldParams:
        """Another pool of random maps for training."""
        return self._pool(self.config.pool_size, stream(self.config.pool_seed, seed, "training", renewal))

    def independent_params(self, seed: int, count: int) -> LetterWorldParams | None:
        """As many random maps; None where a seed has one map."""
        if self.fixed_start:
            return None
        return one_each(self._pool(count, stream(self.config.pool_seed, seed, "certificate")))

    def _pool(self, count: int, which: tuple[int, ...]) -> LetterWorldParams:
        config = self.config
        return LetterWorldParams(maps.sample_maps(config.size, len(config.letters), config.copies, count, which))

    @property
    def fixed_start(self) -> bool:
        """Where a seed has one map."""
        return self.config.layout == "by_seed" or self.config.pool_size == 1

    @property
    def propositions(self) -> tuple[str, ...]:
        """The letters."""
        return self.config.letters

    @property
    def alphabet(self) -> Alphabet:
        """At most one: a cell holds one letter."""
        return "at_most_one"

    @property
    def observation_size(self) -> int:
        """637 as published: 7 x 7 cells, and for each the 12 letters and the agent."""
        return self.config.size**2 * (len(self.config.letters) + 1)

    @property
    def objects(self) -> Objects:
        """The letters, each by the cells that hold it."""
        letters = len(self.config.letters)
        cells = range(self.config.size**2)
        return Objects(
            tuple(tuple(cell * (letters + 1) + k for cell in cells) for k in range(letters)), tuple(range(letters))
        )

    @property
    def action_size(self) -> int:
        """One: the number of the action. It may come as a scalar or with this shape, ``[1]``."""
        return 1

    @property
    def num_actions(self) -> int | None:
        """Four, see `MOVES`."""
        return NUM_ACTIONS

    @property
    def backend(self) -> str:
        """Name of the physics, which are moves on a grid."""
        return "grid"

    def view(self) -> View:
        """The grid from above."""
        return make_view(self.config)

    def reset(self, rng: jax.Array, params: LetterWorldParams | None = None) -> State:
        """The agent in cell (0, 0) of a map of the pool; no letter holds."""
        grids = jnp.asarray((self.make_params(0) if params is None else params).maps)
        index = jax.random.randint(rng, (), 0, len(grids)) if len(grids) > 1 else 0
        return self.reset_to(jnp.zeros(2, jnp.int32), grids[index])

    def reset_to(self, position: ArrayLike, grid: ArrayLike) -> State:
        """The state with the agent in a given cell of a given map.

        Args:
            position: ``int[2]``, row and column.
            grid: ``int[size, size]``, the letter of each cell, -1 for none; see `envs.letterworld.maps.from_text`.
        """
        position = jnp.asarray(position, jnp.int32)
        rows, columns = (position[:, None] + jnp.arange(self.config.size) - self._middle) % self.config.size
        first = LetterState(position=position, seen=jnp.asarray(grid, jnp.int8)[rows[:, None], columns])
        zero = jnp.zeros((), jnp.float32)
        return State(pipeline_state=first, obs=self._observe(first), reward=zero, done=zero)

    def step(self, state: State, action: jax.Array, params: LetterWorldParams | None = None) -> State:
        """The state one move later, on the map that the episode began on (`params` are not used).

        An action that is none of the four does nothing.
        """
        del params
        before: LetterState = state.pipeline_state
        action = jnp.asarray(action).reshape(())
        row, column = before.position
        seen = before.seen
        for number, (down, right) in enumerate(MOVES):
            taken = action == number
            row, column = row + jnp.where(taken, down, 0), column + jnp.where(taken, right, 0)
            # The world moves the other way. By static rolls, which fuse where a gather of every cell would not.
            seen = jnp.where(taken, jnp.roll(before.seen, (-down, -right), (0, 1)), seen)
        after = LetterState(position=jnp.stack([row, column]) % self.config.size, seen=seen)
        zero = jnp.zeros((), jnp.float32)
        return state.replace(pipeline_state=after, obs=self._observe(after), reward=zero, done=zero)

    def labels(self, state: State) -> jax.Array:
        """Which letter the agent's cell holds: ``bool[P]``, at most one of them true."""
        return state.pipeline_state.seen[self._middle, self._middle] == jnp.arange(len(self.propositions))

    @property
    def _middle(self) -> int:
        return self.config.size // 2

    def _observe(self, state: LetterState) -> jax.Array:
        """Cells by row and column, for each the letters and the agent, one-hot: ``float32[observation_size]``."""
        size, letters = self.config.size, len(self.propositions)
        agent = np.zeros((size, size, letters + 1), bool)
        agent[self._middle, self._middle, letters] = True
        planes = jnp.arange(letters + 1, dtype=jnp.int8)
        return ((state.seen[..., None] == planes) | agent).reshape(-1).astype(jnp.float32)
