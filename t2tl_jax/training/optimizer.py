"""The optimiser of both learners."""

from dataclasses import dataclass
from typing import ClassVar

import jax
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
) -> optax.GradientTransformation:
    """Adam on gradients that are clipped by their global norm; those that are not finite change nothing.

    Args:
        learning_rate: step size, at the start if it is annealed.
        max_gradient_norm: the norm beyond which a gradient is shortened, that of the task encoder included.
        gradient_steps: length of the run.
        anneal: let the step size fall linearly to zero over the run.
        epsilon: of Adam.
        task_encoder_learning_rate: step size of the task encoder's parameters; None for the same.
        freeze_task_encoder: leave the task encoder alone, whose gradient is 0 then. Adam would not move it either, but
            go through its many small arrays at every step.
    """

    def adam(rate: float | jax.Array) -> optax.GradientTransformation:
        return optax.adam(optax.linear_schedule(rate, 0.0, gradient_steps) if anneal else rate, eps=epsilon)

    step = adam(learning_rate)
    if freeze_task_encoder:
        step = optax.partition({PART: optax.set_to_zero(), REST: step}, _labels)
    elif task_encoder_learning_rate is not None:
        step = optax.partition({PART: adam(task_encoder_learning_rate), REST: step}, _labels)
    return clipped(step, max_gradient_norm)


def _labels(params: Params) -> Params:
    """Which step size each part of a network's parameters has; a part's label is that of everything in it."""
    return {"params": {name: PART if name == PART else REST for name in params["params"]}}
