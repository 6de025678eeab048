"""A task encoder: the sum of learned vectors of a formula's words."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from flax import linen as nn

from t2tl_jax import TaskEncoderConfig, TaskTable, register_task_encoder


@dataclass(frozen=True)
class BagConfig(TaskEncoderConfig):
    """Sizes of the bag of words."""

    size: int = 8
    """Size of the encoded task."""

    @property
    def code_size(self) -> int:
        return self.size


class Bag(nn.Module):
    """Ignores the order of words; which of few sub-tasks is left shows all the same."""

    config: BagConfig

    @nn.compact
    def __call__(self, table: TaskTable) -> jax.Array:
        words = nn.Embed(table.vocabulary_size, self.config.size, name="words")(table.tokens)
        return jnp.tanh((words * table.mask[..., None]).sum(axis=-2))


register_task_encoder("bag", BagConfig, Bag)
