"""What the table knows of a row, as numbers: which propositions to touch now and next, which not, and how far it is.

No parameters. A network that reads this has to learn how to reach and to avoid, but not what formulas mean; so it makes
sense of any task of its propositions, seen or not.
"""

from dataclasses import dataclass
from typing import ClassVar

import jax
import jax.numpy as jnp
from flax import linen as nn

from t2tl_jax import checks
from t2tl_jax.ltl import TaskTable
from t2tl_jax.ltl.ahead import distance_to_true, nearest_to_true
from t2tl_jax.networks.task_encoder import TaskEncoderConfig


@dataclass(frozen=True)
class LookaheadConfig(TaskEncoderConfig):
    """Exact look-ahead along the shortest way to true."""

    learned: ClassVar[bool] = False

    propositions: int = 8
    """Room for so many propositions, at least those of the environment; those that it lacks are zeros."""
    steps: int = 3
    """Steps of the way that are told."""

    def __post_init__(self) -> None:
        checks.counts(self, "propositions", "steps")

    @property
    def code_size(self) -> int:
        """Two numbers for each step and proposition, and the distance."""
        return 2 * self.steps * self.propositions + 1

    @property
    def carries_over(self) -> bool:
        """The code says what to do, in every task alike."""
        return True

    @property
    def propositions_told(self) -> int:
        """Of so many propositions there are two numbers for each step."""
        return self.propositions

    def by_proposition(self, code: jax.Array) -> tuple[jax.Array, jax.Array]:
        """[..., propositions, 2 steps] and the distance [..., 1]."""
        told = code[..., :-1].reshape(*code.shape[:-1], 2 * self.steps, self.propositions)
        return jnp.swapaxes(told, -1, -2), code[..., -1:]


class LookaheadTaskEncoder(nn.Module):
    """Per row and for each of some steps along the shortest way to true: per proposition, 1 if it alone makes the row
    false, and 1 if it alone brings the row nearer to true; then the distance, in letters.

    The way takes the letter that leads to the least distance, the first of several. Where propositions hold together
    only in pairs, none of them is the one that brings the row nearer. True and false are zeros, and so is every step
    behind the end of the way.
    """

    config: LookaheadConfig

    def __call__(self, table: TaskTable) -> jax.Array:
        """float32[rows, code_size]."""
        config, count = self.config, len(table.propositions)
        if count > config.propositions:
            raise ValueError(
                f"a look-ahead with room for {config.propositions} propositions cannot tell the {count} of this "
                f"environment apart; set task_encoder.propositions to {count} or more"
            )
        distance = distance_to_true(table)
        alone = table.letter(jnp.eye(count, dtype=bool))
        shortest = nearest_to_true(table, distance)
        is_open = (table.verdict == 0)[:, None]
        after, _ = table.step_all(alone)  # [rows, P]
        fails = is_open & (table.verdict[after] < 0)
        nears = is_open & (distance[after] < distance[:, None])
        room = ((0, 0), (0, config.propositions - count))
        seen = jnp.stack([jnp.pad(fails, room), jnp.pad(nears, room)], axis=1)  # [rows, 2, room]

        row, steps = jnp.arange(table.num_rows), []
        for _ in range(config.steps):
            steps.append(seen[row])
            row = shortest[row]
        told = jnp.stack(steps, axis=1).reshape(table.num_rows, -1).astype(jnp.float32)
        far = jnp.where(is_open & (distance < table.num_rows)[:, None], distance[:, None], 0).astype(jnp.float32)
        return jnp.concatenate([told, far], axis=-1)
