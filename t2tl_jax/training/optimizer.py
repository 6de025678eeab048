"""The optimiser of both learners."""

from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import jax
import jax.numpy as jnp
import optax

from t2tl_jax import checks
from t2tl_jax.training.guard import clipped
from t2tl_jax.training.transfer import PART
from t2tl_jax.training.types import LearnerConfig, Params

REST = "rest"
"""Label of all parameters but the task encoder's."""


@dataclass(frozen=True)
class AdamLearnerConfig(LearnerConfig):
    """What the learners that use `clipped_adam` share beside the constants that each has defaults of its own for."""

    task_encoder_learning_rate: float | None = None
    """Step size of Adam for the task encoder, annealed as the other one is; None for the same as the rest."""
    gradient_clipping: Literal["global", "each"] = "global"
    """Which norm is held below `max_gradient_norm`: that of the whole gradient, or that of the part that belongs to
    each array of parameters, all of which are then shortened apart, as in the reward-machine experiments."""

    traced: ClassVar[tuple[str, ...]] = ("task_encoder_learning_rate",)

    def __post_init__(self) -> None:
        if self.task_encoder_learning_rate is None:
            return
        checks.not_negative(self, "task_encoder_learning_rate")
        if self.freezes_task_encoder:
            raise ValueError(
                "a frozen task encoder has no learning rate, got task_encoder_learning_rate="
                f"{self.task_encoder_learning_rate} with network.freeze_task_encoder=True; leave one of them out"
            )


def clipped_adam(
    learning_rate: float | jax.Array,
    max_gradient_norm: float | jax.Array,
    gradient_steps: int,
    anneal: bool,
    epsilon: float | jax.Array = 1e-8,
    task_encoder_learning_rate: float | jax.Array | None = None,
    freeze_task_encoder: bool = False,
    each: bool = False,
) -> optax.GradientTransformationExtraArgs:
    """Adam on gradients that are clipped by their norm; those that are not finite change nothing.

    Steps are counted for annealing. Of a run with more of them than 32 bits can count, `update` is to be told the share
    that is over, as ``share=``; of others it takes that and does not read it.

    Args:
        learning_rate: step size, at the start if it is annealed.
        max_gradient_norm: the norm beyond which a gradient is shortened, that of the task encoder included.
        gradient_steps: length of the run.
        anneal: let the step size fall linearly to zero over the run.
        epsilon: of Adam.
        task_encoder_learning_rate: step size of the task encoder's parameters; None for the same.
        freeze_task_encoder: leave the task encoder alone, whose gradient is 0 then. Adam would not move it either, but
            go through its many small arrays at every step.
        each: clip the gradient of each array of parameters by its own norm, not the whole by the global one.
    """

    def adam(rate: float | jax.Array) -> optax.GradientTransformation:
        if anneal and gradient_steps > checks.COUNTER_LIMIT:
            return optax.chain(optax.scale_by_adam(eps=epsilon), _annealed_by_share(rate))
        return optax.adam(optax.linear_schedule(rate, 0.0, gradient_steps) if anneal else rate, eps=epsilon)

    step = adam(learning_rate)
    if freeze_task_encoder:
        step = optax.partition({PART: optax.set_to_zero(), REST: step}, _labels)
    elif task_encoder_learning_rate is not None:
        step = optax.partition({PART: adam(task_encoder_learning_rate), REST: step}, _labels)
    return clipped(step, max_gradient_norm, each)


def _annealed_by_share(rate: float | jax.Array) -> optax.GradientTransformationExtraArgs:
    """Steps of that size, falling linearly to zero with the `share` of the run that is over.

    The state is that of optax's schedule, whose counter stops at its limit: a run that is made longer goes on with it.
    """

    def init(params: Params) -> optax.ScaleByScheduleState:
        del params
        return optax.ScaleByScheduleState(jnp.int32(0))

    def update(
        updates: Any, state: optax.ScaleByScheduleState, params: Params = None, *, share: jax.Array, **extra: Any
    ) -> tuple[Any, optax.ScaleByScheduleState]:
        del params, extra
        size = rate * (1.0 - jnp.clip(share, 0.0, 1.0))
        after = optax.ScaleByScheduleState(optax.safe_increment(state.count))
        return jax.tree.map(lambda x: -size * x, updates), after

    return optax.GradientTransformationExtraArgs(init, update)


def _labels(params: Params) -> Params:
    """Which step size each part of a network's parameters has; a part's label is that of everything in it."""
    return {"params": {name: PART if name == PART else REST for name in params["params"]}}
