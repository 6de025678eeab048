"""Cells that many tables share: means, shares, medians, and what a run took."""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy import stats

from experiments.reproduction.measures import frames_before
from experiments.reproduction.stored import Stored
from t2tl_jax.evaluation import statistics

COST = ("frames (+ pre-training)", "training, all seeds (+ pre-training)", "compile")
"""The heading of `cost`."""


def text(values: Mapping[int, float] | Sequence[float], digits: int = 3) -> str:
    """Mean and interval over seeds, for a cell, and of how many if not of all; a dash where there is nothing."""
    known, fewer = _known(list(values.values()) if isinstance(values, Mapping) else list(values))
    return statistics.mean(known).text(digits) + fewer


def share(rates: Mapping[int, float]) -> str:
    """The same of rates, with an interval that stays within 0 and 1 and is never of zero width."""
    known, fewer = _known(list(rates.values()))
    return statistics.mean_rate(known).text() + fewer


def _known(data: list[float]) -> tuple[list[float], str]:
    """Those that are known, and of how many, if not of all."""
    known = [value for value in data if np.isfinite(value)]
    return known, f" ({len(known)} of {len(data)})" if 0 < len(known) < len(data) else ""


def solved(run: Stored, policy: str = "sampled") -> str:
    """How many seeds solved the task, of those that were evaluated; or are over 95 % by another policy."""
    found = run.solved(policy=policy)
    return "-" if found.value is None else f"{round(found.value * found.count)}/{found.count}"


def median_frames(frames: Sequence[float]) -> str:
    """Median over seeds in million frames, where inf stands for never, with a 95 % interval of order statistics.

    That interval assumes nothing of how the frames are spread, and there is none for fewer than six seeds.
    """
    ordered = np.sort(np.asarray(frames, float))
    if not ordered.size:
        return "-"
    # The k-th smallest and the k-th largest value miss the median when fewer than k values lie on one side of it.
    k = int(stats.binom.ppf((1 - statistics.CONFIDENCE) / 2, ordered.size, 0.5))
    interval = f" [{_million(ordered[k - 1])}, {_million(ordered[-k])}]" if k > 0 else ""
    return f"{_million(float(np.median(ordered)))}{interval}"


def _million(frames: float) -> str:
    return f"{frames / 1e6:.2f} M" if np.isfinite(frames) else "never"


def cost(run: Stored) -> tuple[str, str, str]:
    """Frames of each seed, and seconds of training all seeds together, also those of pre-training, and of compiling."""
    before = frames_before(run)
    seconds = run.status.get("pretraining", {}).get("training_seconds")
    more = " + ?" if before is None else f" + {before:,}" if before else ""
    longer = "" if before == 0 else " + ?" if seconds is None else f" + {seconds:.0f}"
    return f"{run.frames:,}{more}", f"{run.train_seconds:.0f}{longer} s", f"{run.compile_seconds:.0f} s"


def cost_line(runs: Mapping[str, Stored]) -> str:
    """The same of several runs in one line, from the least to the most; pre-training apart. '' without runs."""
    if not runs:
        return ""
    every = list(runs.values())
    before = [run.status["pretraining"] for run in every if frames_before(run)]
    said = (
        f"Of each run: {_span([run.frames for run in every])} frames a seed, training of all seeds "
        f"{_span([round(run.train_seconds) for run in every])} s, compiling "
        f"{_span([round(run.compile_seconds) for run in every])} s."
    )
    if before:
        frames = _span([note["frames_per_seed"] for note in before])
        seconds = _span([round(note["training_seconds"]) for note in before])
        said += f" Pre-training, apart: {frames} frames a seed, all seeds {seconds} s."
    return said


def _span(counts: Sequence[int]) -> str:
    least, most = min(counts), max(counts)
    return f"{least:,}" if least == most else f"{least:,} to {most:,}"
