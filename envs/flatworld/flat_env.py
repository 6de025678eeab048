"""FlatWorld: a point among coloured discs that overlap, so that several colours hold at once, after DeepLTL.

Each action moves the agent by 0.08 in one of eight directions. Leaving the square gives reward -1 and ends the episode;
else the base reward is 0 and no episode ends by itself. The observation is the position.
"""

from functools import lru_cache

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct
from jax.typing import ArrayLike

from envs.flatworld.config import COLOURS, EDGE, REGIONS, STEP, FlatWorldConfig
from envs.flatworld.view import make_view
from envs.streams import one_each, stream
from t2tl_jax.env import Alphabet, LabelledEnv, Purpose, State
from t2tl_jax.view import View

NUM_ACTIONS = 9
"""0 up (+y), 1 right (+x), 2 down, 3 left, 4 up right, 5 down right, 6 up left, 7 down left, 8 nothing."""

LEAVING_REWARD = -1.0
"""Reward of the step that leaves the square, which also ends the episode. It is no violation of a task."""

_CENTRES = np.array([(x, y) for _, x, y, _ in REGIONS], np.float32)
_RADII = np.array([radius for *_, radius in REGIONS], np.float32)
_COLOUR_OF = np.array([[colour == name for colour, *_ in REGIONS] for name in COLOURS])  # [P, discs]


@struct.dataclass
class FlatWorldParams:
    """The starts that a reset chooses from."""

    starts: jax.Array | np.ndarray
    """``float32[m, 2]``: positions outside all discs."""


@struct.dataclass
class FlatState:
    """Everything that changes from step to step."""

    position: jax.Array
    """``float32[2]``: x and y of the agent."""


class FlatWorld(LabelledEnv):
    """One agent in one square. An action is an ``int32`` scalar below 9, see `NUM_ACTIONS`.

    Args:
        config: where episodes start.
    """

    def __init__(self, config: FlatWorldConfig | None = None) -> None:
        self.config = config or FlatWorldConfig()

    def make_params(self, seed: int, purpose: Purpose = "training") -> FlatWorldParams:
        """A pool of starts: another one for every seed and purpose."""
        which = stream(self.config.pool_seed, seed, purpose)
        return FlatWorldParams(_sample_starts(self.config.pool_size, which))

    @property
    def renewable(self) -> bool:
        """Always: other starts on the one map."""
        return True

    def renewed_params(self, seed: int, renewal: int) -> FlatWorldParams:
        """Another pool of starts for training."""
        which = stream(self.config.pool_seed, seed, "training", renewal)
        return FlatWorldParams(_sample_starts(self.config.pool_size, which))

    def independent_params(self, seed: int, count: int) -> FlatWorldParams | None:
        """As many starts; None where there is one only."""
        if self.fixed_start:
            return None
        return one_each(FlatWorldParams(_sample_starts(count, stream(self.config.pool_seed, seed, "certificate"))))

    @property
    def fixed_start(self) -> bool:
        """Where the pool holds one start."""
        return self.config.pool_size == 1

    @property
    def propositions(self) -> tuple[str, ...]:
        """The seven colours: Aqua, Blue, Green, Magenta, Orange, Red, Yellow."""
        return COLOURS

    @property
    def alphabet(self) -> Alphabet:
        """Every subset: discs overlap. Thirteen of the 128 subsets occur."""
        return "every_subset"

    @property
    def observation_size(self) -> int:
        """Two: x and y."""
        return 2

    @property
    def action_size(self) -> int:
        """One: the number of the action. It may come as a scalar or with this shape, ``[1]``."""
        return 1

    @property
    def num_actions(self) -> int | None:
        """Nine, see `NUM_ACTIONS`."""
        return NUM_ACTIONS

    @property
    def backend(self) -> str:
        """Name of the physics, which are steps of equal length."""
        return "steps"

    def view(self) -> View:
        """The square from above."""
        return make_view()

    def reset(self, rng: jax.Array, params: FlatWorldParams | None = None) -> State:
        """The agent at a start of the pool; no colour holds."""
        starts = jnp.asarray((self.make_params(0) if params is None else params).starts)
        index = jax.random.randint(rng, (), 0, len(starts)) if len(starts) > 1 else 0
        return self.reset_to(starts[index])

    def reset_to(self, position: ArrayLike) -> State:
        """The state with the agent at a given position, ``float[2]``."""
        position = jnp.asarray(position, jnp.float32)
        zero = jnp.zeros((), jnp.float32)
        return State(pipeline_state=FlatState(position), obs=position, reward=zero, done=zero)

    def step(self, state: State, action: jax.Array, params: FlatWorldParams | None = None) -> State:
        """The state one step later. An action that is none of the nine does nothing."""
        del params
        position = state.pipeline_state.position + STEP * _direction(action)
        left = (jnp.abs(position) > EDGE).any()
        return state.replace(
            pipeline_state=FlatState(position),
            obs=position,
            reward=jnp.where(left, LEAVING_REWARD, 0.0).astype(jnp.float32),
            done=left.astype(jnp.float32),
        )

    def labels(self, state: State) -> jax.Array:
        """Which colours have a disc that the agent is strictly inside of: ``bool[P]``."""
        offset = state.pipeline_state.position - _CENTRES
        inside = offset[:, 0] ** 2 + offset[:, 1] ** 2 < _RADII**2
        return (inside & _COLOUR_OF).any(-1)


def _direction(action: jax.Array) -> jax.Array:
    """Unit vector of an action, zero for none: ``float32[2]``. By comparison, which fuses where a lookup would not."""
    action = jnp.asarray(action).reshape(())
    diagonal = 0.5**0.5

    def along(plus: tuple[int, int, int], minus: tuple[int, int, int]) -> jax.Array:
        straight = (action == plus[0]).astype(jnp.float32) - (action == minus[0])
        oblique = sum(
            (action == a).astype(jnp.float32) - (action == b) for a, b in zip(plus[1:], minus[1:], strict=True)
        )
        return straight + diagonal * oblique

    return jnp.stack([along((1, 4, 5), (3, 6, 7)), along((0, 4, 6), (2, 5, 7))])


@lru_cache(maxsize=64)
def _sample_starts(count: int, seed: tuple[int, ...]) -> np.ndarray:
    """Draw ``float32[count, 2]`` positions, uniform outside all discs; the last pools asked for are kept."""
    rng = np.random.default_rng(seed)
    drawn = np.empty((0, 2), np.float32)
    while len(drawn) < count:
        more = rng.uniform(-EDGE, EDGE, (2 * count, 2)).astype(np.float32)
        outside = (np.linalg.norm(more[:, None] - _CENTRES, axis=-1) > _RADII).all(-1)
        drawn = np.concatenate([drawn, more[outside]])
    return drawn[:count]
