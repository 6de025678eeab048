"""DQN with context: replay keeps the window that acted, targets use the one after the step, memory is learnt."""

import dataclasses
from functools import partial
from unittest.mock import Mock

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.agents import td_learning
from t2tl_jax.agents.dqn import make_dqn
from t2tl_jax.agents.dqn_config import DQNConfig
from t2tl_jax.agents.replay import make_replay
from t2tl_jax.agents.td_learning import Transition, dqn_loss, td_targets
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.networks.context_config import ContextConfig
from t2tl_jax.networks.q_network import QNetwork, QNetworkConfig
from t2tl_jax.networks.task_encoders import OneHotConfig
from t2tl_jax.networks.windows import Window, without_newest, without_oldest
from t2tl_jax.task_env import Shared, TaskEnv
from tests.agents.sizes import GRU, TRANSFORMER
from tests.parameters import begun_quickly
from tests.probe import DiscreteCueEnv, success_by_memory

pytestmark = pytest.mark.slow  # every test waits for the compilation of a learner

CONTEXT = ContextConfig(length=2, reader=TRANSFORMER)
NETWORK = QNetworkConfig(task_encoder=OneHotConfig(), state_layers=(16,), task_layer=16, dueling=False, context=CONTEXT)
DQN = DQNConfig(
    network=NETWORK,
    num_envs=8,
    unroll_length=25,
    batch_size=64,
    buffer_size=400,
    learning_starts=200,
    target_period=20,
    discount=0.9,
    learning_rate=3e-3,
    epsilon_fraction=0.5,
)
EPISODE_LENGTH = 5
PROBE = DiscreteCueEnv()
TASKS = compile_tasks(["!Down U Up"], PROBE.propositions, PROBE.alphabet)


def make(network):
    """Environment, agent, its first state, and one iteration compiled."""
    env = TaskEnv(PROBE, TASKS)
    agent = begun_quickly(make_dqn(env, dataclasses.replace(DQN, network=network), EPISODE_LENGTH, iterations=30))
    given, iterate = env.make_params(0), jax.jit(agent.iterate)
    state = jax.jit(agent.init)(jax.random.key(0), given)
    return env, agent, state, lambda state: iterate(state, given)


@pytest.fixture(scope="module")
def learner():
    """That of the Transformer, compiled once for all tests."""
    return make(NETWORK)


def test_replay_keeps_the_window_that_acted(learner):
    """Two iterations fill the buffer: 50 steps of 8 environments, followed here episode by episode."""
    _, _, state, iterate = learner
    for _ in range(2):
        state, _ = iterate(state)
    stored = jax.tree.map(lambda x: np.asarray(x)[0, :400].reshape(50, 8, *x.shape[2:]), state.buffer.experience)
    assert stored.steps.seen == () and state.buffer.experience.obs.shape == (1, 400 + 2 * 8, 3)  # each step once
    ages = np.zeros((51, 8), int)
    for i in range(8):
        episode = []
        for t in range(50):
            ages[t, i] = len(episode)
            episode.append(t)
            assert stored.steps.filled[t, i] == len(episode[-3:])  # the window and the step itself
            if stored.steps.reward[t, i] != 0 or stored.cut[t, i]:  # rewards come with the end
                episode = []
        ages[50, i] = len(episode)
    assert (stored.steps.reward != 0).any() and stored.cut.any()
    np.testing.assert_array_equal(state.episodes.elapsed, ages[50])
    np.testing.assert_array_equal(state.carry.valid.sum(axis=1), np.minimum(ages[50], 2))


def test_targets_use_the_window_after_the_step_and_all_rows_the_same_one(learner):
    """The loss of both ways to learn against one that takes the windows apart by hand and values one row at a time."""
    env, _, state, iterate = learner
    state, _ = iterate(state)
    table, network = env.table, QNetwork(NETWORK, 3)
    sample = jax.jit(make_replay(DQN.buffer_size, 100, DQN.num_envs, CONTEXT).sample)
    stored = sample(state.buffer, jax.random.key(1))
    before, after = (jax.tree.map(lambda x, chosen=chosen: x[:, chosen], stored.steps) for chosen in ([0, 1], [1, 2]))
    params, target_params = state.params, jax.tree.map(lambda x: 0.9 * x, state.params)
    embedding = jax.jit(partial(network.apply, method="embed"))(params, table)

    @jax.jit
    def values(params, obs, window):
        of_row = jax.vmap(lambda row: network.apply(params, obs, embedding, row, window), out_axes=1)
        return of_row(jnp.repeat(jnp.arange(table.num_rows)[:, None], len(obs), axis=1))

    q = values(params, stored.obs, before)
    online, target = values(params, stored.next_obs, after), values(target_params, stored.next_obs, after)
    goal = jax.jit(partial(td_targets, DQN, table))(online, target, stored.shared, stored.cut)
    error = np.abs(np.asarray(q[np.arange(100), :, stored.action] - goal))
    huber = np.where(error < 1, 0.5 * error**2, error - 0.5)
    assert np.abs(values(params, stored.obs, after) - q).max() > 1e-2  # another window is another value
    configs = [dataclasses.replace(DQN, counterfactual=counterfactual) for counterfactual in (True, False)]
    losses = jax.jit(lambda *given: [dqn_loss(config, network, table, *given)[0] for config in configs])
    every_row, own = losses(params, embedding, target_params, embedding, stored)
    assert every_row == pytest.approx(huber[:, np.asarray(table.is_open)].mean(), rel=1e-4)
    assert own == pytest.approx(huber[np.arange(100), stored.row].mean(), rel=1e-4)


UNMASKED = dataclasses.replace(TRANSFORMER, masked=False, norm="post")


@pytest.mark.parametrize(
    ("context", "network", "config"),
    [
        ({}, {}, {}),
        ({"recompute": False}, {"head": "concat"}, {"counterfactual": False}),
        ({"reader": GRU}, {"head": "bilinear"}, {"printed_argmax": True}),
        ({"reader": UNMASKED, "reset": False}, {}, {"counterfactual": False, "printed_argmax": True, "double": False}),
    ],
)
def test_tokens_that_are_made_once_give_the_same_loss_and_gradient(monkeypatch, context, network, config):
    """Of made-up steps, some slots of which are empty."""
    context = dataclasses.replace(CONTEXT, **context)
    network = dataclasses.replace(NETWORK, context=context, **network)
    config = dataclasses.replace(DQN, network=network, **config)
    env, count, length = TaskEnv(PROBE, TASKS), 16, context.length + 1
    rng, table, network = np.random.default_rng(0), env.table, QNetwork(network, 3)
    seen = 3 if context.recompute else NETWORK.state_layers[0]
    obs, next_obs = rng.normal(size=(2, count, 3)).astype(np.float32)
    filled = np.arange(length) >= rng.integers(0, length, (count, 1))
    action, row, letter = (rng.integers(0, most, count) for most in (3, table.num_rows, 4))
    steps = Window(
        rng.integers(0, 3, (count, length)),
        rng.normal(size=(count, length)).astype(np.float32),
        rng.normal(size=(count, length, seen)).astype(np.float32),
        filled,
    )
    never = np.zeros(count, bool)
    batch = Transition(obs, action, next_obs, row, Shared(letter, obs[:, 0], never), never, steps)
    make = partial(network.init, jax.random.key(0), method="initialise")
    params = jax.jit(make)(table, obs, without_oldest(steps))
    target_params = jax.tree.map(lambda x: 0.9 * x, params)
    embedding = network.apply(params, table, method="embed")

    def both():
        def loss(params):
            return dqn_loss(config, network, table, params, embedding, target_params, embedding, batch)[0]

        return jax.jit(jax.value_and_grad(loss))(params)

    once = both()
    anew = Mock(side_effect=lambda *given: (without_newest(given[-1]), without_oldest(given[-1])))
    monkeypatch.setattr(td_learning, "read_once", anew)
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-4, atol=1e-7), once, both())
    assert anew.called and once[0] > 0


@pytest.mark.parametrize("other", [{}, {"context": dataclasses.replace(CONTEXT, reader=GRU), "head": "concat"}])
def test_a_task_that_needs_memory_is_learnt_and_evaluation_remembers_too(learner, other):
    env, agent, state, iterate = make(dataclasses.replace(NETWORK, **other)) if other else learner
    for _ in range(30):
        state, _ = iterate(state)

    success = success_by_memory(env, agent, EPISODE_LENGTH)
    assert success(state.params, True) >= 0.98
    assert success(state.params, False) < 0.7


def test_impossible_settings_are_refused():
    with pytest.raises(ValueError, match="aligned=False"):
        dataclasses.replace(NETWORK, context=dataclasses.replace(CONTEXT, aligned=False))
    with pytest.raises(ValueError, match="got state_layers"):
        dataclasses.replace(NETWORK, state_layers=())
