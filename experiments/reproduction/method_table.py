"""The table of methods: what each one is, and what came of it in the paper's two tasks."""

from collections.abc import Mapping, Sequence

import numpy as np

from experiments.methods import METHODS, Method
from experiments.reproduction.cells import solved, text
from experiments.reproduction.page import table
from experiments.reproduction.runs import again_name
from experiments.reproduction.stored import Stored
from t2tl_jax.networks.rgcn import RGCNConfig
from t2tl_jax.networks.task_encoders import OneHotConfig
from t2tl_jax.networks.transformer import TransformerConfig

ENCODERS = {
    TransformerConfig: "Transformer on the formula",
    RGCNConfig: "R-GCN on the formula's tree",
    OneHotConfig: "automaton's state, one-hot",
}

WIDTHS = {"rm_6": "rm-6"}
"""Methods whose runs in WaterWorld are named as a width of another one."""

SAME_UNDER_PPO = {"rm": "dfa"}
"""Methods that are another one under PPO, which ZoneEnv is learned with."""


def method_table(runs: Mapping[str, Stored], methods: Sequence[str] = tuple(METHODS)) -> str:
    """A row for each of the methods, from the runs of the items `fig-zone` and `fig-water`; a dash for no run."""
    rows = []
    for name in methods:
        method = METHODS[name]
        same = SAME_UNDER_PPO.get(name, name)
        zone = runs.get(f"zone-{same}")
        rows.append(
            (
                f"`{name}`",
                _encoder(method),
                "yes" if method.context else "no",
                "every row" if method.counterfactual else "the own row",
                "yes" if method.task_encoder.learned else "-",
                "-" if zone is None else f"as `{same}`" if same != name else solved(zone),
                "-" if zone is None or same != name else text(zone.end("discounted_return")),
                _water(runs, f"water-{WIDTHS.get(name, name)}"),
            )
        )
    heading = (
        *("method", "task encoder", "context window", "DQN learns", "pre-training"),
        *("`phi_zone`: solved", "return", "`phi_water`: solved"),
    )
    return table(heading, rows)


def _water(runs: Mapping[str, Stored], name: str) -> str:
    """How many seeds of a run solved its task, and of the same training once more, whose parameters are kept."""
    first, again = (runs.get(one) for one in (name, again_name(name)))
    shown, repeated = ("-" if run is None else solved(run) for run in (first, again))
    if first is not None and again is not None and shown == repeated and _same_training(first, again):
        repeated = "the same training"
    return shown if again is None else f"{shown}, again {repeated}"


def _same_training(one: Stored, other: Stored) -> bool:
    """Whether two runs had the same returns in every iteration: then the second one is no second result."""
    returns, others = (run.metrics["discounted_return"] for run in (one, other))
    return returns.shape == others.shape and np.array_equal(returns, others, equal_nan=True)


def _encoder(method: Method) -> str:
    words = ENCODERS[method.task_encoder]
    if method.code_size == 1:
        return words.replace("one-hot", "one number")
    return words if method.code_size is None else f"{words} of {method.code_size}"
