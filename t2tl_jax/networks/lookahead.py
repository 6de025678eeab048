"""What the table knows of a row, as numbers: which propositions to touch now and next, which not, and how far it is.

No parameters. A network that reads this has to learn how to reach and to avoid, but not what formulas mean; so it makes
sense of any task of its propositions, seen or not.
"""

from dataclasses import dataclass
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
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
    farther: bool = False
    """Tell, too, what leads farther from true without failing, such as what a task has to make up for."""
    avoid_farther: bool = False
    """Count what leads farther among what fails as well, so that a network that has learned to avoid the one avoids the
    other before it has met such a task; `farther` still tells them apart. Needs that."""
    one_at_a_time: bool = False
    """Count only ways on which at most one proposition holds at a time, as where objects seldom overlap. Else,
    where several can hold, `F(a & F b)` is true after a single letter, and a alone brings it no nearer. Of what takes
    several at once the code then knows no way."""
    letters: tuple[str, ...] = ()
    """What can hold at once, where that is more or less than each proposition by itself: 'Blue & Green' for both and
    nothing else. Only such ways count, and each of these is told of instead of the propositions. Empty for every
    letter of the table."""

    def __post_init__(self) -> None:
        checks.counts(self, "propositions", "steps")
        if self.avoid_farther and not self.farther:
            raise ValueError("avoid_farther=True needs farther=True, which tells what leads farther from what fails")
        if self.one_at_a_time and self.letters:
            raise ValueError(
                f"task_encoder.letters={self.letters} says what can hold at once already; leave one_at_a_time=False"
            )
        if len({_holds(letter) for letter in self.letters}) < len(self.letters):
            raise ValueError(f"a letter comes twice in task_encoder.letters={self.letters}")

    @property
    def kinds(self) -> int:
        """Numbers for each step and proposition or letter."""
        return 3 if self.farther else 2

    @property
    def told(self) -> int:
        """Of how many propositions or letters there are numbers."""
        return len(self.letters) or self.propositions

    @property
    def code_size(self) -> int:
        """Some numbers for each step and proposition or letter, and the distance."""
        return self.kinds * self.steps * self.told + 1

    @property
    def carries_over(self) -> bool:
        """The code says what to do, in every task alike."""
        return True

    @property
    def reads_transitions(self) -> bool:
        """Nothing else."""
        return True

    def letters_told(self, table: TaskTable) -> jax.Array:
        """Each proposition by itself, or `letters`."""
        return table.letter(jnp.asarray(_labels(self, table)))

    @property
    def propositions_told(self) -> int | None:
        """Of so many propositions there are numbers for each step; None where letters are told of."""
        return None if self.letters else self.propositions

    def by_proposition(self, code: jax.Array) -> tuple[jax.Array, jax.Array]:
        """[..., propositions, numbers x steps] and the distance [..., 1]."""
        told = code[..., :-1].reshape(*code.shape[:-1], self.kinds * self.steps, self.propositions)
        return jnp.swapaxes(told, -1, -2), code[..., -1:]


def _holds(letter: str) -> frozenset[str]:
    return frozenset(name.strip() for name in letter.split("&"))


def _labels(config: LookaheadConfig, table: TaskTable) -> np.ndarray:
    """What is told of, as labels: bool[letters, P]."""
    names = table.propositions
    if not config.letters:
        if len(names) > config.propositions:
            raise ValueError(
                f"a look-ahead with room for {config.propositions} propositions cannot tell the {len(names)} of this "
                f"environment apart; set task_encoder.propositions to {len(names)} or more"
            )
        return np.eye(len(names), dtype=bool)
    letters = [_holds(letter) for letter in config.letters]
    unknown = sorted(frozenset().union(*letters) - set(names))
    if unknown:
        raise ValueError(
            f"task_encoder.letters speaks of {', '.join(unknown)}; this environment has {', '.join(names)}"
        )
    return np.array([[name in letter for name in names] for letter in letters])


class LookaheadTaskEncoder(nn.Module):
    """Per row and for each of some steps along the shortest way to true: per proposition or letter, 1 if it alone makes
    the row false (or, with `avoid_farther`, brings it farther from true), 1 if it alone brings the row nearer to true,
    and perhaps 1 if it brings it farther away; then the distance, in letters.

    The way takes the letter that leads to the least distance, the first of several. Where propositions hold together
    only in pairs, none of them is the one that brings the row nearer. True and false are zeros, and so is every step
    behind the end of the way. Where no way counts that leads to true, the distance is 0, what fails is told at every
    step, and whatever leads there leads farther away.
    """

    config: LookaheadConfig

    def __call__(self, table: TaskTable) -> jax.Array:
        """float32[rows, code_size]."""
        config, labels = self.config, _labels(self.config, table)
        alone, letters = table.letter(jnp.asarray(labels)), None
        if config.letters or config.one_at_a_time:
            letters = jnp.concatenate([table.letter(jnp.zeros((1, len(table.propositions)), bool)), alone])
        distance = distance_to_true(table, letters)
        shortest = nearest_to_true(table, distance, letters)
        is_open = (table.verdict == 0)[:, None]
        after, _ = table.step_all(alone)  # [rows, P]
        fails = is_open & (table.verdict[after] < 0)
        nears = is_open & (distance[after] < distance[:, None])
        kinds = [fails, nears]
        if config.farther:
            farther = is_open & ~fails & (distance[after] > distance[:, None])
            kinds = [fails | farther if config.avoid_farther else fails, nears, farther]
        room = ((0, 0), (0, config.told - len(labels)))
        seen = jnp.stack([jnp.pad(kind, room) for kind in kinds], axis=1)  # [rows, kinds, room]

        row, steps = jnp.arange(table.num_rows), []
        for _ in range(config.steps):
            steps.append(seen[row])
            row = shortest[row]
        told = jnp.stack(steps, axis=1).reshape(table.num_rows, -1).astype(jnp.float32)
        far = jnp.where(is_open & (distance < table.num_rows)[:, None], distance[:, None], 0).astype(jnp.float32)
        return jnp.concatenate([told, far], axis=-1)
