"""Objects gated by the task's code: a few sums of their readings, weighed by what is read off the code.

`merged` takes from a code what each proposition is to the task. A code that was learned from text does not say that in
so many numbers; here one linear layer learns to read it off.
"""

from dataclasses import dataclass
from typing import ClassVar

import jax
import jax.numpy as jnp
from flax import linen as nn

from t2tl_jax import checks
from t2tl_jax.networks.objects import check_objects, object_features
from t2tl_jax.networks.state_encoder import Squash, StateEncoderConfig
from t2tl_jax.networks.task_encoder import TaskEncoderConfig
from t2tl_jax.objects import Objects


@dataclass(frozen=True)
class GatedConfig(StateEncoderConfig):
    """The lidars, or other readings that are 0 where there is nothing, in a few weighted sums."""

    reads_task: ClassVar[bool] = True

    gates: int = 8
    """How many sums; in each of them every proposition has a weight from 0 to 1."""

    def __post_init__(self) -> None:
        checks.counts(self, "gates")

    def check(self, objects: Objects | None, reader: TaskEncoderConfig) -> None:
        """There have to be readings that can be added up."""
        del reader
        if (given := check_objects("network.state=gated", objects)).place:
            raise ValueError(
                f"places cannot be added up, and these objects have some (place={given.place}); use "
                "network.state=objects"
            )


class GatedEncoder(nn.Module):
    """For each gate: the sum of all objects' readings, each times its proposition's weight."""

    config: GatedConfig
    objects: Objects
    reader: TaskEncoderConfig
    squash: Squash

    @nn.compact
    def __call__(self, obs: jax.Array, task: jax.Array) -> jax.Array:
        """obs [..., O] and task [..., dim], broadcast against each other -> [..., own + gates x size]."""
        own, each = (self.squash(x) for x in object_features(obs, self.objects, 1.0))
        which = jnp.array(self.objects.proposition)
        count = max(self.objects.proposition) + 1
        weights = nn.sigmoid(nn.Dense(count * self.config.gates, name="gates")(task))
        weights = weights.reshape(*task.shape[:-1], count, self.config.gates)[..., which, :]  # [..., n, gates]
        sums = jnp.einsum("...ns,...ng->...gs", each, weights)
        sums = sums.reshape(*sums.shape[:-2], -1)
        return jnp.concatenate([jnp.broadcast_to(own, (*sums.shape[:-1], own.shape[-1])), sums], axis=-1)
