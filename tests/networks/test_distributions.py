"""Distributions of actions against SciPy and against counting."""

import jax
import jax.numpy as jnp
import numpy as np
import scipy.stats

from t2tl_jax.networks.distributions import Categorical, Gaussian

LOGITS = np.array([[0.0, 1.0, -2.0], [3.0, 3.0, 3.0]], np.float32)


def test_log_probability_and_entropy_of_a_choice():
    choice = Categorical(jnp.asarray(LOGITS) + 7.0)  # a constant more or less changes nothing
    probability = np.exp(LOGITS) / np.exp(LOGITS).sum(1, keepdims=True)
    for action in range(3):
        np.testing.assert_allclose(choice.log_prob(jnp.full(2, action)), np.log(probability[:, action]), atol=1e-5)
    np.testing.assert_allclose(choice.entropy(), scipy.stats.entropy(probability, axis=1), atol=1e-5)
    np.testing.assert_array_equal(choice.mode(), [1, 0])


def test_draws_of_a_choice_have_its_probabilities():
    choice = Categorical(jnp.broadcast_to(LOGITS[0], (20_000, 3)))
    action, noise = choice.sample(jax.random.key(0), None, 0.5)
    assert action.shape == (20_000,) and action.dtype == jnp.int32 and noise is None
    expected = np.exp(LOGITS[0]) / np.exp(LOGITS[0]).sum()
    np.testing.assert_allclose(np.bincount(action) / 20_000, expected, atol=0.015)  # four standard errors


def test_log_probability_and_entropy_of_a_gaussian():
    rng = np.random.default_rng(0)
    mean, std, action = rng.normal(size=(4, 2)), rng.uniform(0.3, 1.3, (4, 2)), rng.normal(size=(4, 2))
    gaussian, exact = Gaussian(jnp.asarray(mean), jnp.asarray(std)), scipy.stats.norm(mean, std)
    np.testing.assert_allclose(gaussian.log_prob(jnp.asarray(action)), exact.logpdf(action).sum(1), atol=1e-4)
    np.testing.assert_allclose(gaussian.entropy(), exact.entropy(), atol=1e-5)


def test_noise_is_remembered_as_far_as_it_correlates():
    gaussian, key = Gaussian(jnp.ones(5), jnp.full(5, 2.0)), jax.random.key(1)
    fresh = jax.random.normal(key, (5,))
    action, noise = gaussian.sample(key)
    np.testing.assert_array_equal(noise, fresh)
    np.testing.assert_array_equal(action, 1.0 + 2.0 * fresh)
    _, kept = gaussian.sample(key, jnp.full(5, 3.0), 1.0)
    np.testing.assert_array_equal(kept, jnp.full(5, 3.0))
    _, mixed = gaussian.sample(key, jnp.full(5, 3.0), jnp.float32(0.6))
    np.testing.assert_allclose(mixed, 0.6 * 3.0 + 0.8 * fresh, atol=1e-6)


def test_divergence_is_the_mean_log_ratio():
    """By counting over the choices, and by integration over a fine grid of one dimension after the other."""
    probability = np.exp(LOGITS) / np.exp(LOGITS).sum(1, keepdims=True)
    one, other = Categorical(jnp.asarray(LOGITS)), Categorical(jnp.asarray(LOGITS[::-1]))
    expected = (probability * np.log(probability / probability[::-1])).sum(1)
    np.testing.assert_allclose(one.kl(other), expected, atol=1e-5)

    mean, std = np.array([[0.3, -1.0], [0.0, 1.5]]), np.array([[0.4, 1.3], [0.8, 0.5]])  # of two Gaussians
    action = np.linspace(-15, 15, 20_001)[:, None]
    p, q = (scipy.stats.norm(mean[k], std[k]) for k in (0, 1))
    expected = np.trapezoid(p.pdf(action) * (p.logpdf(action) - q.logpdf(action)), action, axis=0).sum()
    a, b = (Gaussian(jnp.asarray(mean[k]), jnp.asarray(std[k])) for k in (0, 1))
    np.testing.assert_allclose(a.kl(b), expected, rtol=1e-4)
    assert a.kl(a) == 0
