"""Distributions over actions behind one interface: a diagonal Gaussian, and a choice among a few actions."""

from typing import Protocol, Self

import jax
import jax.numpy as jnp
from flax import struct
from jax.scipy.stats import norm


class Distribution(Protocol):
    """What a learner needs of a policy's output; leading axes `[...]` are those of the observations."""

    def sample(
        self, key: jax.Array, noise: jax.Array | None = None, correlation: jax.Array | float = 0.0
    ) -> tuple[jax.Array, jax.Array | None]:
        """An action, and the noise that made it, which is the `noise` of the next step.

        Without `noise` the draw is independent. With it, successive noises correlate, and every action by itself still
        has this distribution.
        """
        ...

    def log_prob(self, action: jax.Array) -> jax.Array:
        """Log-density or log-probability of an action: float32[...]."""
        ...

    def entropy(self) -> jax.Array:
        """Entropy of every action dimension: float32[..., A]; of a choice float32[...]."""
        ...

    def mode(self) -> jax.Array:
        """The most probable action."""
        ...

    def kl(self, other: Self) -> jax.Array:
        """Kullback-Leibler divergence KL(self || other) in nats: float32[...]."""
        ...


@struct.dataclass
class Gaussian:
    """A diagonal Gaussian over actions float32[..., A]."""

    mean: jax.Array  # float32[..., A]
    std: jax.Array  # float32[..., A]

    def sample(
        self, key: jax.Array, noise: jax.Array | None = None, correlation: jax.Array | float = 0.0
    ) -> tuple[jax.Array, jax.Array | None]:
        """Action float32[..., A], and its noise in units of the standard deviation, float32[..., A]."""
        fresh = jax.random.normal(key, self.mean.shape)
        noise = fresh if noise is None else correlation * noise + jnp.sqrt(1 - correlation**2) * fresh
        return self.mean + self.std * noise, noise

    def log_prob(self, action: jax.Array) -> jax.Array:
        """Log-density, summed over the action's dimensions: float32[...]."""
        return norm.logpdf(action, self.mean, self.std).sum(axis=-1)

    def entropy(self) -> jax.Array:
        """Entropy of every dimension: float32[..., A]."""
        return 0.5 * jnp.log(2 * jnp.pi * jnp.e) + jnp.log(self.std)

    def mode(self) -> jax.Array:
        """The mean: float32[..., A]."""
        return self.mean

    def kl(self, other: "Gaussian") -> jax.Array:
        """KL(self || other), summed over the action's dimensions: float32[...]."""
        ratio, distance = self.std / other.std, (self.mean - other.mean) / other.std
        return 0.5 * (ratio**2 + distance**2 - 1.0 - 2.0 * jnp.log(ratio)).sum(axis=-1)


@struct.dataclass
class Categorical:
    """One of A actions, int32[...]. Its draws are independent: correlated noise is for continuous actions."""

    logits: jax.Array  # float32[..., A], up to a constant

    def sample(
        self, key: jax.Array, noise: jax.Array | None = None, correlation: jax.Array | float = 0.0
    ) -> tuple[jax.Array, jax.Array | None]:
        """Action int32[...]; the noise comes back as it was given."""
        del correlation
        return jax.random.categorical(key, self.logits).astype(jnp.int32), noise

    def log_prob(self, action: jax.Array) -> jax.Array:
        """Log-probability: float32[...]."""
        return jnp.take_along_axis(jax.nn.log_softmax(self.logits), action[..., None], axis=-1)[..., 0]

    def entropy(self) -> jax.Array:
        """Entropy of the choice: float32[...]."""
        log_probability = jax.nn.log_softmax(self.logits)
        return -(jnp.exp(log_probability) * log_probability).sum(axis=-1)

    def mode(self) -> jax.Array:
        """The most probable action: int32[...]."""
        return self.logits.argmax(axis=-1).astype(jnp.int32)

    def kl(self, other: "Categorical") -> jax.Array:
        """KL(self || other): float32[...]."""
        log_probability, log_other = jax.nn.log_softmax(self.logits), jax.nn.log_softmax(other.logits)
        return (jnp.exp(log_probability) * (log_probability - log_other)).sum(axis=-1)
