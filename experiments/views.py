"""How each environment looks from above, for its animation."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from envs.waterworld import LETTERS, WaterWorld, WaterWorldState
from envs.zones import ZoneEnv, ZoneState
from envs.zones import sensors as zone_sensors
from t2tl_jax.evaluation.animation import Scene, View

ORIGINAL_COLOURS = dict(zip(LETTERS, ("Red", "Green", "Blue", "Yellow", "Cyan", "Magenta"), strict=True))
"""What the letters of the original WaterWorld stand for."""


def view_of(task_env: Any) -> View | None:
    """The view of the environment inside a ``TaskEnv``; None for one that has none."""
    env = getattr(task_env, "env", None)
    if isinstance(env, ZoneEnv):
        return _zone_view(env)
    if isinstance(env, WaterWorld):
        return _water_view(env)
    return None


def _zone_view(env: ZoneEnv) -> View:
    def scene(state: ZoneState) -> Scene:
        heading = state.qpos[2]
        return Scene(
            discs=state.zones,
            radii=jnp.full(len(state.zones), zone_sensors.ZONE_RADIUS),
            agent=state.qpos[:2],
            heading=jnp.stack([jnp.cos(heading), jnp.sin(heading)]),
        )

    return View(
        scene=scene,
        low=(-2.4, -2.4),
        high=(2.4, 2.4),
        colours=_zone_colours(env),
        agent_radius=0.1,
        agent_colour=(90, 140, 240),
        seconds_per_step=0.02,
    )


def _zone_colours(env: ZoneEnv) -> tuple[str, ...]:
    """The proposition that holds at the centre of each disc; the same on every map."""
    zones = env.reset(jax.random.key(0)).pipeline_state.zones

    def labels_at(centre: jax.Array) -> jax.Array:
        return env.labels(env.reset_to(jnp.append(centre, 0.0), jnp.zeros(3), zones))

    labels = np.asarray(jax.jit(jax.vmap(labels_at))(zones))
    return tuple(env.propositions[int(np.argmax(row))] for row in labels)


def _water_view(env: WaterWorld) -> View:
    config = env.config

    def scene(state: WaterWorldState) -> Scene:
        return Scene(
            discs=state.ball_positions,
            radii=state.params.radius_of_each_ball(config.balls_per_colour),
            agent=state.agent_position,
            heading=state.agent_velocity / state.params.velocity_limit / 2**0.5,
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
