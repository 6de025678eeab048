"""The published program on more seeds, and how its seeds come out by the sign of the critic that they begin with."""

from collections.abc import Mapping

from experiments.paper import published_widths
from experiments.paper.published_curves import ZONE_CURVES
from experiments.reproduction.stored import Stored
from experiments.reproduction.tables import methods

BEFORE = ("zone-published-t1tl", "zone-published")
"""The runs of the sections before, of T1TL and T2TL."""

MORE = ("zone-published-t1tl-more", "zone-published-t2tl-more")
"""The same on more seeds."""

LABELS = {name: name for name in (*BEFORE, *MORE)}

T1TL = (published_widths.FRAMES, published_widths.ZONE["T1TL 16"])
"""The published curve without pre-training."""

T2TL = ZONE_CURVES["T2TL_pre (published)"]
"""The published curve after pre-training."""

CURVES = {BEFORE[0]: T1TL, MORE[0]: T1TL, BEFORE[1]: T2TL, MORE[1]: T2TL}


def more_seeds(runs: Mapping[str, Stored]) -> str:
    """Final figures of the first runs and of those on more seeds."""
    return methods(runs, LABELS, {name: curve[1][-1] for name, curve in CURVES.items()})
