"""How a ZoneEnv looks from above."""

import jax.numpy as jnp

from envs.zones.point_robot import SPHERE_RADIUS, SUBSTEPS, TIMESTEP
from t2tl_jax.view import Scene, View


def make_view(colours: tuple[str, ...], radius: float, edge: float) -> View:
    """Discs of these colours and this radius, and the robot with its heading as its nose.

    Args:
        colours: of the discs.
        radius: of the discs, in metres.
        edge: where the picture ends, in metres from the centre.
    """

    def scene(state, params) -> Scene:
        del params  # the map of an episode is part of its state
        heading = state.qpos[2]
        return Scene(
            discs=state.zones,
            radii=jnp.full(len(state.zones), radius),
            agent=state.qpos[:2],
            heading=jnp.stack([jnp.cos(heading), jnp.sin(heading)]),
        )

    return View(
        scene=scene,
        low=(-edge, -edge),
        high=(edge, edge),
        colours=colours,
        agent_radius=SPHERE_RADIUS,
        agent_colour=(90, 140, 240),
        seconds_per_step=SUBSTEPS * TIMESTEP,
    )
