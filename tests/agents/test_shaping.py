"""Potential-based shaping: the published numbers, what stays the same, and where it enters."""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import experiments.configs  # noqa: F401, registers the configurations
from t2tl_jax.agents.dqn_config import DQNConfig
from t2tl_jax.agents.shaping import potential
from t2tl_jax.agents.td_learning import Transition, dqn_loss, td_targets
from t2tl_jax.ltl import compile_reward_machines, compile_tasks, named_machines
from t2tl_jax.networks.q_network import QNetwork, QNetworkConfig
from t2tl_jax.networks.task_encoders import OneHotConfig
from t2tl_jax.registry import named_config
from t2tl_jax.task_env import Shared

DISCOUNT = 0.9
SHAPED = DQNConfig(discount=DISCOUNT, shaping=True)
LETTERS = tuple("abcdef")


@pytest.fixture(scope="module")
def machine():
    return compile_reward_machines(named_machines("rm_t10_published"), LETTERS)


def letters(table, *labels):
    return np.array([int(table.letter(np.array([name in label for name in table.propositions]))) for label in labels])


def shared(letter, ended=False):
    size = len(letter)
    return Shared(jnp.asarray(letter), jnp.zeros(size), jnp.full(size, ended))


@pytest.mark.slow
def test_potential_and_shaped_rewards_are_the_published_ones(machine):
    """Of t10: V = 0.81, 0.9, 1; to stay pays 0.081, 0.09, 0.1, and any touch in the last state 2."""
    phi = np.asarray(jax.jit(potential, static_argnums=1)(machine, DISCOUNT))
    np.testing.assert_allclose(phi, [0, 0, -0.81, -0.9, -1.0], atol=1e-6)
    nothing = jnp.zeros((1, machine.num_rows, 5))
    stay = td_targets(SHAPED, machine, nothing, nothing, shared(letters(machine, "")), jnp.zeros(1, bool), phi)
    np.testing.assert_allclose(stay[0, 2:], [0.081, 0.09, 0.1], atol=1e-6)
    wrong = td_targets(SHAPED, machine, nothing, nothing, shared(letters(machine, "a")), jnp.zeros(1, bool), phi)
    np.testing.assert_allclose(wrong[0, 4], 2.0, atol=1e-6)


@pytest.mark.parametrize("discount", [0.0, 0.5, 0.98])
def test_potential_of_formulas_is_the_discounted_distance_to_acceptance(discount):
    table = compile_tasks("!c U (a & (!c U (b & F d)))", tuple("abcd"), "at_most_one")
    phi = potential(table, discount)
    assert phi[0] == phi[1] == 0.0
    np.testing.assert_allclose(phi[2:], [-(discount**2), -discount, -1.0], rtol=1e-5)


@pytest.mark.parametrize(
    ("over", "cut", "timeout_is_terminal"), [(True, False, False), (False, True, True), (False, True, False)]
)
def test_what_ends_has_the_potential_0(machine, over, cut, timeout_is_terminal):
    """By a verdict, by the environment, or by a time limit that counts as an end; one that does not changes nothing."""
    config = dataclasses.replace(SHAPED, timeout_is_terminal=timeout_is_terminal)
    phi = potential(machine, DISCOUNT)
    target = jnp.ones((1, machine.num_rows, 5))
    goal = td_targets(config, machine, target, target, shared(letters(machine, ""), over), jnp.array([cut]), phi)[0]
    ends = over or timeout_is_terminal
    np.testing.assert_allclose(goal[2:], -phi[2:] + (0.0 if ends else DISCOUNT * (1.0 + phi[2:])), atol=1e-6)


@pytest.mark.parametrize("task", ["formula", "machine"])
def test_best_actions_of_a_small_mdp_stay_the_best(task, machine):
    """Value iteration with the learner's own targets on a ring of cells: Q moves by -Phi(u), whatever the action."""
    table = compile_tasks("!c U (a & (!c U b))", LETTERS) if task == "formula" else machine
    labels = ["", "d", "", "b", "e", "a", "", "f", "c"]
    cells, actions = len(labels), 3
    after = (np.arange(cells)[:, None] + np.array([-1, 0, 1])) % cells
    letter = letters(table, *labels)[after].reshape(-1)  # of every transition, cell by cell

    def solve(phi):
        def improve(_, q):
            at_next = jnp.moveaxis(q[after.reshape(-1)], 1, 2)  # [cells x actions, rows, actions]
            goal = td_targets(SHAPED, table, at_next, at_next, shared(letter), jnp.zeros(len(letter), bool), phi)
            return goal.reshape(cells, actions, table.num_rows)

        return np.asarray(jax.lax.fori_loop(0, 200, improve, jnp.zeros((cells, actions, table.num_rows))))

    phi = potential(table, DISCOUNT)
    plain, shaped = (solve(given)[:, :, 2:] for given in (None, phi))
    np.testing.assert_allclose(shaped, plain - np.asarray(phi)[2:], atol=1e-5)
    best = plain > plain.max(axis=1, keepdims=True) - 1e-6
    np.testing.assert_array_equal(shaped > shaped.max(axis=1, keepdims=True) - 1e-6, best)
    assert np.ptp(plain, axis=1).max() > 0.1


@pytest.mark.slow
@pytest.mark.parametrize("counterfactual", [True, False])
def test_both_learners_shape_what_they_learn_from(counterfactual, machine):
    """With values of zero at s' and gamma Phi(u') - Phi(u) as the only reward, the error is that."""
    network = QNetwork(QNetworkConfig(task_encoder=OneHotConfig(size=8), state_layers=(4,), task_layer=4), 5)
    obs = jnp.ones((1, 2))
    init = partial(network.init, method="initialise")
    params = jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), jax.eval_shape(init, jax.random.key(0), machine, obs))
    embedding = jax.jit(partial(network.apply, method="embed"))(params, machine)
    no = jnp.zeros(1, bool)
    batch = Transition(obs, jnp.zeros(1, jnp.int32), obs, jnp.array([3]), shared(letters(machine, "")), no)
    config = dataclasses.replace(SHAPED, counterfactual=counterfactual)
    phi = potential(machine, DISCOUNT)
    loss = jax.jit(partial(dqn_loss, config, network, machine))
    _, scalars = loss(params, embedding, params, embedding, batch, phi)
    expected = np.mean([0.081, 0.09, 0.1]) if counterfactual else 0.09
    assert scalars["td_error"] == pytest.approx(expected, abs=1e-6)


def test_named_configurations_differ_in_the_switch_only():
    for name in ("rm_water_crm", "rm_water_ql"):
        plain, shaped = named_config(name), named_config(f"{name}_shaped")
        assert shaped == dataclasses.replace(plain, learner=dataclasses.replace(plain.learner, shaping=True))
    with pytest.raises(ValueError, match="shaping needs discount below 1"):
        DQNConfig(discount=1.0, shaping=True)
