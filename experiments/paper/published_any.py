"""Agents of others on formulas that these were not trained on: success, and mean steps of the successes.

DeepLTL, RAD, GCRL-LTL and LTL2Action in DeepLTL's worlds are computed from result files in DeepLTL's repository (commit
3157200): five seeds with 500 episodes each, deterministic in ZoneEnv and sampled elsewhere. GenZ-LTL are its five
shipped models (commit 2f7706c), which this project's authors played on 500 maps each in the closed form of the same
physics, with its rules written again; ``discounted`` is their mean of 0.998 ** steps, 0 for an episode that fails.
What these episodes were is not stored. LTL2Action in its own walled world is read off a figure.
"""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Published:
    """One figure of one method."""

    success: float | None
    steps: float | None = None
    discounted: float | None = None
    """Mean discounted return."""

    def text(self) -> str:
        """For a cell."""
        parts = (
            "" if self.success is None else f"{self.success:.3f}",
            "" if self.steps is None else f"{self.steps:.4g}",
            "" if self.discounted is None else f"return {self.discounted:.3f}",
        )
        return ", ".join(part for part in parts if part)


def mean_of(cells: Sequence[Published]) -> Published | None:
    """The mean over tasks; None where one has no success, and no steps where one has none."""
    successes = [cell.success for cell in cells if cell.success is not None]
    steps = [cell.steps for cell in cells if cell.steps is not None]
    if not cells or len(successes) < len(cells):
        return None
    return Published(sum(successes) / len(cells), sum(steps) / len(cells) if len(steps) == len(cells) else None)


def _each(names: tuple[str, ...], *cells: tuple[float, float]) -> dict[str, Published]:
    return {name: Published(*cell) for name, cell in zip(names, cells, strict=True)}


_Z = ("z1", "z2", "z3", "z4", "z5", "z6")

ZONES = {
    "GenZ-LTL": _each(
        (*_Z, "g1", "g2", "g3", "g4", "long", "j8", "j10", "s7", "s8"),
        *((0.975, 314), (0.992, 286), (0.999, 266), (0.980, 191), (0.994, 185), (0.994, 96)),
        *((0.963, 452), (0.889, 476), (0.970, 434), (0.989, 394), (0.674, 512), (0.958, 295), (0.940, 400)),
        *((0.993, 173), (0.997, 357)),
    ),
    "DeepLTL": _each(
        (*_Z, "long"),
        *((0.922, 303), (0.912, 300), (0.962, 260), (0.901, 203), (0.912, 187), (0.978, 106), (0.943, 322)),
    ),
    "RAD": _each(
        (*_Z, "long"),
        *((0.940, 470), (0.881, 474), (0.961, 399), (0.917, 305), (0.866, 337), (0.987, 149), (0.655, 490)),
    ),
    "GCRL-LTL": _each(_Z, (0.852, 452), (0.847, 451), (0.892, 450), (0.872, 303), (0.851, 291), (0.894, 137)),
    "LTL2Action": _each(_Z, (0.595, 424), (0.142, 417), (0.667, 414), (0.690, 332), (0.660, 293), (0.930, 124)),
}
"""The open ZoneEnv, by method and task."""

ZONES_DISCOUNTED = {"GenZ-LTL": {"z1 to z6": 0.646}}
"""Over several tasks."""

ZONES_ON_MAPS = {"GenZ-LTL": Published(1.0, 251.7, 0.611)}
"""The 50 tasks on their maps."""

NOT_STORED = ("GenZ-LTL",)
"""Figures that nobody published: played by this project's authors, and their episodes are not stored."""

SCRIPT = "the scripted player of this project"

JAXOLOTL_MINUTES = {"DeepLTL": (14.0 * 60, 8.2), "GenZ-LTL": (13.4 * 60, 3.7)}
"""Training of ten seeds in a kinematic ZoneEnv on one RTX 5070 Ti: the original program's, and Jaxolotl's. From a
summary of its paper."""

_NM = (*_Z, "s7", "s8")
KINEMATIC_NM = {
    "StructLTL": _each(
        _NM,
        *((0.944, 238), (0.930, 222), (0.990, 193), (0.943, 157), (0.977, 140), (0.979, 103), (0.943, 126)),
        (0.923, 276),
    ),
    "DeepLTL": _each(
        _NM,
        *((0.880, 291), (0.872, 276), (0.963, 258), (0.851, 202), (0.937, 187), (0.959, 136), (0.886, 180)),
        (0.777, 333),
    ),
    "GenZ-LTL": _each(
        _NM,
        *((0.490, 180), (0.916, 179), (0.971, 188), (0.934, 126), (0.988, 122), (0.996, 84), (0.653, 112)),
        (0.515, 227),
    ),
    "LTL2Action": _each(
        _NM,
        *((0.278, 450), (0.184, 442), (0.588, 421), (0.509, 335), (0.754, 290), (0.914, 148), (0.351, 192)),
        (0.348, 566),
    ),
}
"""Another world, Jaxolotl's kinematic ZoneEnv with a rule of its own (entering purple takes the green discs away), and
the same formulas in its colours: computed from result files in the history of StructLTL's repository (commit 5265862),
10 seeds with 512 episodes each, sampled."""

JAXOLOTL_NM = {
    "StructLTL": 0.927,
    "DeepLTL": 0.836,
    "GenZ-LTL": 0.700,
    "SemLTL": 0.675,
    "GCRL-LTL": 0.669,
    "LTL2Action": 0.442,
}
"""Success in that world, of formulas that are not known. From a summary of Jaxolotl's paper."""

JAXOLOTL_ZONES = {"GenZ-LTL": 1.00, "StructLTL": 0.95}
"""Likewise in its ZoneEnv without that rule."""

STEP_BOUND = {"z1": 116, "z2": 128, "z3": 95, "z4": 105, "z5": 87, "z6": 71}
"""Fewest steps that the maps allow: straight lines at full thrust without a turn; means over 3,000 maps, computed."""

_LETTERS = ("letters_1", "letters_2", "letters_3", "letters_4", "letters_5", "letters_avoid_6", "letters_reach_12")
LETTERS = {
    "DeepLTL": _each(
        _LETTERS,
        *((0.999, 9.7), (0.982, 7.3), (1.000, 12.2), (0.969, 12.1), (0.997, 9.5), (0.950, 24.9), (0.980, 43.3)),
    ),
    "GCRL-LTL": _each(_LETTERS[:5], (0.937, 15.3), (0.935, 9.8), (0.998, 20.7), (0.816, 14.6), (0.998, 25.6))
    | {"letters_avoid_6": Published(0.616), "letters_reach_12": Published(0.933)},
    "LTL2Action": _each(_LETTERS[:5], (0.754, 29.5), (0.794, 19.0), (0.406, 40.3), (0.715, 28.8), (0.441, 31.8))
    | {"letters_avoid_6": Published(0.130), "letters_reach_12": Published(0.892)},
}
"""LetterWorld on random maps."""

FLAT = {
    "DeepLTL": _each(
        ("flat_1", "flat_2", "flat_3", "flat_4", "flat_5"),
        *((1.000, 79.7), (0.999, 52.8), (0.978, 71.8), (0.860, 43.9), (0.996, 37.0)),
    ),
    "GCRL-LTL": {f"flat_{n}": Published(value) for n, value in enumerate((0.818, 0.000, 0.726, 0.725, 0.636), start=1)},
    "LTL2Action": {
        f"flat_{n}": Published(value) for n, value in enumerate((0.999, 0.628, 0.714, 0.073, 0.562), start=1)
    },
}

LTL2ACTION_RETURN = 0.670
"""Discounted return on `Until_1_2_1_1` after 19 million frames, pre-trained, 30 seeds: the walled ZoneEnv."""

SCRIPT_WATER = Published(0.949, 111)
"""The scripted player on `phi_water`, random maps: ``python -m experiments.paper.scripted_player --episodes 2000``, as
results/script_water.json has it."""
