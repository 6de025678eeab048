"""Advantages against a slow loop."""

import numpy as np

from t2tl_jax.training.advantages import generalised_advantages

DISCOUNT, LAMBDA = 0.9, 0.8


def slow_advantages(reward, value, next_value, terminated, truncated):
    """The definition: a sum over later errors of the same episode, each weighted by (gamma lambda)^distance."""
    steps = len(reward)
    advantages = np.zeros(steps)
    for t in range(steps):
        weight = 1.0
        for k in range(t, steps):
            bootstrap = 0.0 if terminated[k] else next_value[k]
            advantages[t] += weight * (reward[k] + DISCOUNT * bootstrap - value[k])
            if terminated[k] or truncated[k]:
                break
            weight *= DISCOUNT * LAMBDA
    return advantages


def test_advantages_equal_a_slow_loop():
    rng = np.random.default_rng(0)
    shape = (40, 6)
    reward, value, next_value = rng.normal(size=(3, *shape)).astype(np.float32)
    terminated = rng.random(shape) < 0.1
    truncated = (rng.random(shape) < 0.1) & ~terminated
    fast = generalised_advantages(reward, value, next_value, terminated, truncated, DISCOUNT, LAMBDA)
    slow = np.stack(
        [slow_advantages(*(x[:, i] for x in (reward, value, next_value, terminated, truncated))) for i in range(6)], 1
    )
    np.testing.assert_allclose(fast, slow, atol=1e-4)
