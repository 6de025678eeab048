"""A world with one state, in which the action says which proposition is true: what a task asks for, and nothing else.

Task encoders are pre-trained here, since everything that can be learned is the meaning of the formulas.

Where every proposition can be chosen, an agent need only know one that brings it on. A robot also has to know what to
keep clear of, so some propositions may be offered at a time, others each step: what to take, and what to leave.
"""

import dataclasses

import jax
import jax.numpy as jnp
from flax import struct

from t2tl_jax.env import Alphabet, EnvConfig, EnvParams, LabelledEnv, State
from t2tl_jax.registry import register_env

EPISODE_LENGTH = 75
"""Most steps of an episode here: 75. Applied outside: the environment itself never ends.

In the original world (LTL2Action's, also in T2TL's history) 76: it ends an episode when *more* than 75 steps were
taken, which is at the 76th. Episodes here are cut at the 75th, one step earlier.
"""

ZONE_COLOURS = ("Black", "White", "Red", "Yellow")


@dataclasses.dataclass(frozen=True)
class SingleStateConfig(EnvConfig):
    """What distinguishes one single-state world from another."""

    propositions: tuple[str, ...] = ZONE_COLOURS
    """Names of the propositions, which are also the actions; those of the environment that is trained in later."""
    offered: int = 0
    """How many of them can be chosen at a step, each set of so many as likely as any; one more action chooses none. 0
    as published: all of them at every step, and one has to be chosen."""

    def __post_init__(self) -> None:
        if not self.propositions or len(set(self.propositions)) < len(self.propositions):
            raise ValueError(
                f"propositions are one or more different names, got {', '.join(self.propositions) or 'none'}"
            )
        if not 0 <= self.offered <= len(self.propositions):
            raise ValueError(
                f"of {len(self.propositions)} propositions 0 to {len(self.propositions)} can be offered, got "
                f"offered={self.offered}"
            )


@struct.dataclass
class Choice:
    """Pipeline state of a `SingleState` world."""

    chosen: jax.Array
    """``int32[]``: the proposition that holds, -1 for none."""
    offered: jax.Array
    """``bool[P]``: which of them the next action can choose."""
    random: jax.Array
    """``uint32[2]``: what later offers are drawn from."""


class SingleState(LabelledEnv):
    """Action k makes the k-th proposition true for one step, if it is offered. No base reward is paid.

    What is offered is observed, as 0 and 1 for each proposition; where everything is, nothing is observed.
    """

    alphabet: Alphabet = "at_most_one"

    def __init__(self, config: SingleStateConfig = SingleStateConfig()) -> None:
        self.config = config

    @property
    def fixed_start(self) -> bool:
        """Whether there is nothing to draw."""
        return not self.config.offered

    def reset(self, rng: jax.Array, params: EnvParams | None = None) -> State:
        """No proposition is true before the first action."""
        del params
        random = jax.random.bits(rng, (2,), jnp.uint32) if self.config.offered else jnp.zeros(2, jnp.uint32)
        first = Choice(jnp.int32(-1), jnp.ones(len(self.propositions), bool), random)
        return self._offer(State(first, jnp.zeros(0, jnp.float32), jnp.float32(0), jnp.float32(0)))

    def step(self, state: State, action: jax.Array, params: EnvParams | None = None) -> State:
        """Make proposition `action` (an ``int32`` scalar, or that with the shape ``[1]``) true; none if it is not
        offered."""
        del params
        before: Choice = state.pipeline_state
        action = jnp.asarray(action).reshape(()).astype(jnp.int32)
        taken = (before.offered & (jnp.arange(len(self.propositions)) == action)).any()
        after = dataclasses.replace(before, chosen=jnp.where(taken, action, -1))
        return self._offer(state.replace(pipeline_state=after, reward=jnp.float32(0), done=jnp.float32(0)))

    def _offer(self, state: State) -> State:
        """The state with what the next action can choose; as it is where that is everything."""
        if not self.config.offered:
            return state
        now, later = jax.random.split(jax.random.wrap_key_data(state.pipeline_state.random))
        offered = jax.random.permutation(now, jnp.arange(len(self.propositions)) < self.config.offered)
        choice: Choice = state.pipeline_state
        choice = dataclasses.replace(choice, offered=offered, random=jax.random.key_data(later))
        return state.replace(pipeline_state=choice, obs=offered.astype(jnp.float32))

    def labels(self, state: State) -> jax.Array:
        """Which propositions hold: ``bool[P]``, the chosen one."""
        return jnp.arange(len(self.propositions)) == state.pipeline_state.chosen

    @property
    def propositions(self) -> tuple[str, ...]:
        """Names of the propositions, in the order of the actions."""
        return self.config.propositions

    @property
    def num_actions(self) -> int:
        """As many as there are propositions, and one more where not all are offered, which chooses none."""
        return len(self.config.propositions) + (self.config.offered > 0)

    @property
    def action_size(self) -> int:
        """One: the number of the action."""
        return 1

    @property
    def observation_size(self) -> int:
        """One number for each proposition, or none where all are offered."""
        return len(self.config.propositions) if self.config.offered else 0

    @property
    def backend(self) -> str:
        """There is no physics."""
        return "none"


register_env("single_state", SingleStateConfig, SingleState, {"SingleState": SingleStateConfig()})
