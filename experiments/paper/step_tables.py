"""The worlds of the paper's tables of steps: sub-goals, obstacles and the obstacles' size, in WaterWorld.

The paper fixes the colours of five sub-goals and three obstacles only; which ones the others have is our choice, as in
`PAPER_TASKS`. "Size" is read as the radius of the obstacles' balls. All sizes are on the maps that the largest one is
valid on, so that only the radius differs between them.
"""

from dataclasses import dataclass, replace

from envs.waterworld import COLOURS, WaterWorldConfig
from envs.waterworld.params import RADIUS
from t2tl_jax.runs.config import Config

SIZES = (1.0, 1.5, 2.5)
"""Radius of the obstacles, over that of the other balls."""

LIMITS = (600, 1000)
"""Steps after which an episode is cut: of the original world, and one that the published means do not exceed."""


@dataclass(frozen=True)
class Cell:
    """One world of the tables, with the published average steps: mean and a spread that is not said what it is."""

    goals: int
    obstacles: int
    size: float
    published: dict[str, tuple[float, float]]

    @property
    def task(self) -> str:
        """Name of the formula."""
        return f"phi_water_{self.goals}_{self.obstacles}"


def _published(
    t1tl: tuple[float, float], gnn: tuple[float, float], rm: tuple[float, float]
) -> dict[str, tuple[float, float]]:
    return {"t1tl": t1tl, "gnn": gnn, "rm": rm}


BY_GOALS = (
    Cell(4, 1, 1.0, _published((189.46, 1.98), (191.71, 3.25), (207.21, 8.03))),
    Cell(5, 1, 1.0, _published((236.50, 4.49), (253.26, 6.57), (259.13, 3.06))),
    Cell(6, 1, 1.0, _published((609.82, 15.73), (628.29, 21.92), (659.32, 6.39))),
)
BY_OBSTACLES = (
    BY_GOALS[1],
    Cell(5, 2, 1.0, _published((286.77, 5.21), (310.50, 6.24), (322.56, 13.47))),
    Cell(5, 3, 1.0, _published((421.31, 8.32), (468.73, 9.02), (489.07, 14.17))),
)
BY_SIZE = (
    # The same world as above but for the maps; this table prints another spread of rm.
    replace(BY_OBSTACLES[1], published={**BY_OBSTACLES[1].published, "rm": (322.56, 9.47)}),
    Cell(5, 2, 1.5, _published((291.94, 2.18), (305.85, 8.04), (338.57, 10.24))),
    Cell(5, 2, 2.5, _published((269.88, 5.00), (276.34, 7.48), (300.78, 12.20))),
)


def configuration(base: Config, cell: Cell, same_maps: bool) -> Config:
    """The configuration of one cell.

    Args:
        base: in WaterWorld with T2TL's colours, such as ``waterworld_dqn``.
        cell: of `BY_GOALS`, `BY_OBSTACLES` or `BY_SIZE`.
        same_maps: on the maps that all of `SIZES` share, as `BY_SIZE` is to be compared.

    Raises:
        ValueError: for an environment that is no WaterWorld with these colours.
    """
    world = base.env
    if not isinstance(world, WaterWorldConfig) or world.colours != COLOURS:
        raise ValueError(f"the tables are about T2TL's WaterWorld, got {world}; take waterworld_dqn")
    avoided = COLOURS[5 : 5 + cell.obstacles]

    def radii(size: float) -> tuple[float, ...]:
        return tuple(RADIUS * (size if colour in avoided else 1.0) for colour in COLOURS)

    world = replace(world, radii=radii(cell.size), map_radii=radii(max(SIZES)) if same_maps else ())
    return replace(base, env=world, task=cell.task)
