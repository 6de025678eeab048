"""Trainings on `phi_safe` that were made twice with the same seeds: what the first ones came to."""

from collections.abc import Collection
from pathlib import Path

from experiments.reproduction import stored
from experiments.reproduction.cells import share, solved, text
from experiments.reproduction.page import made_by, paragraph, table
from experiments.reproduction.stored import Stored
from t2tl_jax.evaluation.statistics import SOLVED

FOLDER = "safe_again_h200"
"""Of the trainings that were made first."""

TITLE = "`phi_safe`, four trainings that were made twice"
ANCHOR = "phi_safe-four-trainings-that-were-made-twice"
"""Of the section, and where it stands on its page."""

NOTE = """These were trained twice by the same commit. The machine of the first time was gone before other runs of
`phi_safe` were trained, so these were begun anew on the machine of some of the others. The sections above show those of
the second time, and compare them: that was settled before anybody looked at what either came to. Pre-training was made
anew too. A GPU does not add numbers in the same order every time, so that the same seed is another training."""


def safe_again(results: Path) -> str:
    """Both trainings of each run, and how many seeds solve the task in one of them alone."""
    first, shown = stored.load(results / FOLDER), stored.load(results / "paper")
    both = {name: (run, shown[name]) for name, run in first.items() if name in shown}
    rows = [
        (
            name,
            *map(solved, runs),
            str(_apart(*runs)),
            *(text(run.by_seed("discounted_return")) for run in runs),
            *(share(run.by_seed("violation_rate")) for run in runs),
        )
        for name, runs in both.items()
    ]
    heading = (
        *("run", "solved, first time", "as shown above", "seeds that solve it in one alone"),
        *("return, final, first time", "as shown above", "violations, final, first time", "as shown above"),
    )
    return "\n\n".join((paragraph(NOTE), table(heading, rows), made_by(list(first.values()))))


def said(results: Path, names: Collection[str]) -> str:
    """Which of these runs were trained twice, and where that is shown; '' for none."""
    twice = [name for name in stored.load(results / FOLDER) if name in names]
    if not twice:
        return ""
    return paragraph(f"Trained twice, with [other outcomes](#{ANCHOR}) from the same seeds: {', '.join(twice)}.")


def _apart(first: Stored, second: Stored) -> int:
    """Seeds that solve the task in one of two trainings and not in the other."""
    over = [{seed for seed, rate in run.by_seed("success_rate").items() if rate > SOLVED} for run in (first, second)]
    return len(over[0] ^ over[1])
