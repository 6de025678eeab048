"""A hand-written WaterWorld player: what a learner should at least reach.

For each of the five actions it imagines that the agent keeps the velocity which the action gives it, and all balls
theirs. It then prefers to be near a wanted ball 0.8 seconds later, and not to come near an avoided one until then.
"""

import jax
import jax.numpy as jnp

from envs.waterworld.params import WaterWorldParams
from envs.waterworld.water_env import NUM_ACTIONS, WaterWorldState, direction

HORIZON = 0.8
"""Seconds ahead at which the distance to the nearest wanted ball counts."""

LOOK_OUT = 8
"""Moments up to the horizon at which the distance to avoided balls is looked at."""

MARGIN = 20.0
"""Units between the surfaces of agent and ball below which an avoided ball counts as near."""

PENALTY = 2.0
"""What one unit too near to an avoided ball costs at one moment, in units of distance to the wanted ball."""


def scripted_action(
    state: WaterWorldState, params: WaterWorldParams, wanted: jax.Array, avoided: jax.Array
) -> jax.Array:
    """The best of the five actions by imagining straight flight up to the horizon.

    Args:
        state: one unbatched state.
        params: sizes and speeds of its world.
        wanted: ``bool[P]``, colours to touch next. With none the agent only keeps away from the avoided ones.
        avoided: ``bool[P]``, colours not to touch.

    Returns:
        ``int32`` scalar, an action.
    """
    num_balls = len(state.ball_positions)
    per_colour = num_balls // len(wanted)
    wanted, avoided = (jnp.broadcast_to(x[:, None], (len(wanted), per_colour)).ravel() for x in (wanted, avoided))
    reach = params.agent_radius + params.radius_of_each_ball(per_colour)

    pushes = jax.vmap(lambda action: direction(action, reach.dtype))(jnp.arange(NUM_ACTIONS))
    velocities = state.agent_velocity + params.increment * pushes
    velocities = jnp.clip(velocities, -params.velocity_limit, params.velocity_limit)  # [5, 2]
    offsets = state.ball_positions - state.agent_position  # [n, 2]
    approach = state.ball_velocities - velocities[:, None]  # [5, n, 2]

    times = HORIZON * jnp.arange(1, LOOK_OUT + 1) / LOOK_OUT
    gaps = jnp.linalg.norm(offsets + times[:, None, None, None] * approach, axis=-1) - reach  # [times, 5, n]
    distance = jnp.where(wanted, gaps[-1], jnp.inf).min(-1)
    distance = jnp.where(wanted.any(), distance, 0.0)
    danger = jnp.where(avoided, jnp.maximum(MARGIN - gaps, 0.0), 0.0).sum((0, 2))
    return jnp.argmin(distance + PENALTY * danger).astype(jnp.int32)
