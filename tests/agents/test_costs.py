"""What learning costs, counted in the traced programs: a change that makes it dearer has to say so here.

Arithmetic is that of the sizes the configurations have; operations are those of a whole iteration, a loop's body once.
"""

import dataclasses

import jax
import jax.numpy as jnp
import pytest

from experiments.benchmarks.arithmetic import gradient_of_ppo
from t2tl_jax.agents import td_learning
from t2tl_jax.agents.dqn import make_dqn
from t2tl_jax.agents.dqn_config import DQNConfig
from t2tl_jax.agents.ppo import make_ppo
from t2tl_jax.agents.td_learning import Transition, dqn_loss
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.networks.actor_critic import NetworkConfig
from t2tl_jax.networks.context_config import ContextConfig
from t2tl_jax.networks.q_network import QNetwork, QNetworkConfig
from t2tl_jax.networks.windows import Window, without_newest, without_oldest
from t2tl_jax.task_env import Shared, TaskEnv
from tests.agents import sizes
from tests.operations import in_loops, operations
from tests.probe import DiscreteProbeEnv, ProbeEnv

SAMPLES = 512
TABLE = compile_tasks(["F(a & F b)"], ("a", "b"), "at_most_one")


def flops(function, *given):
    """Of one call, by the compiler's account; nothing is compiled for it."""
    return jax.jit(function).lower(*given).cost_analysis()["flops"]


@pytest.mark.slow
def test_arithmetic_of_a_gradient_step_of_ppo():
    t1tl, t2tl = gradient_of_ppo(None), gradient_of_ppo(ContextConfig())
    assert 200_000 < t1tl < 235_000
    assert 900_000 < t2tl < 1_030_000
    # With no steps that need a window from outside of their segment, every observation would be embedded once.
    assert t2tl < 1.12 * gradient_of_ppo(ContextConfig(segment_length=64))


@pytest.mark.slow
def test_arithmetic_of_a_gradient_step_of_dqn():
    """Forward at s, at s' by both networks, and back through s alone, which is twice the arithmetic of forward."""
    network = QNetwork(QNetworkConfig(head="bilinear", task_layer=512), 4)
    obs, codes = jnp.zeros((SAMPLES, 52)), jnp.zeros((TABLE.num_rows, 32))
    params = jax.eval_shape(lambda: network.init(jax.random.key(0), TABLE, obs, method="initialise"))
    numbers, flags = jnp.zeros(SAMPLES, int), jnp.zeros(SAMPLES, bool)
    batch = Transition(obs, numbers, obs, numbers, Shared(numbers, obs[:, 0], flags), flags)

    def loss(params, codes, target_params, target_codes, batch):
        return dqn_loss(DQNConfig(), network, TABLE, params, codes, target_params, target_codes, batch)[0]

    def forward(params, codes, obs):
        return network.apply(params, obs, codes, method="every_row")

    step = flops(jax.grad(loss, argnums=(0, 1)), params, codes, params, codes, batch)
    assert step < 5.1 * flops(forward, params, codes, obs)


@pytest.mark.slow
def test_tokens_of_windows_that_share_steps_are_made_once(monkeypatch):
    """Those at s and at s' differ in one step of eight: of three times eight tokens forward, seven are spared."""
    network = QNetwork(QNetworkConfig(head="bilinear", task_layer=512, context=ContextConfig()), 4)
    obs, codes, length = jnp.zeros((SAMPLES, 52)), jnp.zeros((TABLE.num_rows, 32)), ContextConfig.length + 1
    numbers, flags = jnp.zeros(SAMPLES, int), jnp.zeros(SAMPLES, bool)
    steps = Window(
        *(jnp.zeros((SAMPLES, length, *size), of) for size, of in (((), int), ((), float), ((52,), float), ((), bool)))
    )
    batch = Transition(obs, numbers, obs, numbers, Shared(numbers, obs[:, 0], flags), flags, steps)
    params = jax.eval_shape(
        lambda: network.init(jax.random.key(0), TABLE, obs, without_oldest(steps), method="initialise")
    )

    def loss(params, codes, target_params, batch):
        return dqn_loss(DQNConfig(network=network.config), network, TABLE, params, codes, target_params, codes, batch)[
            0
        ]

    def tokens(params, window):
        return network.apply(params, window, method="tokens")

    once = flops(jax.grad(loss), params, codes, params, batch)
    monkeypatch.setattr(td_learning, "read_once", lambda *given: (without_newest(given[-1]), without_oldest(given[-1])))
    anew = flops(jax.grad(loss), params, codes, params, batch)
    assert anew - once == pytest.approx(7 / 8 * flops(tokens, params, without_oldest(steps)), rel=0.02)


class Marked:
    """Its step computes a tangent and its reset a hyperbolic sine, as nothing else does."""

    def reset(self, rng, params=None):
        state = super().reset(rng)
        return state.replace(obs=jnp.sinh(state.obs))

    def step(self, state, action, params=None):
        state = super().step(state, action)
        return state.replace(obs=jnp.tan(state.obs))


class MarkedProbe(Marked, ProbeEnv):
    pass


class MarkedDiscreteProbe(Marked, DiscreteProbeEnv):
    pass


def ppo(context):
    network = NetworkConfig(task_encoder=sizes.TRANSFORMER, context=context)
    return make_ppo, dataclasses.replace(sizes.PPO, network=network), MarkedProbe()


def dqn(context):
    network = QNetworkConfig(task_encoder=sizes.TRANSFORMER, context=context)
    return make_dqn, DQNConfig(network=network, num_envs=4, batch_size=16, buffer_size=64), MarkedDiscreteProbe()


TARGET = 7
"""Products of reading the tasks for the target network, once for its copy and not in every step."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("learner", "context", "most", "products"),
    [
        pytest.param(ppo, None, 3_300, 74, id="ppo_t1tl"),
        pytest.param(ppo, ContextConfig(), 5_700, 152, id="ppo_t2tl"),
        pytest.param(dqn, None, 3_200, 68 + TARGET, id="dqn_t1tl"),
        pytest.param(dqn, ContextConfig(), 5_400, 136 + TARGET, id="dqn_t2tl"),
    ],
)
def test_operations_of_an_iteration(learner, context, most, products):
    make, config, world = learner(context)
    env = TaskEnv(world, compile_tasks(["!Down U Up"], world.propositions, world.alphabet))
    agent, given = make(env, config, 50, iterations=10), env.make_params(0)
    state = jax.eval_shape(agent.init, jax.random.key(0), given)
    found = operations(agent.iterate, state, given)
    assert (found["tan"], found["sinh"]) == (1, 1)  # one step of the environment and one reset
    assert found["dot_general"] <= products
    assert found.total() <= most
    if learner is dqn:
        loops = in_loops(agent.iterate, state, given)
        assert loops[1]["dot_general"] <= TARGET  # in a block of steps
        assert sum(of["dot_general"] for depth, of in loops.items() if depth > 1) <= products - TARGET  # in each step
