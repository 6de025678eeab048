"""What a representation of states offers: a module from an observation and the code of a task to features."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, TypeAlias

import jax

from t2tl_jax.networks.task_encoder import TaskEncoderConfig
from t2tl_jax.objects import Objects

Squash: TypeAlias = Callable[[jax.Array], jax.Array]
"""What a network does to the numbers of an observation, one by one, before it reads them."""


@dataclass(frozen=True)
class StateEncoderConfig:
    """Base class of every state encoder's configuration; `register_state_encoder` joins it to the module it makes."""

    reads_task: ClassVar[bool] = False
    """Whether the features depend on the task, so that a state has others for every row of the table."""
    in_windows: ClassVar[bool] = False
    """Whether a context window can hold such states. Those that read the task are then made anew of every remembered
    observation for every step that reads it, so they should have no parameters."""
    in_carried: ClassVar[bool] = False
    """Of states that read the task: whether their objects can be remembered each by itself and merged later, so that a
    state that is carried can remember them. The module then has `of_objects` and `of_remembered`, see `merged.py`."""

    @property
    def by_role(self) -> bool:
        """Whether of an object nothing is read but its numbers and what the code says of its proposition. Propositions
        may then be renamed and others may come, as many as the code has room for."""
        return False

    def check(self, objects: Objects | None, reader: TaskEncoderConfig) -> None:
        """Whether this can read such observations and such codes.

        Args:
            objects: what the environment says about its observation, None if it says nothing.
            reader: the configuration of the task encoder.

        Raises:
            ValueError: if it cannot.
        """

    def left_of(self, task: jax.Array, reader: TaskEncoderConfig) -> jax.Array:
        """What the layers behind the encoder read of codes [..., dim]: all of it, unless a subclass says other."""
        del reader
        return task
