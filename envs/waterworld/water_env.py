"""WaterWorld: an agent among coloured balls that fly straight and bounce off the walls, after Toro Icarte et al.

The agent changes its velocity in four directions; bodies pass through each other, and what counts is which colours it
touches. The transition is deterministic, the base reward is 0 and no episode ends by itself: what the colours mean is
up to the task. Defaults are the eight colours of T2TL with the physical constants of the reward-machine publication.

Where the original program is odd, this is what happens here:

- It reports a touch one step late: ``delay=1`` does the same, the default is ``delay=0``.
- It reports only the onset of a contact: so does the default, and ``events="level"`` reports a contact while it lasts.
- A body may start overlapping the far walls: kept, because its maps depend on it.
- One start for all episodes of a run: the default, ``layout="random"`` takes another at every reset.
- From the second episode on the agent starts with the velocity of a former action: left out, it starts at rest.
- Touched balls can be placed anew: left out, no published experiment uses it.
- Rewards of its tasks, what its time limit means and how it explores belong to tasks and learners, not to the world.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct
from jax.typing import ArrayLike

from envs.streams import one_each
from envs.waterworld import maps
from envs.waterworld.config import WaterWorldConfig
from envs.waterworld.params import Start, WaterWorldParams
from envs.waterworld.view import make_view
from t2tl_jax.env import Alphabet, LabelledEnv, Purpose, State
from t2tl_jax.objects import Objects
from t2tl_jax.view import View

INDEPENDENT_MAPS = 2**80
"""Number of the first map that is drawn for an episode of its own, behind all maps of pools."""

NUM_ACTIONS = 5
"""0 nothing, 1 up (+y), 2 right (+x), 3 down (-y), 4 left (-x)."""


@struct.dataclass
class WaterWorldState:
    """Everything that changes from episode to episode or from step to step."""

    agent_position: jax.Array
    """``float32[2]`` in units of length."""
    agent_velocity: jax.Array
    """``float32[2]`` in units per second."""
    ball_positions: jax.Array
    """``float32[n, 2]`` in units of length, the balls of a colour next to each other."""
    ball_velocities: jax.Array
    """``float32[n, 2]`` in units per second."""
    contact: jax.Array
    """``bool[n]``: which balls the agent touches."""
    events: jax.Array
    """``bool[1 + delay, P]``: first the labels of this state, then those that are still to come."""


class WaterWorld(LabelledEnv):
    """One agent among balls. An action is an ``int32`` scalar below 5, see `NUM_ACTIONS`.

    Args:
        config: colours, map, events and sizes.

    Raises:
        ValueError: for balls that cannot be placed.
    """

    def __init__(self, config: WaterWorldConfig | None = None) -> None:
        self.config = config or WaterWorldConfig()
        self._maps(self.config.map_number, 1)  # a world in which the balls do not fit is refused here

    def make_params(self, seed: int, purpose: Purpose = "training") -> WaterWorldParams:
        """Sizes and speeds, and the maps that a reset chooses from.

        On a fixed layout that is one map, by seed the map of that number, and of a random layout a pool of numbered
        maps that belong to this seed: the training of seed 0 has the first ``pool_size`` maps, its evaluation the next
        ones, then those of seed 1 follow; maps to select by have numbers behind those of every seed. With
        ``pool_size=0`` there are none: a reset draws its own.

        Raises:
            ValueError: for a negative seed, and by seed for one that has no map.
        """
        config = self.config
        if seed < 0:
            raise ValueError(f"seeds are not negative, got {seed}")
        if config.layout == "by_seed" and seed >= config.pool_size:
            raise ValueError(
                f"seed {seed} has no map: env.pool_size={config.pool_size} maps serve the seeds 0 to "
                f"{config.pool_size - 1}; set env.pool_size to {seed + 1} or more, or env.layout to fixed"
            )
        starts: Start | None
        if config.layout == "fixed":
            starts = self._maps(config.map_number, 1)
        elif config.layout == "by_seed":
            starts = self._maps(seed, 1)
        elif config.pool_size:
            block = {"training": 2 * seed, "evaluation": 2 * seed + 1, "selection": 2**33 + seed}[purpose]
            starts = self._maps(block * config.pool_size, config.pool_size)
        else:
            starts = None
        return self._params(starts)

    @property
    def renewable(self) -> bool:
        """Where there is a pool of random maps; without one every episode has a map of its own anyway."""
        return self.config.layout == "random" and self.config.pool_size > 0

    def renewed_params(self, seed: int, renewal: int) -> WaterWorldParams:
        """Another pool of numbered maps for training: for each renewal those of all seeds follow each other."""
        block = renewal * 2**34 + seed  # behind all blocks of `make_params`, as seeds are below 2^32
        return self._params(self._maps(block * self.config.pool_size, self.config.pool_size))

    def independent_params(self, seed: int, count: int) -> WaterWorldParams | None:
        """As many numbered maps; None where a seed has one map, or a reset draws its own."""
        if self.fixed_start or not self.config.pool_size:
            return None
        params = self._params(one_each(self._maps(INDEPENDENT_MAPS + seed * 2**32, count)))
        sizes = jax.tree.map(lambda x: np.broadcast_to(x, (count, *x.shape)), dataclasses.replace(params, starts=None))
        return dataclasses.replace(sizes, starts=params.starts)

    def _params(self, starts: Start | None) -> WaterWorldParams:
        config = self.config
        return WaterWorldParams(
            arena=np.asarray(config.arena, np.float32),
            time_step=np.asarray(config.time_step, np.float32),
            ball_speed=np.asarray(config.ball_speed, np.float32),
            increment=np.asarray(config.increment, np.float32),
            velocity_limit=np.asarray(config.velocity_limit, np.float32),
            agent_radius=np.asarray(config.agent_radius, np.float32),
            ball_radius=np.asarray(config.radius_of_each_colour, np.float32),
            map_radius=np.asarray(config.map_radius_of_each_colour, np.float32),
            starts=starts,
        )

    def _maps(self, first: int, count: int) -> Start:
        config = self.config
        radii = tuple(radius for radius in config.map_radius_of_each_colour for _ in range(config.balls_per_colour))
        return maps.map_pool(first, count, radii, config.agent_radius, config.arena)

    @property
    def fixed_start(self) -> bool:
        """Where a seed has one map."""
        return self.config.layout != "random" or self.config.pool_size == 1

    @property
    def propositions(self) -> tuple[str, ...]:
        """The colours."""
        return self.config.colours

    @property
    def alphabet(self) -> Alphabet:
        """Every subset: balls overlap, so that the agent can touch several colours in the same step."""
        return "every_subset"

    @property
    def num_balls(self) -> int:
        """Balls of all colours."""
        return len(self.config.colours) * self.config.balls_per_colour

    @property
    def observation_size(self) -> int:
        """Four numbers for the agent and four for each ball: 68 with eight colours, 52 in the original world."""
        return 4 + 4 * self.num_balls

    @property
    def objects(self) -> Objects:
        """The balls: two numbers say where each is, seen from the agent, and two how it moves."""
        colours = range(len(self.config.colours))
        which = tuple(colour for colour in colours for _ in range(self.config.balls_per_colour))
        return Objects.blocks(range(4, 4 + 4 * self.num_balls, 4), 4, which, place=2)

    @property
    def action_size(self) -> int:
        """One: the number of the action. It may come as a scalar or with this shape, ``[1]``."""
        return 1

    @property
    def num_actions(self) -> int | None:
        """Five, see `NUM_ACTIONS`."""
        return NUM_ACTIONS

    @property
    def backend(self) -> str:
        """Name of the physics, which is straight flight."""
        return "straight_flight"

    def view(self) -> View:
        """The arena from above."""
        return make_view(self.config)

    def reset(self, rng: jax.Array, params: WaterWorldParams | None = None) -> State:
        """The start of an episode with the agent at rest.

        Args:
            rng: typed or legacy key; without effect on a fixed map.
            params: sizes, speeds and maps.
        """
        params = self._given(params)
        if params.starts is None:
            start = maps.random_map(rng, params.map_radius_of_each_ball(self.config.balls_per_colour), params)
        else:
            size = len(params.starts.agent)
            index = jax.random.randint(rng, (), 0, size) if size > 1 else 0
            start = Start(*(part[index] for part in params.starts))
        return self.reset_to(start.agent, jnp.zeros(2), start.balls, params.ball_speed * start.directions, params)

    def reset_to(
        self,
        agent_position: ArrayLike,
        agent_velocity: ArrayLike,
        ball_positions: ArrayLike,
        ball_velocities: ArrayLike,
        params: WaterWorldParams | None = None,
    ) -> State:
        """The start of an episode with the given motion. A contact that exists already is no onset.

        Args:
            agent_position: ``float[2]`` in units of length.
            agent_velocity: ``float[2]`` in units per second.
            ball_positions: ``float[n, 2]`` in units of length, the balls of a colour next to each other.
            ball_velocities: ``float[n, 2]`` in units per second.
            params: sizes and speeds.
        """
        params = self._given(params)
        moving = WaterWorldState(
            agent_position=jnp.asarray(agent_position, jnp.float32),
            agent_velocity=jnp.asarray(agent_velocity, jnp.float32),
            ball_positions=jnp.asarray(ball_positions, jnp.float32),
            ball_velocities=jnp.asarray(ball_velocities, jnp.float32),
            contact=jnp.zeros(self.num_balls, bool),
            events=jnp.zeros((1 + self.config.delay, len(self.propositions)), bool),
        )
        contact = self._contact(moving, params)
        events = moving.events
        if self.config.events == "level":
            events = events.at[-1].set(self._by_colour(contact))
        first = dataclasses.replace(moving, contact=contact, events=events)
        zero = jnp.zeros((), jnp.float32)
        return State(pipeline_state=first, obs=self._observe(first, params), reward=zero, done=zero)

    def step(self, state: State, action: jax.Array, params: WaterWorldParams | None = None) -> State:
        """The state one time step later. An action that is none of the five does nothing."""
        params = self._given(params)
        before: WaterWorldState = state.pipeline_state
        velocity = before.agent_velocity + params.increment * direction(action, before.agent_velocity.dtype)
        velocity = jnp.clip(velocity, -params.velocity_limit, params.velocity_limit)
        radii = params.radius_of_each_ball(self.config.balls_per_colour)[:, None]
        agent = _fly(before.agent_position, velocity, params.agent_radius, params)
        balls = _fly(before.ball_positions, before.ball_velocities, radii, params)
        after = dataclasses.replace(
            before,
            agent_position=agent[0],
            agent_velocity=agent[1],
            ball_positions=balls[0],
            ball_velocities=balls[1],
        )
        contact = self._contact(after, params)
        news = self._by_colour(contact & ~before.contact if self.config.events == "onset" else contact)
        events = jnp.concatenate([before.events[1:], news[None]])
        after = dataclasses.replace(after, contact=contact, events=events)
        return state.replace(
            pipeline_state=after,
            obs=self._observe(after, params),
            reward=jnp.zeros((), jnp.float32),
            done=jnp.zeros((), jnp.float32),
        )

    def labels(self, state: State) -> jax.Array:
        """Which colours' events hold, as `WaterWorldConfig.events` and ``delay`` define them: ``bool[P]``."""
        return state.pipeline_state.events[0]

    def _given(self, params: WaterWorldParams | None) -> WaterWorldParams:
        """The parameters as JAX arrays, which can be indexed by traced numbers; those of seed 0 for None."""
        return jax.tree.map(jnp.asarray, self.make_params(0) if params is None else params)

    def _contact(self, state: WaterWorldState, params: WaterWorldParams) -> jax.Array:
        """Which balls the agent touches, just touching included: ``bool[n]``."""
        offset = state.ball_positions - state.agent_position
        reach = params.agent_radius + params.radius_of_each_ball(self.config.balls_per_colour)
        return offset[:, 0] ** 2 + offset[:, 1] ** 2 <= reach**2

    def _by_colour(self, balls: jax.Array) -> jax.Array:
        """Which colours have such a ball: ``bool[n]`` to ``bool[P]``."""
        return balls.reshape(len(self.propositions), self.config.balls_per_colour).any(-1)

    def _observe(self, state: WaterWorldState, params: WaterWorldParams) -> jax.Array:
        """The agent's motion, then each ball's relative to it, all scaled: ``float32[observation_size]``."""
        agent = [state.agent_position / params.arena, state.agent_velocity / params.velocity_limit]
        offsets = (state.ball_positions - state.agent_position) / params.arena
        approach = (state.ball_velocities - state.agent_velocity) / (params.ball_speed + params.velocity_limit)
        return jnp.concatenate([*agent, jnp.concatenate([offsets, approach], axis=-1).reshape(-1)])


def direction(action: jax.Array, dtype: jnp.dtype) -> jax.Array:
    """Unit vector of an action, zero for none: ``[2]``. By comparison, which fuses where a lookup would not."""
    action = jnp.asarray(action).reshape(()).astype(jnp.int32)
    right, left, up, down = ((action == number).astype(dtype) for number in (2, 4, 1, 3))
    return jnp.stack([right - left, up - down])


def _fly(
    position: jax.Array, velocity: jax.Array, radius: jax.Array | np.ndarray, params: WaterWorldParams
) -> tuple[jax.Array, jax.Array]:
    """Move bodies for one time step and bounce them off the walls, each axis for itself.

    Beyond a wall a body is put back to touch it, and its velocity is reversed whichever way it was flying.
    """
    position = position + params.time_step * velocity
    low, high = position - radius < 0, position + radius > params.arena
    position = jnp.where(low, radius, jnp.where(high, params.arena - radius, position))
    return position, jnp.where(low | high, -velocity, velocity)
