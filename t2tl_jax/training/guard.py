"""Numbers that are not finite: noticed inside the compiled program, and named with their cause.

What keeps them out of the parameters is the optimiser (`clipped`): a gradient step whose gradient is not finite
changes no parameter. A seed whose losses stay broken therefore keeps the parameters that it had, and the seeds beside
it do not notice. A learner with an optimiser of its own has to see to that itself; what is not finite is told of any.
"""

from collections.abc import Mapping
from enum import IntEnum
from typing import Any

import jax
import jax.numpy as jnp
import optax

from t2tl_jax.task_env import TaskParams
from t2tl_jax.training.types import Agent, Metrics, Params


class Fault(IntEnum):
    """What was found not to be finite; where several things were, the one that comes first here."""

    NONE = 0
    """Everything was finite that is looked at."""
    ENVIRONMENT = 1
    """An observation of an environment is NaN at the end of the iteration."""
    LOSS = 2
    """A scalar that is called a loss."""
    GRADIENT = 3
    """The norm of the gradient."""


CAUSES = {
    Fault.ENVIRONMENT: "the observation of an environment was not a number",
    Fault.LOSS: "the loss was not finite",
    Fault.GRADIENT: "the gradient was not finite",
}
"""What is said of a seed, by fault."""


def clipped(optimizer: optax.GradientTransformation, max_norm: float | jax.Array) -> optax.GradientTransformation:
    """The same optimiser on gradients clipped by their global norm; those that are not finite change no parameter.

    Its moments take them for 0. That is `optax.chain` of `clip_by_global_norm` and `optimizer`, with the same state,
    but the norm is computed once, for both: for a small network that learns after every step each pass over all
    gradients counts.

    Args:
        optimizer: what goes on with the clipped gradients.
        max_norm: the norm beyond which a gradient is shortened to it.
    """
    chain = optax.chain(optax.identity(), optimizer)  # in the place of the clipping, whose state is as empty

    def update(gradient: Any, state: Any, params: Params = None, **extra: Any) -> tuple[Any, Any]:
        norm = optax.tree.norm(gradient)
        finite, short = jnp.isfinite(norm), norm < max_norm

        def bounded(x: jax.Array) -> jax.Array:
            return jnp.where(finite, jnp.where(short, x, x / norm * max_norm), 0.0)

        updates, state = chain.update(jax.tree.map(bounded, gradient), state, params, **extra)
        return jax.tree.map(lambda x: jnp.where(finite, x, 0.0), updates), state

    return optax.GradientTransformation(chain.init, update)


def watched(agent: Agent) -> Agent:
    """The same learner, whose `iterate` says in `Metrics.fault` what was not finite.

    Looked at are the scalars whose names hold "loss" or "gradient", and the observations of a learner that keeps its
    environments in a field `episodes` of its state.
    """

    def iterate(state: Any, env_params: TaskParams) -> tuple[Any, Metrics]:
        state, metrics = agent.iterate(state, env_params)
        observed = getattr(getattr(getattr(state, "episodes", None), "state", None), "obs", ())
        found = (
            (any_where(jnp.isnan, observed), Fault.ENVIRONMENT),
            (any_where(_not_finite, _named(metrics.scalars, "loss")), Fault.LOSS),
            (any_where(_not_finite, _named(metrics.scalars, "gradient")), Fault.GRADIENT),
        )
        fault = jnp.int32(Fault.NONE)
        for is_found, cause in reversed(found):
            fault = jnp.where(is_found, jnp.int32(cause), fault)
        return state, metrics.replace(fault=fault)  # type: ignore[attr-defined]

    return agent._replace(iterate=iterate)


def any_where(test: Any, tree: Any) -> jax.Array:
    """bool[]: whether a test of single numbers holds anywhere in a tree."""
    return jnp.any(jnp.array([test(x).any() for x in jax.tree.leaves(tree)], bool))


def _not_finite(x: jax.Array) -> jax.Array:
    return ~jnp.isfinite(x)


def _named(scalars: Mapping[str, jax.Array], part: str) -> list[jax.Array]:
    return [value for name, value in scalars.items() if part in name]
