"""What a network over objects learns: to reach what the task names, wherever it is and whatever it is called."""

import dataclasses
from collections.abc import Callable
from functools import partial
from typing import Any

import chex
import jax
import jax.numpy as jnp
import pytest
from brax.envs.base import State

from t2tl_jax.agents.dqn import make_dqn
from t2tl_jax.agents.dqn_config import DQNConfig
from t2tl_jax.agents.ppo import make_ppo
from t2tl_jax.env import LabelledEnv
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.networks.actor_critic import NetworkConfig
from t2tl_jax.networks.lookahead import LookaheadConfig
from t2tl_jax.networks.objects import ObjectsConfig
from t2tl_jax.networks.q_network import QNetworkConfig
from t2tl_jax.objects import Objects
from t2tl_jax.task_env import TaskEnv
from tests.agents import sizes

LOOK = LookaheadConfig(propositions=4, steps=1)
BALLS = ObjectsConfig(layers=(16,), identity="role", place_scale=1.0)
PPO = dataclasses.replace(
    sizes.PPO, network=NetworkConfig(task_encoder=LOOK, state=BALLS, env_layers=(), actor_layers=(), critic_layers=())
)


class Sides(LabelledEnv):
    """The last two propositions lie to the left and to the right, which is drawn; others are out of reach.

    Actions 0 and 1 touch what lies to the left and to the right. Observed is where each proposition is.
    """

    alphabet = "at_most_one"
    num_actions = 2
    action_size = 1
    backend = "none"
    propositions, observation_size, objects = (), 0, None  # of an instance

    def __init__(self, *propositions: str) -> None:
        self.propositions = propositions
        self.observation_size = len(propositions)
        each = range(len(propositions))
        self.objects = Objects.blocks(each, 1, each, place=1)

    def reset(self, rng: jax.Array, params=None) -> State:
        side = jnp.where(jax.random.bernoulli(rng), 1.0, -1.0)
        places = jnp.full(self.observation_size, 3.0).at[-2:].set(jnp.stack([side, -side]))
        touched = jnp.zeros(self.observation_size, bool)
        return State((places, touched), places, jnp.float32(0), jnp.float32(0))

    def step(self, state: State, action: jax.Array, params=None) -> State:
        places = state.pipeline_state[0]
        touched = places == 2.0 * action - 1.0
        return state.replace(pipeline_state=(places, touched), reward=jnp.float32(0), done=jnp.float32(0))

    def labels(self, state: State) -> jax.Array:
        return state.pipeline_state[1]


def world(task: str, *propositions: str) -> TaskEnv:
    env = Sides(*propositions)
    return TaskEnv(env, compile_tasks([task], env.propositions, env.alphabet))


def successes_of(env: TaskEnv, agent) -> Callable[[Any], jax.Array]:
    """The share of episodes in which the deterministic policy carries out the task in three steps, by parameters."""

    def play(params: Any, key: jax.Array) -> jax.Array:
        codes = agent.embed(params, env.table)

        def step(_: Any, state: State) -> State:
            action = agent.act(params, codes, (), state.obs, env.row(state), key, True)
            after = env.step(state, action)
            return jax.tree.map(partial(jnp.where, state.done > 0), state, after)

        return env.verdict(jax.lax.fori_loop(0, 3, step, env.reset(key))) > 0

    keys = jax.random.split(jax.random.key(7), 32)
    return jax.jit(lambda params: jax.vmap(partial(play, params))(keys).mean())


@pytest.mark.slow
def test_ppo_learns_by_roles_and_then_knows_other_propositions():
    env = world("!Down U (Up & F Down)", "Up", "Down")
    agent = make_ppo(env, PPO, episode_length=8, iterations=30)
    given = env.make_params(0)
    state, iterate = jax.jit(agent.init)(jax.random.key(0), given), jax.jit(agent.iterate)
    successes = successes_of(env, agent)
    before = successes(state.params)
    for _ in range(30):
        state, _ = iterate(state, given)
    assert before < 0.9 and successes(state.params) == 1.0
    more = world("!Left U (Right & F Left)", "Far", "Away", "Left", "Right")
    assert successes_of(more, make_ppo(more, PPO, 8, 1))(state.params) == 1.0


@pytest.mark.slow
@pytest.mark.parametrize("pooling", ["maximum_mean", "attention"])
def test_double_dqn_reads_objects_for_every_row(pooling):
    """Traced: shapes and dtypes fit, and an iteration keeps the state's."""
    env = world("!Down U (Up & F Down)", "Up", "Down")
    balls = dataclasses.replace(BALLS, pooling=pooling)
    network = QNetworkConfig(task_encoder=LOOK, state=balls, state_layers=(), task_layer=16)
    config = DQNConfig(network=network, num_envs=4, unroll_length=4, batch_size=8, buffer_size=64, learning_starts=4)
    agent, given = make_dqn(env, config, episode_length=8, iterations=1), env.make_params(0)
    state = jax.eval_shape(agent.init, jax.random.key(0), given)
    chex.assert_trees_all_equal_shapes_and_dtypes(state, jax.eval_shape(agent.iterate, state, given)[0])
    assert "state" in state.params["params"]
