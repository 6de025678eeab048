"""ZoneEnv: the Point robot among coloured discs, after the environment of LTL2Action and T2TL built on Safety-Gym.

The base reward is 0 and no episode ends by itself (a physics failure apart): what the discs mean is up to the task.
Observations are 12 body sensors and 16 lidar bins per colour, 76 numbers on the published maps; there is no position,
no walls and no clock among them.
"""

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct
from jax.typing import ArrayLike

from envs.zones import layouts, sensors
from envs.zones.config import ZoneConfig
from envs.zones.point_closed_form import ClosedFormPoint
from envs.zones.point_mjx import MjxPoint
from envs.zones.point_robot import PointPhysics, PointState
from envs.zones.view import make_view
from t2tl_jax.env import Alphabet, LabelledEnv, Purpose, State
from t2tl_jax.view import View

FAILURE_REWARD = -10.0
"""Reward of a step whose physics fails, which also ends the episode."""


@struct.dataclass
class ZoneParams:
    """The maps that a reset chooses from."""

    starts: jax.Array | np.ndarray
    """``float32[m, 3]``: position and heading at the start; or ``float32[m, 2]``, and the heading is drawn."""
    zones: jax.Array | np.ndarray
    """``float32[m, n, 2]``: disc centres in metres."""


POOLS: dict[Purpose, int] = {"training": 1, "evaluation": 0, "selection": 2}
"""What random maps are drawn by, beside the seed."""


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
        config: physics and maps.

    Raises:
        ValueError: for maps that cannot be placed.
    """

    def __init__(self, config: ZoneConfig | None = None) -> None:
        self.config = config = config or ZoneConfig()
        colours = config.colour_of_each_disc
        self._physics = _make_physics(config.physics)
        present = [letter for letter in layouts.COLOURS if letter in colours]
        self._propositions = tuple(layouts.COLOURS[letter] for letter in present)
        self._label_groups = tuple(_positions(colours, letter) for letter in present)
        self._lidar_groups = tuple(_positions(colours, letter) for letter in sorted(present))
        self.make_params(0)  # discs that do not fit are refused here

    def make_params(self, seed: int, purpose: Purpose = "training") -> ZoneParams:
        """The fixed map, or a pool of random ones: another pool for every seed and purpose."""
        config = self.config
        if config.layout == "fixed":
            start, zones = np.array([layouts.FIXED_START]), np.array([layouts.FIXED_ZONES])
            return ZoneParams(starts=start.astype(np.float32), zones=zones.astype(np.float32))
        which = (config.pool_seed, seed, POOLS[purpose])
        pool = layouts.sample_layouts(len(config.colour_of_each_disc), config.pool_size, which)
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
        """76 on the published maps: 12 body sensors and 16 bins for each of four colours."""
        return 12 + sensors.LIDAR_BINS * len(self._lidar_groups)

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
        return make_view(tuple(layouts.COLOURS[letter] for letter in self.config.colour_of_each_disc))

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
            qpos, zones = jnp.concatenate([starts[index], heading]), zones[index]
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
            layouts.check_disjoint(np.asarray(zones))
        robot = PointState(qpos=jnp.asarray(qpos, jnp.float32), qvel=jnp.asarray(qvel, jnp.float32))
        return self._first_state(
            robot, jnp.asarray(zones, jnp.float32), self._physics.acceleration(robot, jnp.zeros(2, jnp.float32))
        )

    def step(self, state: State, action: jax.Array, params: ZoneParams | None = None) -> State:
        """The state 20 ms later, on the map that the episode began on (`params` are not used).

        A physics failure (a state that is no longer finite) gives reward -10 and ends the episode; the robot is then
        left at rest where the step began, so that observations and labels stay meaningful.
        """
        del params
        before: ZoneState = state.pipeline_state
        robot, acceleration = self._physics.step_and_acceleration(before.robot, action)
        failed = ~jnp.isfinite(jnp.concatenate([robot.qpos, robot.qvel, acceleration])).all()
        at_rest = PointState(qpos=before.qpos, qvel=jnp.zeros_like(before.qvel))
        robot = jax.tree.map(lambda safe, new: jnp.where(failed, safe, new), at_rest, robot)
        acceleration = jnp.where(failed, 0.0, acceleration)
        return state.replace(
            pipeline_state=ZoneState(robot=robot, zones=before.zones),
            obs=self._observe(robot, before.zones, acceleration),
            reward=jnp.where(failed, FAILURE_REWARD, 0.0).astype(jnp.float32),
            done=failed.astype(jnp.float32),
        )

    def labels(self, state: State) -> jax.Array:
        """Which colours the robot's origin stands in, within 0.25 m inclusive: ``bool[P]``."""
        zone_state: ZoneState = state.pipeline_state
        return sensors.inside(zone_state.qpos, zone_state.zones, self._label_groups)

    def _first_state(self, robot: PointState, zones: jax.Array, acceleration: jax.Array) -> State:
        """The state that begins an episode."""
        return State(
            pipeline_state=ZoneState(robot=robot, zones=zones),
            obs=self._observe(robot, zones, acceleration),
            reward=jnp.zeros((), jnp.float32),
            done=jnp.zeros((), jnp.float32),
        )

    def _observe(self, robot: PointState, zones: jax.Array, acceleration: jax.Array) -> jax.Array:
        """Body sensors, then the lidars in the alphabetical order of their letters: ``float32[observation_size]``."""
        lidars = sensors.lidar(robot.qpos, zones, self._lidar_groups)
        return jnp.concatenate([sensors.body_sensors(robot, acceleration), lidars])


def _make_physics(name: str) -> PointPhysics:
    """What moves the robot."""
    return MjxPoint() if name == "mjx" else ClosedFormPoint()


def _positions(colours: str, letter: str) -> tuple[int, ...]:
    """Indices of the discs of one colour."""
    return tuple(i for i, colour in enumerate(colours) if colour == letter)
