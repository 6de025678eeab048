"""Numbers that are not finite: noticed inside the compiled program, and kept out of the parameters.

A seed whose parameters become NaN or infinite keeps those from before that iteration, in all sets that its learner
holds. Its optimiser holds NaN from then on, so it learns no more; the seeds beside it do not notice. What it costs is
one look at the parameters in an iteration.
"""

from collections.abc import Sequence
from enum import IntEnum
from typing import Any

import jax
import jax.numpy as jnp

from t2tl_jax.task_env import TaskParams
from t2tl_jax.training.types import Agent, Metrics, Params


class Fault(IntEnum):
    """What was found not to be finite; where several things were, the one that comes first here."""

    NONE = 0
    """All parameters are finite."""
    ENVIRONMENT = 1
    """The state of an environment holds NaN at the end of the iteration."""
    LOSS = 2
    """A scalar that is called a loss."""
    GRADIENT = 3
    """The norm of the gradient."""
    PARAMETERS = 4
    """The parameters alone."""


CAUSES = {
    Fault.ENVIRONMENT: "the state of its environments is not a number",
    Fault.LOSS: "its loss is not finite",
    Fault.GRADIENT: "its gradient is not finite",
    Fault.PARAMETERS: "its parameters are not finite, though loss and gradient are",
}
"""What is said of a seed, by fault."""


def guarded(agent: Agent) -> Agent:
    """The same learner, whose `iterate` keeps parameters finite and reports in `Metrics.fault` where it had to.

    A learner that holds its environments in a field `episodes` of its state is also looked through for NaN there.
    """

    def iterate(state: Any, env_params: TaskParams) -> tuple[Any, Metrics]:
        after, metrics = agent.iterate(state, env_params)
        old, new = _sets(agent, state), _sets(agent, after)
        good = _finite(new)
        kept = iter([jax.tree.map(lambda a, b: jnp.where(good, a, b), *pair) for pair in zip(new, old, strict=True)])
        causes = (
            (_has_nan(getattr(after, "episodes", ())), Fault.ENVIRONMENT),
            (~_finite([x for name, x in metrics.scalars.items() if "loss" in name]), Fault.LOSS),
            (~_finite([x for name, x in metrics.scalars.items() if "gradient" in name]), Fault.GRADIENT),
        )
        fault = jnp.int32(Fault.PARAMETERS)
        for found, cause in reversed(causes):
            fault = jnp.where(found, jnp.int32(cause), fault)
        metrics = metrics.replace(fault=jnp.where(good, jnp.int32(Fault.NONE), fault))  # type: ignore[attr-defined]
        return agent.map_params(after, lambda _: next(kept)), metrics

    return agent._replace(iterate=iterate)


def _sets(agent: Agent, state: Any) -> list[Params]:
    """The sets of the network's parameters that a state holds, in the order in which `map_params` visits them."""
    found: list[Params] = []

    def note(params: Params) -> Params:
        found.append(params)
        return params

    agent.map_params(state, note)
    return found


def _floats(tree: Any) -> Sequence[jax.Array]:
    return [x for x in jax.tree.leaves(tree) if jnp.issubdtype(jnp.result_type(x), jnp.floating)]


def _finite(tree: Any) -> jax.Array:
    """bool[]: whether all floating-point numbers of a tree are finite."""
    return jnp.all(jnp.array([jnp.isfinite(x).all() for x in _floats(tree)], bool))


def _has_nan(tree: Any) -> jax.Array:
    """bool[]: whether any floating-point number of a tree is NaN. Environments may hold infinities on purpose."""
    return jnp.any(jnp.array([jnp.isnan(x).any() for x in _floats(tree)], bool))
