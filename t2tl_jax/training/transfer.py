"""Moving a pre-trained task encoder into a training state that has not learned anything yet."""

from typing import Any

import jax
import numpy as np
from jax.sharding import NamedSharding

from t2tl_jax.training.devices import place
from t2tl_jax.training.types import Agent, Params

PART = "task_encoder"
"""Name of the encoder among the parameters of every network."""


def seed_index(seeds: tuple[int, ...], wanted: tuple[int, ...]) -> np.ndarray:
    """Where among `seeds` each wanted one is: int[wanted]. A single seed that is not wanted itself serves all.

    Raises:
        ValueError: if a wanted seed is missing among several.
    """
    missing = [seed for seed in wanted if seed not in seeds]
    if missing and len(seeds) > 1:
        raise ValueError(
            f"the pre-training run holds seeds {', '.join(map(str, seeds))} and not {', '.join(map(str, missing))}: "
            "pre-train these too, or take a run with a single seed, which serves all"
        )
    return np.array([0 if missing else seeds.index(seed) for seed in wanted])


def task_encoder(params: Params, index: np.ndarray) -> Params:
    """The encoder's part of parameters with a leading axis [seeds], for the seeds at `index`; NumPy arrays."""
    return jax.tree.map(lambda x: np.asarray(x)[index], params["params"][PART])


def with_encoder(params: Params, encoder: Params) -> Params:
    """The parameters of a network with `encoder` in place of its task encoder's."""
    return {**params, "params": {**params["params"], PART: encoder}}


def adopt(agent: Agent, train_state: Any, encoder: Params, sharding: NamedSharding | None = None) -> Any:
    """The agent's state with `encoder` in place of its task encoder, wherever it holds one; leading axes [seeds].

    Nothing else changes: other layers and the optimiser start fresh.

    Raises:
        ValueError: if the encoders differ in structure or sizes.
    """

    def into(params: Params) -> Params:
        own = jax.tree_util.tree_leaves_with_path(params["params"][PART])
        new = jax.tree_util.tree_leaves_with_path(encoder)
        if [(path, x.shape[1:]) for path, x in own] != [(path, x.shape[1:]) for path, x in new]:
            raise ValueError(f"the pre-trained encoder has arrays {_sizes(new)}, this one has {_sizes(own)}")
        return with_encoder(params, place(encoder, sharding))

    return agent.map_params(train_state, into)


def _sizes(leaves: Any) -> str:
    return ", ".join(f"{jax.tree_util.keystr(path)} {x.shape[1:]}" for path, x in leaves[:4]) + ", ..."
