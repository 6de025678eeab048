"""How FlatWorld looks from above."""

import jax.numpy as jnp
import numpy as np

from envs.flatworld.config import EDGE, REGIONS
from t2tl_jax.view import Scene, View


def make_view() -> View:
    """The discs in their colours, and the agent."""
    centres = np.array([(x, y) for _, x, y, _ in REGIONS], np.float32)
    radii = np.array([radius for *_, radius in REGIONS], np.float32)

    def scene(state, params) -> Scene:
        del params
        return Scene(discs=jnp.asarray(centres), radii=jnp.asarray(radii), agent=state.position, heading=jnp.zeros(2))

    return View(
        scene=scene,
        low=(-EDGE, -EDGE),
        high=(EDGE, EDGE),
        colours=tuple(colour for colour, *_ in REGIONS),
        agent_radius=0.06,
        agent_colour=(255, 255, 255),
        seconds_per_step=0.0,
    )
