"""How LetterWorld looks from above."""

import jax.numpy as jnp

from envs.letterworld.config import LetterWorldConfig
from t2tl_jax.view import Scene, View


def make_view(config: LetterWorldConfig) -> View:
    """A disc for each letter, with row 0 at the top, and the agent on it."""
    size, discs = config.size, config.num_taken

    def centre(row, column):
        return jnp.stack([column + 0.5, size - 0.5 - row], axis=-1).astype(jnp.float32)

    def scene(state, params) -> Scene:
        del params  # the map of an episode is part of its state
        rows, columns = (jnp.arange(size) - state.position[:, None] + size // 2) % size
        held = state.seen[rows[:, None], columns].reshape(-1)
        cells = jnp.argsort(jnp.where(held < 0, len(config.letters), held.astype(jnp.int32)))[:discs]  # stable
        return Scene(
            discs=centre(cells // size, cells % size),
            radii=jnp.full(discs, 0.42),
            agent=centre(*state.position),
            heading=jnp.zeros(2),
        )

    names = tuple(letter for letter in config.letters for _ in range(config.copies))
    return View(
        scene=scene,
        low=(0.0, 0.0),
        high=(float(size), float(size)),
        colours=("White",) * discs,
        agent_radius=0.2,
        agent_colour=(90, 140, 240),
        seconds_per_step=0.0,
        texts=names,
        joined=True,
        frame_ms=250,
    )
