"""A labelled environment that a correct learner solves in seconds: the label is the sign of the action."""

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from brax.envs.base import State

from t2tl_jax.env import LabelledEnv
from t2tl_jax.evaluation.episodes import play


class ProbeEnv(LabelledEnv):
    """Propositions Up and Down hold after an action above 0.5 and below -0.5; the observation is a constant.

    Only the formula's row tells which one is wanted, so a policy that ignores its task encoder cannot do well.
    """

    propositions = ("Up", "Down")
    alphabet = "at_most_one"
    num_actions = None
    action_size = 1
    observation_size = 3
    backend = "none"

    def reset(self, rng: jax.Array, params=None) -> State:
        return State(jnp.float32(0), jnp.ones(3), jnp.float32(0), jnp.float32(0))

    def step(self, state: State, action: jax.Array, params=None) -> State:
        return state.replace(pipeline_state=action[0].astype(jnp.float32), reward=jnp.float32(0), done=jnp.float32(0))

    def labels(self, state: State) -> jax.Array:
        return jnp.stack([state.pipeline_state > 0.5, state.pipeline_state < -0.5])


class CueEnv(ProbeEnv):
    """A cue is shown at the start and decides two steps later which sign of the action makes Up, and which Down.

    Without memory half of the episodes go wrong. An action between -0.5 and 0.5 decides nothing, and there is no second
    chance.
    """

    delay = 2

    def reset(self, rng: jax.Array, params=None) -> State:
        cue = jnp.where(jax.random.bernoulli(rng), 1.0, -1.0)
        return self._cued(cue, jnp.float32(0), jnp.float32(0))

    def step(self, state: State, action: jax.Array, params=None) -> State:
        cue, age, _ = state.pipeline_state
        return self._cued(cue, age + 1, jnp.where(age == self.delay, cue * action[0], 0.0))

    def labels(self, state: State) -> jax.Array:
        return jnp.stack([state.pipeline_state[2] > 0.5, state.pipeline_state[2] < -0.5])

    def _cued(self, cue: jax.Array, age: jax.Array, outcome: jax.Array) -> State:
        obs = jnp.stack([cue * (age == 0), age == self.delay, jnp.ones(())])
        return State(jnp.stack([cue, age, outcome]), obs, jnp.float32(0), jnp.float32(0))


class DiscreteProbeEnv(ProbeEnv):
    """`ProbeEnv` with three actions: nothing, Up, Down."""

    num_actions = 3

    def step(self, state: State, action: jax.Array, params=None) -> State:
        return super().step(state, jnp.array([[0.0], [1.0], [-1.0]])[action])


class DiscreteCueEnv(CueEnv):
    """`CueEnv` with the same three actions."""

    num_actions = 3

    def step(self, state: State, action: jax.Array, params=None) -> State:
        return super().step(state, jnp.array([[0.0], [1.0], [-1.0]])[action])


def success_by_memory(env: Any, agent: Any, episode_length: int) -> Callable[[Any, bool], jax.Array]:
    """(parameters, whether the policy remembers) -> its success in 200 episodes, by one program."""

    @jax.jit
    def success(params: Any, remembers: bool) -> jax.Array:
        def remember(params: Any, carry: Any, *step: jax.Array) -> Any:
            return jax.tree.map(partial(jnp.where, remembers), agent.remember(params, carry, *step), carry)

        given, player = env.make_params(0), agent._replace(remember=remember)
        return play(env, player, params, given, jax.random.key(1), 200, episode_length, 0.9, True).success.mean()

    return success
