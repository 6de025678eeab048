"""How WaterWorld looks from above."""

import jax.numpy as jnp

from envs.waterworld.config import LETTERS, WaterWorldConfig
from envs.waterworld.params import WaterWorldParams
from t2tl_jax.view import Scene, View

ORIGINAL_COLOURS = dict(zip(LETTERS, ("Red", "Green", "Blue", "Yellow", "Cyan", "Magenta"), strict=True))
"""What the letters of the original world stand for."""


def make_view(config: WaterWorldConfig) -> View:
    """The balls in their colours, and the agent with its velocity as its nose."""

    def scene(state, params: WaterWorldParams) -> Scene:
        return Scene(
            discs=state.ball_positions,
            radii=params.radius_of_each_ball(config.balls_per_colour),
            agent=state.agent_position,
            heading=state.agent_velocity / jnp.asarray(params.velocity_limit) / 2**0.5,  # the limit is on each axis
        )

    return View(
        scene=scene,
        low=(0.0, 0.0),
        high=config.arena,
        colours=tuple(
            ORIGINAL_COLOURS.get(name, name) for name in config.colours for _ in range(config.balls_per_colour)
        ),
        agent_radius=config.agent_radius,
        agent_colour=(255, 255, 255),
        seconds_per_step=config.time_step,
    )
