"""Metrics of the WaterWorld publications, from the columns of a metrics file.

In the reward-machine experiments an episode scores its return over its length; the score is divided by the best one of
any method on the same map and task, and averaged over the last thousand episodes. T2TL shows returns by episode.
"""

from collections.abc import Mapping, Sequence

import numpy as np

WINDOW = 1000
"""Episodes in one average."""


def best_scores(columns: Mapping[str, np.ndarray], num_tasks: int) -> dict[int, np.ndarray]:
    """Best score of an episode by seed, ``float[tasks]``, from the columns of a metrics file."""
    seeds = columns["seed"].astype(int)
    every = np.stack([columns[f"best_score_{k + 1}"] for k in range(num_tasks)], axis=-1)
    return {int(seed): every[seeds == seed].max(axis=0) for seed in dict.fromkeys(seeds)}


def normalised_scores(
    columns: Mapping[str, np.ndarray], seed: int, best: Sequence[float] | np.ndarray, window: int = WINDOW
) -> tuple[np.ndarray, np.ndarray]:
    """Curve of one seed: environment steps and the average normalised score of the last episodes, ``float[points]``.

    A point averages whole iterations, as few as hold `window` episodes; before that many have ended, all of them.

    Args:
        columns: of a metrics file, with `episodes_1`, `score_1`, ... for every task.
        seed: whose curve.
        best: the score that counts as 1, for every task.
        window: episodes in one average.
    """
    of_seed = columns["seed"].astype(int) == seed
    tasks = range(1, len(best) + 1)
    episodes = np.stack([columns[f"episodes_{k}"][of_seed] for k in tasks], axis=-1)
    scores = np.stack([columns[f"score_{k}"][of_seed] for k in tasks], axis=-1)
    count = np.concatenate([[0.0], np.cumsum(episodes.sum(axis=-1))])
    total = np.concatenate([[0.0], np.cumsum((episodes * scores / np.asarray(best)).sum(axis=-1))])
    # The window of point i starts at the last iteration after which still enough episodes ended.
    start = np.maximum(np.searchsorted(count, count[1:] - window, side="right") - 1, 0)
    ended = np.maximum(count[1:] - count[start], 1.0)
    return columns["frames"][of_seed], (total[1:] - total[start]) / ended


def return_by_episode(
    columns: Mapping[str, np.ndarray], seed: int, marks: Sequence[int], window: int = 500
) -> np.ndarray:
    """Average return without discount (+1 success, -1 violation) of the last episodes at each mark, ``float[marks]``.

    A training that ended before a mark counts with what it had come to: to leave it out would favour those whose long
    episodes, which succeed late or never, make them few. NaN if it played fewer than `window` episodes.

    Args:
        columns: of a metrics file.
        seed: whose episodes.
        marks: numbers of episodes since the start.
        window: episodes in one average; whole iterations, as few as hold so many, or all before that many have ended.
    """
    of_seed = columns["seed"].astype(int) == seed
    episodes = columns["episodes"][of_seed]
    each = np.nan_to_num(columns["success_rate"][of_seed]) - np.nan_to_num(columns["violation_rate"][of_seed])
    count = np.concatenate([[0.0], np.cumsum(episodes)])
    total = np.concatenate([[0.0], np.cumsum(episodes * each)])
    values = np.full(len(marks), np.nan)
    for index, mark in enumerate(marks):
        end = min(int(np.searchsorted(count, mark)), len(count) - 1)
        if count[end] >= min(mark, window):
            start = max(int(np.searchsorted(count, count[end] - window, side="right")) - 1, 0)
            values[index] = (total[end] - total[start]) / (count[end] - count[start])
    return values
