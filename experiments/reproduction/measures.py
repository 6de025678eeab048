"""Figures of one run, by seed, that several tables show: when it was done, with and without what came before."""

import numpy as np

from experiments.reproduction.stored import Stored
from t2tl_jax.runs.metrics_file import area
from t2tl_jax.runs.success import success_since, window


def frames_before(run: Stored) -> int | None:
    """Frames that each seed's encoder was pre-trained for, 0 without pre-training; None if they are not known."""
    return run.status.get("pretraining", {}).get("frames_per_seed") if run.config.pretrained else 0


def frames_to(run: Stored) -> dict[int, float]:
    """Frames after which success in training rose above 95 % and stayed, for a time limit at least; inf if never."""
    since = success_since(run.metrics["success_rate"], window(run.config))
    frames = run.metrics["frames"][0][0]
    return dict(zip(run.seeds, np.where(since > 0, since * frames, np.inf).tolist(), strict=True))


def delayed(run: Stored, name: str) -> dict[int, float]:
    """Mean of a metric by seed over as many frames as its training has, the first of which are its pre-training's.

    The metric is 0 in those, and the last part of the training is left out. Empty where their number is not known.
    """
    before = frames_before(run)
    if before is None:
        return {}
    values = run.metrics[name]
    count = values.shape[1]
    kept = count - int(np.ceil(before / run.metrics["frames"][0][0]))
    means = area(values[:, :kept]) * kept / count if kept > 0 else np.zeros(len(values))
    return dict(zip(run.seeds, means.tolist(), strict=True))
