"""The interface of every environment here: brax's ``Env`` plus propositions and labels.

A labelled environment says which atomic propositions hold in a state. What a task makes of these labels (progression,
reward, the end of an episode) is decided outside, so no environment knows any temporal logic. No environment has a
time limit of its own either; one that is published with an environment is a constant of its module.
"""

import abc
from typing import Literal

import jax
from brax.envs.base import Env, State

__all__ = ["Alphabet", "LabelledEnv", "State"]

Alphabet = Literal["at_most_one", "every_subset"]


class LabelledEnv(Env):
    """A single unbatched environment whose states carry labels; ``jax.vmap`` makes it a batch.

    ``reset`` and ``step`` are deterministic functions of their arguments and return the same tree of shapes and dtypes.
    Everything that a reset must restore lives in ``State.pipeline_state``. ``reset`` takes typed keys
    (``jax.random.key``) and legacy ``uint32[2]`` keys alike, and gives the same state for both.
    """

    @property
    @abc.abstractmethod
    def propositions(self) -> tuple[str, ...]:
        """Names of the atomic propositions, in the order of ``labels``."""

    @property
    @abc.abstractmethod
    def alphabet(self) -> Alphabet:
        """Which label sets occur: ``"at_most_one"`` true proposition at a time (guaranteed), or ``"every_subset"``."""

    @abc.abstractmethod
    def labels(self, state: State) -> jax.Array:
        """Which propositions hold in ``state``: ``bool[P]``."""

    @property
    @abc.abstractmethod
    def num_actions(self) -> int | None:
        """Number of discrete actions, or ``None`` when actions are ``float[action_size]`` in [-1, 1]."""

    def for_seed(self, seed: jax.Array) -> "LabelledEnv":
        """The environment of the run with this seed, which may be traced; here the same for all of them."""
        del seed
        return self
