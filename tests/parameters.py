"""Parameters of a network without its initialisers, which take about as long to compile as half of its learner.

For tests that ask nothing about where learning starts. All numbers are drawn at once and differ from 0, biases too.
"""

from functools import partial
from typing import Any

import jax
import numpy as np
import pytest
from flax import linen as nn

from t2tl_jax.networks.actor_critic import ActorCritic
from t2tl_jax.networks.q_network import QNetwork
from t2tl_jax.task_env import TaskParams
from t2tl_jax.training.types import Agent


def parameters(network: nn.Module, *args: Any, seed: int = 0, **how: Any) -> Any:
    """NumPy parameters of a network that ``network.init(key, *args, **how)`` would initialise."""
    shapes = jax.eval_shape(partial(network.init, **how), jax.random.key(0), *args)
    return _filled(shapes, np.random.default_rng(seed).normal(size=_size(shapes)).astype(np.float32))


def begun_quickly(agent: Agent) -> Agent:
    """The same learner, which begins with such parameters. They depend on the key, as they should."""

    def init(key: jax.Array, env_params: TaskParams) -> Any:
        with pytest.MonkeyPatch.context() as patch:
            begin_quickly(patch)
            return agent.init(key, env_params)

    return agent._replace(init=init)


def begin_quickly(patch: pytest.MonkeyPatch) -> None:
    """From now on every network begins with such parameters, those of whole runs too."""

    def of(init: Any) -> Any:
        def quick(self: Any, key: jax.Array, *args: Any, **how: Any) -> Any:
            shapes = jax.eval_shape(partial(init, self, **how), key, *args)
            return _filled(shapes, jax.random.normal(key, (_size(shapes),)))

        return quick

    for network in (ActorCritic, QNetwork):
        patch.setattr(network, "init", of(network.init))


def _size(shapes: Any) -> int:
    return sum(leaf.size for leaf in jax.tree.leaves(shapes))


def _filled(shapes: Any, numbers: Any) -> Any:
    """Kernels that keep the size of what they are given, scales about 1, and small biases."""
    taken = 0

    def fill(path: Any, leaf: Any) -> Any:
        nonlocal taken
        part = numbers[taken : taken + leaf.size].reshape(leaf.shape)
        taken += leaf.size
        if leaf.ndim > 1:
            return part / np.float32(np.sqrt(np.prod(leaf.shape[:-1])))
        return part * np.float32(0.1) + np.float32(path[-1].key == "scale")

    return jax.tree_util.tree_map_with_path(fill, shapes)
