"""WaterWorld: an agent among coloured balls that fly straight and bounce off the walls, after Toro Icarte et al.

The agent changes its velocity in four directions; bodies pass through each other, and what counts is which colours it
touches. The transition is deterministic, the base reward is 0 and no episode ends by itself: what the colours mean is
up to the task. Defaults are the eight colours of T2TL with the physical constants of the reward-machine publication.

Where the original program is odd, this is what happens here:

- It reports a touch one step late: ``delay=1`` does the same, the default is ``delay=0``.
- It reports only the onset of a contact: so does the default, and ``events="level"`` reports a contact while it lasts.
- A body may start overlapping the far walls: kept, because its maps depend on it.
- One start for all episodes of a run: the default, ``layout="random"`` draws another at every reset.
- From the second episode on the agent starts with the velocity of a former action: left out, it starts at rest.
- Touched balls can be placed anew: left out, no published experiment uses it.
- Rewards of its tasks, what its time limit means and how it explores belong to tasks and learners, not to the world.
"""

import copy
import dataclasses
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct
from jax.typing import ArrayLike

from envs.waterworld import maps
from envs.waterworld.maps import Start
from envs.waterworld.params import ARENA, RADIUS, SPEED, TIME_STEP, VELOCITY_LIMIT, WaterWorldParams
from t2tl_jax.env import Alphabet, LabelledEnv, State

EPISODE_LENGTH = 600
"""Published limit of an episode, in environment steps. Applied outside: the environment itself never ends."""

NUM_ACTIONS = 5
"""0 nothing, 1 up (+y), 2 right (+x), 3 down (-y), 4 left (-x)."""

COLOURS = ("Yellow", "Purple", "Magenta", "Orange", "Gray", "Pink", "Green", "Blue")
"""Colours of T2TL's world, in the order of balls and propositions."""

LETTERS = ("a", "b", "c", "d", "e", "f")
"""Colours of the original world under their names there: red, green, blue, yellow, cyan, magenta."""


@dataclasses.dataclass(frozen=True)
class WaterWorldConfig:
    """What distinguishes one WaterWorld from another. The unit of length is a 400th of the original arena."""

    colours: tuple[str, ...] = COLOURS
    """Names of the colours, which are the propositions; the balls of a colour follow each other in this order."""
    balls_per_colour: int = 2
    """How many balls each colour has."""
    layout: Literal["fixed", "by_seed", "random"] = "fixed"
    """Every episode starts on the numbered map, on the map whose number is the seed of the run, or on a new random one.
    By seed, the seeds 1,2,3,4 of one run train on the maps 1 to 4 side by side."""
    map_number: int = 1
    """Which map, if fixed: what the original draws from this seed. Its experiments use 1 to 10 (with six colours)."""
    pool_size: int = 1024
    """Random layouts and those by seed are among the maps 0 to pool_size - 1; with 0 random ones are drawn anew, which
    costs more."""
    events: Literal["onset", "level"] = "onset"
    """A colour is true in the step in which contact with a ball of it begins, or as long as it lasts."""
    delay: Literal[0, 1] = 0
    """Steps by which labels come late: 0, or 1 as in the original."""
    radii: tuple[float, ...] = ()
    """Radius of each colour's balls; empty means 15 for all."""
    agent_radius: float = RADIUS
    """Radius of the agent."""
    arena: tuple[float, float] = (ARENA, ARENA)
    """Width and height."""
    ball_speed: float = SPEED
    """Speed of the balls, in units per second."""
    increment: float = SPEED
    """What an action adds to the velocity on its axis, in units per second."""
    velocity_limit: float = VELOCITY_LIMIT
    """Largest velocity of the agent on each axis, in units per second."""
    time_step: float = TIME_STEP
    """Seconds that one step takes."""


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
    params: WaterWorldParams
    """Sizes and speeds of this environment."""


class WaterWorld(LabelledEnv):
    """One agent among balls. An action is an ``int32`` scalar below 5, see `NUM_ACTIONS`.

    Args:
        config: colours, map, events and sizes.
        params: numbers to use in place of the configuration's, possibly traced. Numbered maps stay where the
            configuration's sizes put them.

    Raises:
        ValueError: for a configuration without meaning, or balls that cannot be placed.
    """

    def __init__(self, config: WaterWorldConfig | None = None, params: WaterWorldParams | None = None) -> None:
        self.config = config = config or WaterWorldConfig()
        _check_config(config)
        self._params = params
        self._starts: Start | None = None
        radii = [radius for radius in _radii(config) for _ in range(config.balls_per_colour)]
        if config.layout == "fixed":
            self._starts = maps.map_pool(config.map_number, 1, radii, config.agent_radius, config.arena)
        elif config.pool_size:
            self._starts = maps.map_pool(0, config.pool_size, radii, config.agent_radius, config.arena)

    def for_seed(self, seed: jax.Array) -> "WaterWorld":
        """The world in which the run of this seed takes place; `seed` may be traced."""
        if self.config.layout != "by_seed":
            return self
        assert self._starts is not None  # there is a pool, which the configuration's check made sure of
        mine = copy.copy(self)
        mine._starts = Start(*(jnp.asarray(part, jnp.float32)[seed][None] for part in self._starts))
        return mine

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

    @property
    def params(self) -> WaterWorldParams:
        """The numbers that a reset uses unless it is given others."""
        if self._params is not None:
            return self._params
        config = self.config
        return WaterWorldParams(
            arena=jnp.asarray(config.arena, jnp.float32),
            time_step=jnp.float32(config.time_step),
            ball_speed=jnp.float32(config.ball_speed),
            increment=jnp.float32(config.increment),
            velocity_limit=jnp.float32(config.velocity_limit),
            agent_radius=jnp.float32(config.agent_radius),
            ball_radius=jnp.asarray(_radii(config), jnp.float32),
        )

    def reset(self, rng: jax.Array, params: WaterWorldParams | None = None) -> State:
        """The start of an episode with the agent at rest.

        Args:
            rng: typed or legacy key; without effect on a fixed map.
            params: sizes and speeds of this episode; by default those of the environment.
        """
        params = self.params if params is None else params
        if self._starts is None:
            start = maps.random_map(rng, params.radius_of_each_ball(self.config.balls_per_colour), params)
        else:
            size = len(self._starts.agent)
            index = jax.random.randint(rng, (), 0, size) if self.config.layout == "random" and size > 1 else 0
            start = Start(*(jnp.asarray(part, jnp.float32)[index] for part in self._starts))
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
            params: sizes and speeds of this episode; by default those of the environment.
        """
        moving = WaterWorldState(
            agent_position=jnp.asarray(agent_position, jnp.float32),
            agent_velocity=jnp.asarray(agent_velocity, jnp.float32),
            ball_positions=jnp.asarray(ball_positions, jnp.float32),
            ball_velocities=jnp.asarray(ball_velocities, jnp.float32),
            contact=jnp.zeros(self.num_balls, bool),
            events=jnp.zeros((1 + self.config.delay, len(self.propositions)), bool),
            params=self.params if params is None else params,
        )
        contact = self._contact(moving)
        events = moving.events
        if self.config.events == "level":
            events = events.at[-1].set(self._by_colour(contact))
        first = dataclasses.replace(moving, contact=contact, events=events)
        zero = jnp.zeros((), jnp.float32)
        return State(pipeline_state=first, obs=self._observe(first), reward=zero, done=zero)

    def step(self, state: State, action: jax.Array) -> State:
        """The state one time step later. An action that is none of the five does nothing."""
        before: WaterWorldState = state.pipeline_state
        params = before.params
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
        contact = self._contact(after)
        news = self._by_colour(contact & ~before.contact if self.config.events == "onset" else contact)
        events = jnp.concatenate([before.events[1:], news[None]])
        after = dataclasses.replace(after, contact=contact, events=events)
        return state.replace(
            pipeline_state=after,
            obs=self._observe(after),
            reward=jnp.zeros((), jnp.float32),
            done=jnp.zeros((), jnp.float32),
        )

    def labels(self, state: State) -> jax.Array:
        """Which colours' events hold, as `WaterWorldConfig.events` and ``delay`` define them: ``bool[P]``."""
        return state.pipeline_state.events[0]

    def _contact(self, state: WaterWorldState) -> jax.Array:
        """Which balls the agent touches, just touching included: ``bool[n]``."""
        offset = state.ball_positions - state.agent_position
        reach = state.params.agent_radius + state.params.radius_of_each_ball(self.config.balls_per_colour)
        return offset[:, 0] ** 2 + offset[:, 1] ** 2 <= reach**2

    def _by_colour(self, balls: jax.Array) -> jax.Array:
        """Which colours have such a ball: ``bool[n]`` to ``bool[P]``."""
        return balls.reshape(len(self.propositions), self.config.balls_per_colour).any(-1)

    def _observe(self, state: WaterWorldState) -> jax.Array:
        """The agent's motion, then each ball's relative to it, all scaled: ``float32[observation_size]``."""
        params = state.params
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
    position: jax.Array, velocity: jax.Array, radius: jax.Array, params: WaterWorldParams
) -> tuple[jax.Array, jax.Array]:
    """Move bodies for one time step and bounce them off the walls, each axis for itself.

    Beyond a wall a body is put back to touch it, and its velocity is reversed whichever way it was flying.
    """
    position = position + params.time_step * velocity
    low, high = position - radius < 0, position + radius > params.arena
    position = jnp.where(low, radius, jnp.where(high, params.arena - radius, position))
    return position, jnp.where(low | high, -velocity, velocity)


def _radii(config: WaterWorldConfig) -> tuple[float, ...]:
    """Radius of each colour's balls."""
    return config.radii or (RADIUS,) * len(config.colours)


def _check_config(config: WaterWorldConfig) -> None:
    """Refuse a configuration without meaning with a ValueError that says what to change."""
    if config.layout not in ("fixed", "by_seed", "random"):
        raise ValueError(f"layout is {config.layout!r}; it must be 'fixed', 'by_seed' or 'random'")
    if config.layout == "by_seed" and not config.pool_size:
        raise ValueError("layout='by_seed' takes its maps from the pool; pool_size must be larger than every seed")
    if config.events not in ("onset", "level"):
        raise ValueError(f"events is {config.events!r}; it must be 'onset' or 'level'")
    if config.delay not in (0, 1):
        raise ValueError(f"delay is {config.delay!r}; it must be 0 or 1")
    if not config.colours or len(set(config.colours)) < len(config.colours):
        raise ValueError(f"colours are {config.colours}; they must be one or more different names")
    if config.balls_per_colour < 1:
        raise ValueError(f"balls_per_colour is {config.balls_per_colour}; every colour needs at least one ball")
    if config.pool_size < 0:
        raise ValueError(f"pool_size is {config.pool_size}; it must be 0 (no pool) or more")
    if len(_radii(config)) != len(config.colours):
        raise ValueError(f"radii has {len(config.radii)} entries for {len(config.colours)} colours")
    lengths = (*_radii(config), config.agent_radius, *config.arena, config.time_step)
    if min(lengths) <= 0 or not np.isfinite(lengths).all():
        raise ValueError("radii, arena and time_step must be positive and finite")
    speeds = (config.ball_speed, config.increment, config.velocity_limit)
    if min(speeds) < 0 or config.ball_speed + config.velocity_limit <= 0 or not np.isfinite(speeds).all():
        raise ValueError("ball_speed, increment and velocity_limit must not be negative, and finite")
    if config.velocity_limit == 0:
        raise ValueError("velocity_limit is 0; the observation is scaled by it, so it must be positive")
    if 2 * max(*_radii(config), config.agent_radius) >= min(config.arena):
        raise ValueError(f"the largest body does not fit into an arena of {config.arena[0]:g} x {config.arena[1]:g}")
