"""Task encoders that show what others know: one that says nothing, and one that tells rows apart and says no more."""

from dataclasses import dataclass
from typing import ClassVar

import jax
import jax.numpy as jnp
from flax import linen as nn

from t2tl_jax import checks
from t2tl_jax.agents.learning_rows import marks
from t2tl_jax.ltl import TaskTable
from t2tl_jax.networks.task_encoder import TaskEncoderConfig
from t2tl_jax.registry import register_task_encoder


@dataclass(frozen=True)
class NothingConfig(TaskEncoderConfig):
    """The same code for every row: an agent that does not see its task."""

    learned: ClassVar[bool] = False

    @property
    def code_size(self) -> int:
        """A zero."""
        return 1

    @property
    def carries_over(self) -> bool:
        """There is nothing that could be wrong for another task."""
        return True


class NothingTaskEncoder(nn.Module):
    """Zeros."""

    config: NothingConfig

    def __call__(self, table: TaskTable) -> jax.Array:
        """float32[rows, 1]."""
        return jnp.zeros((table.num_rows, 1))


@dataclass(frozen=True)
class NamesConfig(TaskEncoderConfig):
    """A random vector for every text, the same in every table. It is what a one-hot code is to a single table: rows are
    told apart, and nothing is said of what they mean, so that what was learned of one row says nothing of another."""

    learned: ClassVar[bool] = False

    size: int = 64
    """Numbers of the vector, each 1 or -1."""

    def __post_init__(self) -> None:
        checks.counts(self, "size")

    @property
    def code_size(self) -> int:
        """As many numbers as asked for."""
        return self.size

    @property
    def carries_over(self) -> bool:
        """A text has the same code wherever it stands, though one that is new says nothing."""
        return True


class NamesTaskEncoder(nn.Module):
    """The mark of a row's formula seeds the generator that draws its code."""

    config: NamesConfig

    def __call__(self, table: TaskTable) -> jax.Array:
        """float32[rows, size]."""

        def code(mark: jax.Array) -> jax.Array:
            return jax.random.rademacher(jax.random.key(mark), (self.config.size,), jnp.float32)

        return jax.vmap(code)(marks(table))


register_task_encoder("nothing", NothingConfig, NothingTaskEncoder)
register_task_encoder("names", NamesConfig, NamesTaskEncoder)
