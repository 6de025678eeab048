"""The interface of every environment here: brax's ``Env`` plus propositions, labels, and parameters as data.

A labelled environment says which atomic propositions hold in a state. What a task makes of these labels (progression,
reward, the end of an episode) is decided outside, so no environment knows any temporal logic. No environment has a
time limit of its own either; one that is published with an environment is a constant of its module.

An environment is an object without state. What varies between seeds (maps, sizes) is a pytree of arrays that
``make_params`` makes on the host and that ``reset`` and ``step`` take: one compiled program serves all seeds.
"""

import abc
from dataclasses import dataclass
from typing import Any, Literal

import jax

from t2tl_jax.objects import Objects
from t2tl_jax.quiet import quiet_imports
from t2tl_jax.view import View

with quiet_imports():  # of MJX; others here take the names of brax from this module
    from brax.envs.base import Env, State

__all__ = ["Alphabet", "Env", "EnvConfig", "EnvParams", "LabelledEnv", "Purpose", "State"]

Alphabet = Literal["at_most_one", "every_subset"]

Purpose = Literal["training", "evaluation", "selection"]
"""What episodes are played for: to learn, to report how good a policy is, or to choose between parameters. Where maps
are random, each of them has its own."""

EnvParams = Any  # a pytree of arrays


@dataclass(frozen=True)
class EnvConfig:
    """What distinguishes one environment of a kind from another; the base class of every kind's configuration."""


class LabelledEnv(Env):
    """A single unbatched environment whose states carry labels; ``jax.vmap`` makes it a batch.

    ``reset`` and ``step`` are deterministic functions of their arguments and return the same tree of shapes and dtypes,
    ``State.metrics`` included. Everything that a reset must restore lives in ``State.pipeline_state``. ``reset`` takes
    typed keys (``jax.random.key``) and legacy ``uint32[2]`` keys alike, and gives the same state for both.
    """

    def make_params(self, seed: int, purpose: Purpose = "training") -> EnvParams:
        """What varies between the seeds of a run, made on the host; nothing, ``()``, for most environments.

        Args:
            seed: number of the seed.
            purpose: where maps are drawn at random, each purpose has maps of its own; else the same for all.

        Returns:
            A pytree of NumPy arrays, of the same structure, shapes and dtypes for every seed.

        Raises:
            ValueError: for a seed that the environment has nothing for.
        """
        del seed, purpose
        return ()

    @property
    def renewable(self) -> bool:
        """Whether training can go on with other maps, those of `renewed_params`."""
        return False

    def renewed_params(self, seed: int, renewal: int) -> EnvParams:
        """What a seed trains with from a renewal of its maps on; made on the host, beside the training.

        Args:
            seed: number of the seed.
            renewal: from 1; before the first one, training has ``make_params(seed)``.

        Returns:
            What `make_params` returns for training, with other maps. They are drawn apart from those of evaluation and
            selection; where few maps exist, some may come in both.

        Raises:
            NotImplementedError: where nothing is renewable.
        """
        raise NotImplementedError(f"{type(self).__name__} has no maps to renew")

    def independent_params(self, seed: int, count: int) -> EnvParams | None:
        """Maps for `count` episodes that are to be independent of each other: one of its own for each.

        They are drawn from all maps, as those of `make_params` are, and serve nothing else. A rate over such episodes
        is one over maps, and not over those of one pool.

        Args:
            seed: number of the seed.
            count: how many episodes.

        Returns:
            What `make_params` returns with a single map, stacked: every leaf leads with ``[count]``. None, as by
            default, where `make_params` draws no maps at random.
        """
        del seed, count
        return None

    @abc.abstractmethod
    def reset(self, rng: jax.Array, params: EnvParams | None = None) -> State:
        """The start of an episode. Without `params`, those of ``make_params(0)``, as foreign trainers call it."""

    @abc.abstractmethod
    def step(self, state: State, action: jax.Array, params: EnvParams | None = None) -> State:
        """The state one step later. `params` are those of the episode's ``reset``."""

    @property
    def fixed_start(self) -> bool:
        """Whether every reset with the same `params` gives the same state, whatever its key.

        A deterministic policy then plays one and the same episode of a task, which an evaluation plays and counts once.
        """
        return False

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

    def failed(self, state: State) -> jax.Array | None:
        """Whether the physics failed in the step that led to `state`, if that state no longer shows it: ``bool[]``.

        An environment that goes on with finite numbers in the place of broken ones says so here, and the seed is told
        and frozen as one with a broken observation is. None, as by default, for one that hides nothing.
        """
        del state
        return None

    @property
    @abc.abstractmethod
    def num_actions(self) -> int | None:
        """Number of discrete actions, or ``None`` when actions are ``float[action_size]`` in [-1, 1]."""

    @property
    def objects(self) -> Objects | None:
        """Which numbers of the observation describe which object, for networks over objects; None if none do."""
        return None

    def view(self) -> View | None:
        """How the environment looks from above, for animations; None where there is nothing to see."""
        return None
