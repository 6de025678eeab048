"""Numbers that are not finite: noticed inside the compiled program, and named with their cause.

A seed in which they are found is frozen (`watched`): it keeps the state that it had before that iteration, whatever
learner it is of, and the seeds beside it do not notice. The fault comes back with the parameters of the next iteration,
so no seed thaws when maps or tasks change. What replay holds is not kept, since a copy of it would cost: a frozen seed
learns nothing from it. Beside that, a gradient step of the optimiser here whose gradient is not finite changes no
parameter (`clipped`), for those who call a learner without the guard.
"""

from collections.abc import Mapping
from dataclasses import replace
from enum import IntEnum
from functools import reduce
from typing import Any

import jax
import jax.numpy as jnp
import optax

from t2tl_jax.task_env import TaskParams
from t2tl_jax.training import few_kernels
from t2tl_jax.training.types import Agent, Metrics, Params
from t2tl_jax.training.unroll import FAILED


class Fault(IntEnum):
    """What was found not to be finite; where several things were, the one that comes first here."""

    NONE = 0
    """Everything was finite that is looked at."""
    ENVIRONMENT = 1
    """An environment's physics failed, or an observation is not finite at the end of the iteration."""
    LOSS = 2
    """A scalar that is called a loss."""
    GRADIENT = 3
    """The norm of the gradient."""


CAUSES = {
    Fault.ENVIRONMENT: "the physics of an environment failed, or its observation was not finite",
    Fault.LOSS: "the loss was not finite",
    Fault.GRADIENT: "the gradient was not finite",
}
"""What is said of a seed, by fault."""


def clipped(
    optimizer: optax.GradientTransformation, max_norm: float | jax.Array, each: bool = False
) -> optax.GradientTransformationExtraArgs:
    """The same optimiser on gradients clipped by their norm; those that are not finite change no parameter.

    Its moments take them for 0. That is `optax.chain` of `clip_by_global_norm` and `optimizer`, with the same state,
    but the norm is computed once, for both: for a small network that learns after every step each pass over all
    gradients counts. So it is with a norm for `each` array, for which optax has no clipping.

    Args:
        optimizer: what goes on with the clipped gradients.
        max_norm: the norm beyond which a gradient is shortened to it.
        each: shorten each array by its own norm instead of all by the global one. One array that is not finite still
            keeps the whole gradient from changing anything.
    """
    chain = optax.chain(optax.identity(), optimizer)  # in the place of the clipping, whose state is as empty

    def update(gradient: Any, state: Any, params: Params = None, **extra: Any) -> tuple[Any, Any]:
        norms = jax.tree.map(optax.tree.norm, gradient) if each else few_kernels.global_norm(gradient)
        finite = few_kernels.read_by_many(reduce(jnp.logical_and, map(jnp.isfinite, jax.tree.leaves(norms))))

        def bounded(norm: jax.Array, part: Any) -> Any:
            """All arrays that share a norm."""
            short = norm < max_norm
            return jax.tree.map(lambda x: jnp.where(finite, jnp.where(short, x, x / norm * max_norm), 0.0), part)

        updates, state = chain.update(jax.tree.map(bounded, norms, gradient), state, params, **extra)
        return jax.tree.map(lambda x: jnp.where(finite, x, 0.0), updates), state

    return optax.GradientTransformationExtraArgs(chain.init, update)


def watched(agent: Agent) -> Agent:
    """The same learner, whose `iterate` says in `Metrics.fault` what was not finite, and then keeps its state.

    Looked at are the scalars whose names hold "loss" or "gradient", what an environment says of its physics
    (`LabelledEnv.failed`), and the observations of a learner that keeps its environments in a field `episodes` of its
    state. A seed is frozen by what is found, or by `TaskParams.fault`, which it is given back. Its scalars are those of
    the iteration that it tries and does not keep; the episodes of that are none, so that nobody takes what comes again
    and again for success, or for failure.
    """

    def iterate(state: Any, env_params: TaskParams) -> tuple[Any, Metrics]:
        with jax.named_scope("guard"):
            used = _apart(state, env_params, agent.replay)
        after, metrics = agent.iterate(used, env_params)
        with jax.named_scope("guard"):
            fault, scalars = _fault(after, metrics, env_params)
            is_good = fault == Fault.NONE
            after = _chosen(few_kernels.read_by_many(is_good), after, state, used, agent.replay)
            episodes, tasks = jax.tree.map(
                lambda x: jnp.where(is_good, x, jnp.zeros_like(x)), (metrics.episodes, metrics.tasks)
            )
        return after, replace(metrics, episodes=episodes, tasks=tasks, scalars=scalars, fault=fault)

    return agent._replace(iterate=iterate)


def _fault(after: Any, metrics: Metrics, env_params: TaskParams) -> tuple[jax.Array, dict[str, jax.Array]]:
    """int32[]: the first cause, or that of an earlier iteration; and the scalars but what an environment says of its
    physics."""
    scalars = dict(metrics.scalars)
    failed = scalars.pop(f"env_{FAILED}", jnp.float32(0))
    observed = getattr(getattr(getattr(after, "episodes", None), "state", None), "obs", ())
    found = (
        (any_where(_not_finite, observed) | (failed != 0), Fault.ENVIRONMENT),
        (any_where(_not_finite, _named(scalars, "loss")), Fault.LOSS),
        (any_where(_not_finite, _named(scalars, "gradient")), Fault.GRADIENT),
    )
    fault = jnp.int32(Fault.NONE)
    for is_found, cause in reversed(found):
        fault = jnp.where(is_found, jnp.int32(cause), fault)
    earlier = getattr(env_params, "fault", ())
    if not isinstance(earlier, tuple):
        fault = jnp.where(jnp.asarray(earlier) != Fault.NONE, earlier, fault)
    return fault, scalars


def _apart(state: Any, env_params: TaskParams, replay: str) -> Any:
    """The same numbers in memory of their own, but for the replay and keys of random numbers.

    The loops of an iteration work in the memory of the state that they are given, so what a frozen seed goes back to
    has to lie elsewhere. XLA would copy it array by array, and with loops as CUDA graphs hundreds of small copies cost.
    A choice whose outcome it cannot know, no fault being negative, makes kernels of them like others, which was
    measured to cost a fraction of that; arrays of one shape share one.
    """
    fault = getattr(env_params, "fault", ())
    if isinstance(fault, tuple):  # a caller who keeps none, as tests do
        return state
    is_a_fault = few_kernels.read_by_many(jnp.asarray(fault) >= Fault.NONE)

    def apart(x: Any) -> Any:
        if jnp.issubdtype(jnp.result_type(x), jax.dtypes.prng_key):
            return x
        return jnp.where(is_a_fault, x, jnp.zeros_like(x))

    copied = jax.tree.map(apart, state)
    return replace(copied, **{replay: getattr(state, replay)}) if replay else copied


def _chosen(is_good: jax.Array, after: Any, before: Any, used: Any, replay: str) -> Any:
    """`after` if that is good, else `before`, but for the replay; `used` is `before` as the learner was given it."""
    new, old = (jax.tree.map(lambda x: (jnp.shape(x), jnp.result_type(x)), tree) for tree in (after, before))
    if new != old:  # a learner that changes the form of its state, which whoever traces it tells
        return after
    if replay:
        before, used = (replace(tree, **{replay: getattr(after, replay)}) for tree in (before, used))

    def one(new: Any, old: Any, given: Any) -> Any:
        return old if new is given else jnp.where(is_good, new, old)

    return jax.tree.map(one, after, before, used)


def any_where(test: Any, tree: Any) -> jax.Array:
    """bool[]: whether a test of single numbers holds anywhere in a tree."""
    return jnp.any(jnp.array([test(x).any() for x in jax.tree.leaves(tree)], bool))


def _not_finite(x: jax.Array) -> jax.Array:
    return ~jnp.isfinite(x)


def _named(scalars: Mapping[str, jax.Array], part: str) -> list[jax.Array]:
    return [value for name, value in scalars.items() if part in name]
