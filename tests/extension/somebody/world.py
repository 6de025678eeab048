"""An environment in which several propositions hold at once, with metrics of its own and a start that seeds vary."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from brax.envs.base import State

from t2tl_jax import EnvConfig, LabelledEnv, register_env
from t2tl_jax.env import Purpose


@dataclass(frozen=True)
class LampsConfig(EnvConfig):
    """A row of lamps."""

    count: int = 2
    """Lamps, called lamp1, lamp2, ..."""

    def __post_init__(self) -> None:
        if self.count < 1:
            raise ValueError(f"count must be at least 1, got {self.count}")


class Lamps(LabelledEnv):
    """Action k switches lamp k, and the last action none. Some lamps of the first seeds burn at the start."""

    alphabet = "every_subset"
    action_size = 1
    backend = "lamps"
    built = 0

    def __init__(self, config: LampsConfig = LampsConfig()) -> None:
        type(self).built += 1
        self.config = config

    def make_params(self, seed: int, purpose: Purpose = "training") -> np.ndarray:
        return np.arange(self.config.count) == seed

    def reset(self, rng: jax.Array, params=None) -> State:
        burning = jnp.asarray(self.make_params(0) if params is None else params)
        return self._shown(burning)

    def step(self, state: State, action: jax.Array, params=None) -> State:
        chosen = jnp.arange(self.config.count) == jnp.asarray(action).reshape(())
        return self._shown(state.pipeline_state ^ chosen)

    def labels(self, state: State) -> jax.Array:
        return state.pipeline_state

    def _shown(self, burning: jax.Array) -> State:
        zero = jnp.float32(0)
        metrics = {"burning": burning.sum().astype(jnp.float32)}
        return State(burning, burning.astype(jnp.float32), zero, zero, metrics)

    @property
    def propositions(self) -> tuple[str, ...]:
        return tuple(f"lamp{k + 1}" for k in range(self.config.count))

    @property
    def num_actions(self) -> int:
        return self.config.count + 1

    @property
    def observation_size(self) -> int:
        return self.config.count


register_env("lamps", LampsConfig, Lamps, {"Lamps-3": LampsConfig(3)})
