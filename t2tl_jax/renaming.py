"""An environment whose propositions change their names from episode to episode, so that an agent relies on none.

What is called Red is shown where Red is shown, whatever it was before: the objects of an observation change places
together with the labels. Where the propositions differ in nothing but their names, such an episode is as good as any.
"""

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from t2tl_jax.env import Alphabet, EnvParams, LabelledEnv, Purpose, State
from t2tl_jax.objects import Objects


@struct.dataclass
class RenamedState:
    """Pipeline state of a `Renamed` environment."""

    env: struct.PyTreeNode
    """The wrapped environment's own."""
    order: jax.Array
    """``int32[P]``: which of the wrapped environment's propositions bears each name in this episode."""


class Renamed(LabelledEnv):
    """Another environment with its propositions' names drawn anew at every reset, each order as likely as any.

    Args:
        env: the environment, which has to describe its objects, as many for every proposition.

    Raises:
        ValueError: if it does not.
    """

    def __init__(self, env: LabelledEnv) -> None:
        objects, count = env.objects, len(env.propositions)
        if objects is None:
            raise ValueError(
                "propositions can be renamed only where the environment says which numbers of its observation are "
                "objects (LabelledEnv.objects), and this one does not; use renaming=False"
            )
        of_each = np.bincount(objects.proposition, minlength=count)
        if len(of_each) > count or of_each.min() != of_each.max():
            raise ValueError(
                "propositions can be renamed only if each has as many objects as any other, got "
                f"{', '.join(map(str, of_each))} for the {count} of this environment; use renaming=False"
            )
        self.env = env
        # By proposition the numbers of its objects, in their order.
        by_proposition = np.argsort(objects.proposition, kind="stable")
        self._numbers = np.array(objects.numbers)[by_proposition].reshape(count, -1)
        self._described = objects

    def make_params(self, seed: int, purpose: Purpose = "training") -> EnvParams:
        """Those of the environment."""
        return self.env.make_params(seed, purpose)

    def reset(self, rng: jax.Array, params: EnvParams | None = None) -> State:
        """The start of an episode under names of its own."""
        env_key, order_key = jax.random.split(rng)
        order = jax.random.permutation(order_key, jnp.arange(len(self.propositions), dtype=jnp.int32))
        return self._shown(self.env.reset(env_key, params), order)

    def step(self, state: State, action: jax.Array, params: EnvParams | None = None) -> State:
        """The state one step later, under the same names."""
        hidden = self._hidden(state)
        return self._shown(self.env.step(hidden, action, params), state.pipeline_state.order)

    def labels(self, state: State) -> jax.Array:
        """Which propositions hold under their names of this episode: ``bool[P]``."""
        return self.env.labels(self._hidden(state))[state.pipeline_state.order]

    def failed(self, state: State) -> jax.Array | None:
        """Whether the environment's physics did."""
        return self.env.failed(self._hidden(state))

    def _hidden(self, state: State) -> State:
        """The state as the wrapped environment knows it, but for the observation, from which no step is made."""
        return state.replace(pipeline_state=state.pipeline_state.env)

    def _shown(self, state: State, order: jax.Array) -> State:
        shown = state.obs.at[self._numbers].set(state.obs[self._numbers][order])
        return state.replace(pipeline_state=RenamedState(env=state.pipeline_state, order=order), obs=shown)

    @property
    def renewable(self) -> bool:
        """Whether the environment's maps are."""
        return self.env.renewable

    def renewed_params(self, seed: int, renewal: int) -> EnvParams:
        """Those of the environment."""
        return self.env.renewed_params(seed, renewal)

    def independent_params(self, seed: int, count: int) -> EnvParams | None:
        """Those of the environment."""
        return self.env.independent_params(seed, count)

    @property
    def objects(self) -> Objects:
        """Those of the environment: objects change places, and what a place stands for stays."""
        return self._described

    @property
    def propositions(self) -> tuple[str, ...]:
        """The same names."""
        return self.env.propositions

    @property
    def alphabet(self) -> Alphabet:
        """That of the environment."""
        return self.env.alphabet

    @property
    def observation_size(self) -> int:
        """That of the environment."""
        return self.env.observation_size

    @property
    def action_size(self) -> int:
        """That of the environment."""
        return self.env.action_size

    @property
    def num_actions(self) -> int | None:
        """That of the environment."""
        return self.env.num_actions

    @property
    def backend(self) -> str:
        """Name of the physics."""
        return self.env.backend
