"""The optimiser of both learners."""

import optax


def clipped_adam(
    learning_rate: float, max_gradient_norm: float, gradient_steps: int, anneal: bool, epsilon: float = 1e-8
) -> optax.GradientTransformation:
    """Adam on gradients that are clipped by their global norm.

    Args:
        learning_rate: step size, at the start if it is annealed.
        max_gradient_norm: the norm beyond which a gradient is shortened.
        gradient_steps: length of the run.
        anneal: let the step size fall linearly to zero over the run.
        epsilon: of Adam.
    """
    schedule = optax.linear_schedule(learning_rate, 0.0, gradient_steps) if anneal else learning_rate
    return optax.chain(optax.clip_by_global_norm(max_gradient_norm), optax.adam(schedule, eps=epsilon))
