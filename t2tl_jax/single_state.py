"""A world with one state, in which the action says which proposition is true: what a task asks for, and nothing else.

Task encoders are pre-trained here, since everything that can be learned is the meaning of the formulas.
"""

import dataclasses

import jax
import jax.numpy as jnp

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

    def __post_init__(self) -> None:
        if not self.propositions or len(set(self.propositions)) < len(self.propositions):
            raise ValueError(
                f"propositions are one or more different names, got {', '.join(self.propositions) or 'none'}"
            )


class SingleState(LabelledEnv):
    """Action k makes the k-th proposition true for one step. Nothing is observed, and no base reward is paid."""

    alphabet: Alphabet = "at_most_one"
    fixed_start = True

    def __init__(self, config: SingleStateConfig = SingleStateConfig()) -> None:
        self.config = config

    def reset(self, rng: jax.Array, params: EnvParams | None = None) -> State:
        """The one state; no proposition is true before the first action."""
        del rng, params
        return State(jnp.int32(-1), jnp.zeros(0, jnp.float32), jnp.float32(0), jnp.float32(0))

    def step(self, state: State, action: jax.Array, params: EnvParams | None = None) -> State:
        """Make proposition `action` (an ``int32`` scalar, or that with the shape ``[1]``) true."""
        del params
        return state.replace(
            pipeline_state=jnp.asarray(action).reshape(()).astype(jnp.int32),
            reward=jnp.float32(0),
            done=jnp.float32(0),
        )

    def labels(self, state: State) -> jax.Array:
        """Which propositions hold: ``bool[P]``, the chosen one."""
        return jnp.arange(self.num_actions) == state.pipeline_state

    @property
    def propositions(self) -> tuple[str, ...]:
        """Names of the propositions, in the order of the actions."""
        return self.config.propositions

    @property
    def num_actions(self) -> int:
        """As many as there are propositions."""
        return len(self.config.propositions)

    @property
    def action_size(self) -> int:
        """One: the number of the action."""
        return 1

    @property
    def observation_size(self) -> int:
        """Nothing is observed."""
        return 0

    @property
    def backend(self) -> str:
        """There is no physics."""
        return "none"


register_env("single_state", SingleStateConfig, SingleState, {"SingleState": SingleStateConfig()})
