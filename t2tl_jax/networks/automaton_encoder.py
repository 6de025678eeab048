"""Message passing over the table: rows are nodes, letters are edges, and what a row means comes to it from its future.

It reads no formula but the automaton itself, so it knows equal rows as equal however they are written, and reads reward
machines too.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from flax import linen as nn

from t2tl_jax import checks
from t2tl_jax.ltl import AT_MOST_ONE, TaskTable
from t2tl_jax.networks.initializers import unit_norm
from t2tl_jax.networks.task_encoder import TaskEncoderConfig


@dataclass(frozen=True)
class AutomatonConfig(TaskEncoderConfig):
    """Sizes of the network over the automaton."""

    width: int = 64
    """Size of a row's vector."""
    rounds: int = 6
    """Rounds of messages, all with the same weights; what happens after more steps than this is not heard."""
    output: int = 32
    """Size of the code."""
    labels: int = 4096
    """Most sets of propositions that are listened to. Each set that can hold is one: 2^P where any propositions can."""

    def __post_init__(self) -> None:
        checks.counts(self, "width", "rounds", "output", "labels")

    @property
    def code_size(self) -> int:
        """Numbers in the code of a task."""
        return self.output

    @property
    def reads_tokens(self) -> bool:
        """It reads transitions."""
        return False

    @property
    def reads_transitions(self) -> bool:
        """Nothing else."""
        return True


def count_labels(table: TaskTable) -> int:
    """How many sets of propositions can hold at a step."""
    count = len(table.propositions)
    return count + 1 if table.alphabet == AT_MOST_ONE else 2**count


def every_label(table: TaskTable) -> np.ndarray:
    """What can be true at a step, also of propositions that no formula uses: bool[labels, P].

    So the code of a row is the same in a table of other tasks.
    """
    count = len(table.propositions)
    if table.alphabet == AT_MOST_ONE:
        return np.eye(count + 1, count, k=-1, dtype=bool)
    return (np.arange(2**count)[:, None] >> np.arange(count) & 1).astype(bool)


class AutomatonTaskEncoder(nn.Module):
    """Every row hears, for each letter, what the row that it leads to has heard: the largest of these messages, number
    by number, and their mean."""

    config: AutomatonConfig

    @nn.compact
    def __call__(self, table: TaskTable) -> jax.Array:
        """float32[rows, config.output], in (-1, 1)."""
        config = self.config
        if (count := count_labels(table)) > config.labels:
            raise ValueError(
                f"an automaton encoder listens to every set of propositions that can hold, and of "
                f"{len(table.propositions)} propositions there are {count:,}, more than labels={config.labels:,}; set "
                f"task_encoder.labels to {count} or more if there is memory for rows x labels x width, or use another "
                "encoder"
            )
        labels = every_label(table)
        next_row, _ = table.step_all(table.letter(jnp.asarray(labels)))
        verdict = jax.nn.one_hot(table.verdict + 1, 3)
        stays = (next_row == np.arange(table.num_rows)[:, None])[..., None].astype(jnp.float32)
        start = nn.Dense(config.width, kernel_init=unit_norm(), name="verdict")(verdict)
        letter = nn.Dense(config.width, use_bias=False, kernel_init=unit_norm(), name="letter")(
            labels.astype(jnp.float32)
        )
        stay = nn.Dense(config.width, use_bias=False, kernel_init=unit_norm(), name="stay")(stays)
        heard = nn.Dense(config.width, use_bias=False, kernel_init=unit_norm(), name="heard")
        update = nn.Dense(config.width, kernel_init=unit_norm(), name="update")
        h = jnp.tanh(start)
        for _ in range(config.rounds):
            messages = jnp.tanh(heard(h)[next_row] + letter + stay)  # [rows, labels, width]
            news = jnp.concatenate([h, messages.max(axis=1), messages.mean(axis=1)], axis=-1)
            h = jnp.tanh(start + update(news))
        return jnp.tanh(nn.Dense(config.output, kernel_init=unit_norm(), name="output")(h))
