"""Objects merged by what they are to the task: of each kind the largest reading, and nothing of names.

With lidars as objects this is GenZ-LTL's reduction of the observation (one lidar for what is to be reached and one for
what is to be avoided), for all that a code says of propositions.
"""

from dataclasses import dataclass
from typing import ClassVar

import jax
import jax.numpy as jnp
from flax import linen as nn

from t2tl_jax.networks.objects import check_roles, object_features
from t2tl_jax.networks.state_encoder import Squash, StateEncoderConfig
from t2tl_jax.networks.task_encoder import TaskEncoderConfig
from t2tl_jax.objects import Objects


@dataclass(frozen=True)
class MergedConfig(StateEncoderConfig):
    """The lidars, or other readings that are 0 where there is nothing, merged by role."""

    reads_task: ClassVar[bool] = True
    in_windows: ClassVar[bool] = True
    in_carried: ClassVar[bool] = True

    @property
    def by_role(self) -> bool:
        """Nothing else is read."""
        return True

    def check(self, objects: Objects | None, reader: TaskEncoderConfig) -> None:
        """There have to be readings, and a code that speaks of each proposition by itself."""
        objects = check_roles("network.state=merged", objects, reader)
        if objects.place:
            raise ValueError(
                "places cannot be merged, and these objects have some (place="
                f"{objects.place}); use network.state=objects with network.state.identity=role"
            )

    def left_of(self, task: jax.Array, reader: TaskEncoderConfig) -> jax.Array:
        """What the code says of no proposition in particular."""
        return reader.by_proposition(task)[1]


class MergedEncoder(nn.Module):
    """For each number that the code tells of a proposition: the objects' readings times it, the largest of them."""

    config: MergedConfig
    objects: Objects
    reader: TaskEncoderConfig
    squash: Squash

    def __call__(self, obs: jax.Array, task: jax.Array) -> jax.Array:
        """obs [..., O] and task [..., dim], broadcast against each other -> [..., own + K size]."""
        own, each = self._features(obs)
        merged = (each[..., :, None, :] * self._told(task)[..., None]).max(axis=-3)  # [..., K, size]
        merged = merged.reshape(*merged.shape[:-2], -1)
        return jnp.concatenate([jnp.broadcast_to(own, (*merged.shape[:-1], own.shape[-1])), merged], axis=-1)

    def of_objects(self, obs: jax.Array) -> jax.Array:
        """What each object is beside the agent, for no task: obs [..., O] -> [..., n, own + size]."""
        own, each = self._features(obs)
        own = jnp.broadcast_to(own[..., None, :], (*each.shape[:-1], own.shape[-1]))
        return jnp.concatenate([own, each], axis=-1)

    def of_remembered(self, remembered: jax.Array, task: jax.Array) -> jax.Array:
        """What was remembered of each object [..., n, H], merged by the task [..., dim] -> [..., K H].

        It is a sum, since that is no reading, which is 0 where there is nothing and larger where something is near.
        """
        merged = jnp.einsum("...nk,...nh->...kh", self._told(task), remembered)
        return merged.reshape(*merged.shape[:-2], -1)

    def _features(self, obs: jax.Array) -> tuple[jax.Array, jax.Array]:
        """[..., own] and [..., n, size]."""
        own, each = object_features(obs, self.objects, 1.0)
        return self.squash(own), self.squash(each)

    def _told(self, task: jax.Array) -> jax.Array:
        """What the code [..., dim] says of each object's proposition: [..., n, K]."""
        return self.reader.by_proposition(task)[0][..., jnp.array(self.objects.proposition), :]
