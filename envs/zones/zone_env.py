"""ZoneEnv: the Point robot among coloured discs, after LTL2Action, T2TL and DeepLTL, built on Safety-Gym.

The base reward is 0 and no episode ends by itself, a physics failure and leaving the open arena apart: what the discs
mean is up to the task. Observations are 12 body sensors and 16 lidar bins per colour, 76 numbers on T2TL's maps; there
is no position and no clock among them, and of the arena only how near the edge of the open one is, 4 numbers more.
"""

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct
from jax.typing import ArrayLike

from envs.streams import one_each, stream
from envs.zones import layouts, sensors
from envs.zones.config import ZoneConfig
from envs.zones.point_closed_form import ClosedFormPoint
from envs.zones.point_mjx import MjxPoint
from envs.zones.point_robot import EDGE, WALL, PointPhysics, PointState
from envs.zones.view import make_view
from t2tl_jax.env import Alphabet, LabelledEnv, Purpose, State
from t2tl_jax.objects import Objects
from t2tl_jax.view import View

FAILURE_REWARD = -10.0
"""Reward of a step whose physics fails, which also ends the episode."""

LEAVING_REWARD = -1.0
"""Reward of the step that leaves the open arena, which also ends the episode. It is no violation of a task."""


@struct.dataclass
class ZoneParams:
    """The maps that a reset chooses from."""

    starts: jax.Array | np.ndarray
    """``float32[m, 3]``: position and heading at the start; or ``float32[m, 2]``, and the heading is drawn."""
    zones: jax.Array | np.ndarray
    """``float32[m, n, 2]``: disc centres in metres."""


@struct.dataclass
class ZoneState:
    """Everything that changes from episode to episode or from step to step."""

    robot: PointState
    """Motion of the robot."""
    zones: jax.Array
    """``float32[n, 2]``: disc centres in metres."""

    @property
    def qpos(self) -> jax.Array:
        """``float32[..., 3]``: position of the robot in metres and its heading in radians."""
        return self.robot.qpos

    @property
    def qvel(self) -> jax.Array:
        """``float32[..., 3]``: velocity of the robot in m/s and its turning rate in rad/s."""
        return self.robot.qvel


class ZoneEnv(LabelledEnv):
    """One robot in one arena. Actions are ``float[2]`` in [-1, 1]: forward drive and turning rate.

    Args:
        config: physics, arena, senses and maps.

    Raises:
        ValueError: for maps that cannot be placed.
    """

    def __init__(self, config: ZoneConfig | None = None) -> None:
        self.config = config = config or ZoneConfig()
        colours = config.colour_of_each_disc
        self._physics = _make_physics(config)
        present = [letter for letter in layouts.COLOURS if letter in colours]
        self._propositions = tuple(layouts.COLOURS[letter] for letter in present)
        self._label_groups = tuple(_positions(colours, letter) for letter in present)
        self._lidar_groups = tuple(_positions(colours, letter) for letter in sorted(present))
        self._sensed, self._parts = _arrangement(tuple(layouts.COLOURS[letter] for letter in sorted(present)), config)
        self.make_params(0)  # discs that do not fit are refused here

    def make_params(self, seed: int, purpose: Purpose = "training") -> ZoneParams:
        """The fixed map, or a pool of random ones: another pool for every seed and purpose."""
        config = self.config
        if config.layout == "fixed":
            start, zones = np.array([layouts.FIXED_START]), np.array([layouts.FIXED_ZONES])
            return ZoneParams(starts=start.astype(np.float32), zones=zones.astype(np.float32))
        return self._pool(stream(config.pool_seed, seed, purpose), config.pool_size)

    @property
    def renewable(self) -> bool:
        """On random maps."""
        return self.config.layout == "random"

    def renewed_params(self, seed: int, renewal: int) -> ZoneParams:
        """Another pool of random maps for training."""
        return self._pool(stream(self.config.pool_seed, seed, "training", renewal), self.config.pool_size)

    def independent_params(self, seed: int, count: int) -> ZoneParams | None:
        """As many random maps; None on the fixed one."""
        if self.fixed_start:
            return None
        return one_each(self._pool(stream(self.config.pool_seed, seed, "certificate"), count))

    def _pool(self, which: tuple[int, ...], count: int) -> ZoneParams:
        config = self.config
        discs = len(config.colour_of_each_disc)
        pool = layouts.sample_layouts(discs, count, which, config.radius, config.keepout)
        return ZoneParams(starts=pool.robots, zones=pool.zones)

    @property
    def fixed_start(self) -> bool:
        """On the fixed map."""
        return self.config.layout == "fixed"

    @property
    def propositions(self) -> tuple[str, ...]:
        """Colours on the map, in the published order: Black, White, Red, Yellow on the fixed map."""
        return self._propositions

    @property
    def alphabet(self) -> Alphabet:
        """At most one: discs never overlap."""
        return "at_most_one"

    @property
    def observation_size(self) -> int:
        """76 on T2TL's maps: 12 body sensors and 16 bins for each of four colours; 80 in the open arena."""
        return max(part.stop for part in self._parts.values())

    @property
    def observation_parts(self) -> dict[str, slice]:
        """Where each part of an observation is.

        ``accelerometer``, ``gyro``, ``magnetometer``, ``velocimeter``; the lidar of each colour under its proposition;
        in the open arena ``edge``. In their order.
        """
        return dict(self._parts)

    @property
    def objects(self) -> Objects:
        """The colours, each as its lidar shows it."""
        starts = [self._parts[colour].start for colour in self._propositions]
        return Objects.blocks(starts, sensors.LIDAR_BINS, range(len(starts)))

    @property
    def action_size(self) -> int:
        """Two: forward drive and turning rate."""
        return 2

    @property
    def num_actions(self) -> int | None:
        """None: actions are continuous."""
        return None

    @property
    def backend(self) -> str:
        """Which physics moves the robot."""
        return self.config.physics

    def view(self) -> View:
        """The arena from above."""
        colours = tuple(layouts.COLOURS[letter] for letter in self.config.colour_of_each_disc)
        return make_view(colours, self.config.radius, EDGE if self._open else WALL)

    def reset(self, rng: jax.Array, params: ZoneParams | None = None) -> State:
        """A robot at rest: at the published start on the fixed map, or on a random map with a random heading."""
        params = self.make_params(0) if params is None else params
        starts, zones = jnp.asarray(params.starts), jnp.asarray(params.zones)
        if self.config.layout == "fixed":
            qpos, zones = starts[0], zones[0]
        else:
            map_key, heading_key = jax.random.split(rng)
            index = jax.random.randint(map_key, (), 0, len(starts))
            heading = jax.random.uniform(heading_key, (1,), jnp.float32, 0.0, 2.0 * jnp.pi)
            qpos, zones = jnp.concatenate([starts[index], heading])[:3], zones[index]
        # At rest, clear of the walls and without a command nothing accelerates: a reset needs no physics.
        robot = PointState(qpos=qpos, qvel=jnp.zeros(3, jnp.float32))
        return self._first_state(robot, zones, jnp.zeros(2, jnp.float32))

    def reset_to(self, qpos: ArrayLike, qvel: ArrayLike, zones: ArrayLike | None = None) -> State:
        """The state with the given motion, as if its last action had been zero.

        Args:
            qpos: ``float[3]`` position in metres and heading in radians.
            qvel: ``float[3]`` velocity in m/s and turning rate in rad/s.
            zones: ``float[n, 2]`` disc centres in metres; by default the fixed map, or the first one of seed 0's pool.

        Raises:
            ValueError: for discs that overlap, which the alphabet rules out. Traced `zones` cannot be checked.
        """
        if zones is None:
            zones = self.make_params(0).zones[0]
        elif not isinstance(zones, jax.core.Tracer):
            layouts.check_disjoint(np.asarray(zones), self.config.radius)
        robot = PointState(qpos=jnp.asarray(qpos, jnp.float32), qvel=jnp.asarray(qvel, jnp.float32))
        return self._first_state(
            robot, jnp.asarray(zones, jnp.float32), self._physics.acceleration(robot, jnp.zeros(2, jnp.float32))
        )

    def step(self, state: State, action: jax.Array, params: ZoneParams | None = None) -> State:
        """The state 20 ms later, on the map that the episode began on (`params` are not used).

        A physics failure (a state that is no longer finite) gives reward -10 and ends the episode; the robot is then
        left at rest where the step began, so that observations and labels stay meaningful; `failed` tells it. Leaving
        the open arena gives reward -1 and ends the episode.
        """
        del params
        before: ZoneState = state.pipeline_state
        with jax.named_scope("physics"):
            robot, acceleration = self._physics.step_and_acceleration(before.robot, action)
        failed = ~jnp.isfinite(jnp.concatenate([robot.qpos, robot.qvel, acceleration])).all()
        at_rest = PointState(qpos=before.qpos, qvel=jnp.zeros_like(before.qvel))
        robot = jax.tree.map(lambda safe, new: jnp.where(failed, safe, new), at_rest, robot)
        acceleration = jnp.where(failed, 0.0, acceleration)
        left = (jnp.abs(robot.qpos[:2]) >= EDGE).any() & ~failed if self._open else jnp.zeros_like(failed)
        return state.replace(
            pipeline_state=ZoneState(robot=robot, zones=before.zones),
            obs=self._observe(robot, before.zones, acceleration, sensors.edge_sensor(robot.qpos[:2])),
            reward=jnp.where(failed, FAILURE_REWARD, jnp.where(left, LEAVING_REWARD, 0.0)).astype(jnp.float32),
            done=(failed | left).astype(jnp.float32),
        )

    def labels(self, state: State) -> jax.Array:
        """Which colours the robot's origin stands in, within the radius, inclusive: ``bool[P]``."""
        zone_state: ZoneState = state.pipeline_state
        return sensors.inside(zone_state.qpos, zone_state.zones, self._label_groups, self.config.radius)

    def failed(self, state: State) -> jax.Array:
        """Whether the physics failed in the step that led to `state`, which nothing else is paid nearly so little
        for, whatever a wrapper adds."""
        return state.reward < 0.5 * FAILURE_REWARD

    @property
    def _open(self) -> bool:
        return self.config.arena == "open"

    def _first_state(self, robot: PointState, zones: jax.Array, acceleration: jax.Array) -> State:
        """The state that begins an episode."""
        return State(
            pipeline_state=ZoneState(robot=robot, zones=zones),
            obs=self._observe(robot, zones, acceleration, jnp.zeros(sensors.EDGE_SENSORS, jnp.float32)),
            reward=jnp.zeros((), jnp.float32),
            done=jnp.zeros((), jnp.float32),
        )

    def _observe(self, robot: PointState, zones: jax.Array, acceleration: jax.Array, edge: jax.Array) -> jax.Array:
        """All that is sensed, in the order of `observation_parts`: ``float32[observation_size]``."""
        config = self.config
        lidars = sensors.lidar(robot.qpos, zones, self._lidar_groups, config.lidar_gain, config.lidar_range)
        body = sensors.body_sensors(robot, acceleration)
        if not self._open:
            return jnp.concatenate([body, lidars])
        sensed = jnp.concatenate([body, lidars, edge])
        return jnp.concatenate([sensed[part] for part in self._sensed])


def _make_physics(config: ZoneConfig) -> PointPhysics:
    """What moves the robot."""
    walls = config.arena == "walled"
    return MjxPoint(walls) if config.physics == "mjx" else ClosedFormPoint(walls)


def _arrangement(colours: tuple[str, ...], config: ZoneConfig) -> tuple[tuple[slice, ...], dict[str, slice]]:
    """How the sensors become an observation.

    In the walled arena that is body sensors, then lidars. In the open one, as published, the parts are in the order of
    their names (those of the lidars begin with their colour's, in small letters), and the edge comes last.

    Args:
        colours: propositions of the lidars, in their order.
        config: which arena it is.

    Returns:
        What is taken, one after the other, from body sensors, lidars and edge; and where each part then is, by name.
    """
    sizes = dict.fromkeys(sensors.BODY_SENSORS, 3) | dict.fromkeys(colours, sensors.LIDAR_BINS)
    order = list(sizes)
    if config.arena == "open":
        order = [*sorted(sizes, key=str.lower), "edge"]
        sizes["edge"] = sensors.EDGE_SENSORS
    sensed = _one_after_the_other(sizes, list(sizes))
    return tuple(sensed[name] for name in order), _one_after_the_other(sizes, order)


def _one_after_the_other(sizes: dict[str, int], order: list[str]) -> dict[str, slice]:
    """Slices of these sizes by name, without gaps."""
    parts, end = {}, 0
    for name in order:
        parts[name] = slice(end, end := end + sizes[name])
    return parts


def _positions(colours: str, letter: str) -> tuple[int, ...]:
    """Indices of the discs of one colour."""
    return tuple(i for i, colour in enumerate(colours) if colour == letter)
