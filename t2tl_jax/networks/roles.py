"""What each proposition does to a row now: it fails it, finishes it, changes it, or none of these. No parameters.

Colours with the same role are the same to an agent that reads nothing else, whatever they are called; so it may meet
colours that it was not trained with. Of what comes after the next change it knows nothing: that takes another code
beside it (`joined`).
"""

from dataclasses import dataclass
from typing import ClassVar

import jax
import jax.numpy as jnp
from flax import linen as nn

from t2tl_jax import checks
from t2tl_jax.ltl import TaskTable
from t2tl_jax.networks.task_encoder import TaskEncoderConfig

ROLES = ("fails", "finishes", "progresses", "neutral")
"""The roles of a proposition, in the order of the code."""


@dataclass(frozen=True)
class RolesConfig(TaskEncoderConfig):
    """The role of every proposition in the current row."""

    learned: ClassVar[bool] = False

    propositions: int = 8
    """Room for so many propositions, at least those of the environment; those that it lacks are zeros."""

    def __post_init__(self) -> None:
        checks.counts(self, "propositions")

    @property
    def code_size(self) -> int:
        """A unit vector for each proposition."""
        return len(ROLES) * self.propositions

    @property
    def carries_over(self) -> bool:
        """The code says what to do, in every task alike."""
        return True

    @property
    def reads_transitions(self) -> bool:
        """Nothing else."""
        return True

    @property
    def propositions_told(self) -> int:
        """Of so many propositions there is the role."""
        return self.propositions

    def by_proposition(self, code: jax.Array) -> tuple[jax.Array, jax.Array]:
        """[..., propositions, 4], and nothing else, [..., 0]."""
        return code.reshape(*code.shape[:-1], self.propositions, len(ROLES)), code[..., :0]


class RolesTaskEncoder(nn.Module):
    """Per row and proposition the unit vector of its role, if it alone holds. True and false are zeros."""

    config: RolesConfig

    def __call__(self, table: TaskTable) -> jax.Array:
        """float32[rows, code_size]."""
        room, count = self.config.propositions, len(table.propositions)
        if count > room:
            raise ValueError(
                f"roles with room for {room} propositions cannot tell the {count} of this environment apart; set "
                f"task_encoder.propositions to {count} or more"
            )
        after, _ = table.step_all(table.letter(jnp.eye(count, dtype=bool)))  # [rows, P]
        verdict, moved = table.verdict[after], after != jnp.arange(table.num_rows)[:, None]
        role = jnp.select([verdict < 0, verdict > 0, moved], [0, 1, 2], 3)
        unit = jax.nn.one_hot(role, len(ROLES)) * (table.verdict == 0)[:, None, None]
        return jnp.pad(unit, ((0, 0), (0, room - count), (0, 0))).reshape(table.num_rows, -1)
