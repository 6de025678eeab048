"""What differs between compared runs besides the idea: sizes, pre-training, and what settings were chosen on."""

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import jax
import numpy as np

from experiments import tuning
from t2tl_jax.registry import configs
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.differences import differences
from t2tl_jax.runs.experiment import build
from t2tl_jax.training.transfer import PART


@dataclass(frozen=True)
class Sizes:
    """Of the networks of one seed."""

    code: int
    """Numbers that stand for a task."""
    encoder: int
    """Parameters of the task encoder."""
    others: int
    """All other parameters."""


def sizes(config: Config) -> Sizes:
    """Build what a configuration describes, and count; nothing is computed.

    Raises:
        UserError: if it cannot be built, as where its environment was an object of a program's own.
    """
    experiment = build(replace(config, seeds="0,"))
    params = jax.tree.map(lambda leaf: jax.ShapeDtypeStruct(leaf.shape[1:], leaf.dtype), experiment.params_shapes)
    code = jax.eval_shape(experiment.agent.embed, params, experiment.table).shape[-1]
    encoder = _count(params["params"].get(PART, {})) if "params" in params else 0
    return Sizes(code, encoder, _count(params) - encoder)


def _count(params: Any) -> int:
    return sum(int(np.prod(leaf.shape)) for leaf in jax.tree.leaves(params))


HEADING = (
    "run",
    "settings of",
    "chosen with",
    "on seeds",
    "seeds here",
    "code width",
    "encoder",
    "other parameters",
    "frames before",
    "frames",
)
"""Of the columns of `row`."""

NOTE = (
    "Parameters and frames are of one seed; (!): settings were chosen on some of these seeds, or they are kept for "
    "that. A dash: not known."
)


def row(name: str, config: Config, seeds: Sequence[int], status: Mapping[str, Any], own: Sizes) -> tuple[str, ...]:
    """What there is to say of one run.

    Args:
        name: of the run.
        config: of the run.
        seeds: of the run.
        status: what ``status.json`` holds.
        own: its sizes.
    """
    nearest = tuning.nearest(config)
    tuned = tuning.TUNED.get(nearest)
    marked = " (!)" if tuning.tuning_seeds(config, seeds) else ""
    other = [
        change
        for change in differences(configs()[nearest][0], config)
        if not change.startswith(("learner.network.", "learner.counterfactual", "pretrained", "seeds", "selection"))
    ]
    before = status.get("pretraining", {}).get("frames_per_seed") if config.pretrained else 0
    return (
        name,
        " but ".join([nearest, *([", ".join(other)] if other else [])]),
        tuned.methods if tuned else "-",
        tuning.in_words(tuned.seeds) if tuned else "-",
        tuning.in_words(seeds) + marked,
        f"{own.code:,}",
        f"{own.encoder:,}",
        f"{own.others:,}",
        "-" if before is None else f"{before:,}",
        f"{config.frames:,}",
    )


def table(runs: Mapping[str, tuple[Config, Sequence[int], Mapping[str, Any]]]) -> str:
    """One line for each run, for a terminal.

    Args:
        runs: by name, the configuration, the seeds, and what ``status.json`` holds.
    """
    lines = [HEADING, *(row(name, *run, sizes(run[0])) for name, run in runs.items())]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    text = ["  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip() for line in lines]
    return "\n".join([*text, *textwrap.wrap(NOTE, 100)])
