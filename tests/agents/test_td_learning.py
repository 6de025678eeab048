"""What double DQN learns from transitions: counterfactual targets against a slow loop, the loss, movement of codes."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.agents.dqn_config import DQNConfig
from t2tl_jax.agents.td_learning import Transition, code_change, dqn_loss, td_targets
from t2tl_jax.ltl import compile_reward_machines, compile_tasks, named_machines, progress
from t2tl_jax.networks.q_network import QNetwork, QNetworkConfig
from t2tl_jax.networks.task_encoders import OneHotConfig
from t2tl_jax.task_env import Shared
from tests.parameters import parameters
from tests.probe import DiscreteProbeEnv

NETWORK = QNetworkConfig(task_encoder=OneHotConfig(), state_layers=(), task_layer=32, head="bilinear", dueling=False)
DQN = DQNConfig(discount=0.9)


@pytest.fixture(scope="module")
def table():
    probe = DiscreteProbeEnv()
    return compile_tasks(["!Down U (Up & F(Down & F Up))"], probe.propositions, probe.alphabet)


@pytest.mark.slow
@pytest.mark.parametrize("double", [True, False])
@pytest.mark.parametrize("printed_argmax", [True, False])
@pytest.mark.parametrize("timeout_is_terminal", [True, False])
def test_counterfactual_targets_equal_a_slow_loop_over_formulas(table, double, printed_argmax, timeout_is_terminal):
    """Each row's formula is progressed symbolically by each transition's labels, and looked up among the rows.

    What the environment itself pays is paid to all of them, and where it ends the episode nothing follows.
    """
    config = dataclasses.replace(
        DQN, double=double, printed_argmax=printed_argmax, timeout_is_terminal=timeout_is_terminal
    )
    rng = np.random.default_rng(0)
    size, rows, actions = 12, table.num_rows, 3
    online, target = rng.normal(size=(2, size, rows, actions)).astype(np.float32)
    labels = [(), ("Up",), ("Down",)]
    drawn = rng.integers(0, 3, size)
    letter = np.array([int(table.letter(jnp.array([p in labels[k] for p in table.propositions]))) for k in drawn])
    cut, over = rng.random(size) < 0.3, rng.random(size) < 0.3
    paid = rng.normal(size=size).astype(np.float32)
    fast = td_targets(config, table, online, target, Shared(letter, paid, over), cut)

    row_of = {table.formula(row): row for row in range(rows)}
    for b in range(size):
        for row in range(rows):
            after = row_of[progress(table.formula(row), set(labels[drawn[b]]))]
            verdict = int(table.verdict[after])
            chooser = online if double else target
            action = chooser[b, row if printed_argmax else after].argmax()
            ended = verdict != 0 or over[b] or (timeout_is_terminal and cut[b])
            expected = paid[b] + verdict + (0.0 if ended else DQN.discount * target[b, after, action])
            assert fast[b, row] == pytest.approx(expected, abs=1e-5), (b, row)


@pytest.mark.slow
def test_loss_counts_open_rows_only_and_plain_dqn_only_the_own_row(table):
    network = QNetwork(NETWORK, 3)
    keys = jax.random.split(jax.random.key(0), 4)
    size = 16
    batch = Transition(
        obs=jax.random.normal(keys[0], (size, 3)),
        action=jax.random.randint(keys[1], (size,), 0, 3),
        next_obs=jax.random.normal(keys[2], (size, 3)),
        row=jnp.full(size, 3),
        shared=Shared(
            letter=jax.random.randint(keys[3], (size,), 0, table.next_row.shape[1]),
            reward=jnp.linspace(-0.1, 0.1, size),
            ended=jnp.arange(size) % 5 == 0,
        ),
        cut=jnp.arange(size) % 3 == 0,
    )
    switches = ({}, {"printed_argmax": True}, {"double": False}, {"timeout_is_terminal": True})

    @jax.jit  # one program of all that is compared
    def compute(params):
        embedding = network.apply(params, table, method="embed")
        q = network.apply(params, batch.obs, embedding, method="every_row")
        after = network.apply(params, batch.next_obs, embedding, method="every_row")

        def both(**changes):
            config = dataclasses.replace(DQN, **changes)
            loss, _ = dqn_loss(config, network, table, params, embedding, params, embedding, batch)
            return loss, td_targets(config, table, after, after, batch.shared, batch.cut)

        return q, both(counterfactual=True), [both(counterfactual=False, **switch) for switch in switches]

    params = parameters(network, table, batch.obs, method="initialise")
    q, counterfactual, plain = jax.tree.map(np.asarray, compute(params))

    def huber(goal):
        error = np.abs(q[np.arange(size), :, batch.action] - goal)
        return np.where(error < 1, 0.5 * error**2, error - 0.5)

    loss, goal = counterfactual
    assert loss == pytest.approx(huber(goal)[:, np.asarray(table.verdict) == 0].mean(), rel=1e-4)
    for switch, (loss, goal) in zip(switches, plain, strict=True):
        assert loss == pytest.approx(huber(goal)[:, 3].mean(), rel=1e-4), switch


def test_code_change_is_that_of_the_open_rows(table):
    codes = np.ones((table.num_rows, 4), np.float32) * 2
    moved = codes + np.where(np.asarray(table.is_open), 0.5, 100.0)[:, None]
    change = code_change(table, moved, codes)
    assert change["code_change"] == pytest.approx(0.5) and change["code_change_relative"] == pytest.approx(0.25)


@pytest.mark.slow
def test_reward_machine_targets_pay_by_transition():
    """The published t10 pays 1 for any touch in its last state, which ends it: success or not."""
    machines = named_machines("rm_t10_published")
    propositions = tuple("abcdef")
    table = compile_reward_machines(machines, propositions, "every_subset")
    rng = np.random.default_rng(1)
    labels = [set(), {"d"}, {"e"}, {"f"}, {"a"}, {"d", "e"}]
    letter = np.array([int(table.letter(jnp.array([p in label for p in propositions]))) for label in labels])
    online, target = rng.normal(size=(2, len(labels), table.num_rows, 5)).astype(np.float32)
    nothing = np.zeros(len(labels), np.float32)
    fast = td_targets(DQN, table, online, target, Shared(letter, nothing, nothing > 0), nothing > 0)
    machine = machines[0]
    row_of = {state: 2 + k for k, state in enumerate(machine.states)}
    for b, label in enumerate(labels):
        for state, row in row_of.items():
            after, reward = machine.step(state, label)
            value = 0.0 if after not in row_of else target[b, row_of[after], online[b, row_of[after]].argmax()]
            assert fast[b, row] == pytest.approx(reward + DQN.discount * value, abs=1e-5), (label, state)
    last = row_of[machine.states[-1]]
    assert fast[3, last] == fast[4, last] == 1.0
