"""Seeds and their environments over several devices: what is shared out gives the same numbers."""

import jax
import pytest

from t2tl_jax.env import EnvConfig
from t2tl_jax.runs.config import Config, RunConfig
from t2tl_jax.runs.experiment import build
from tests.agents.sizes import PPO
from tests.agents.test_dqn import DQN
from tests.four_devices import run_on_four_devices
from tests.probe import DiscreteProbeEnv, ProbeEnv

PROGRAM = """
import math, re, sys
from dataclasses import replace
from functools import partial
import jax, numpy as np
from t2tl_jax.agents import dqn
from t2tl_jax.agents.ppo import make_ppo
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.training.devices import place, seed_sharding
from t2tl_jax.training.program import params_of_seeds, trace
from tests.agents.sizes import PPO
from tests.agents.test_dqn import DQN, SMALL
from tests.agents.test_ppo import ONE_HOT
from tests.parameters import begun_quickly
from tests.probe import DiscreteProbeEnv, ProbeEnv

learner = sys.argv[1]
probe = ProbeEnv() if learner == "ppo" else DiscreteProbeEnv()
env = TaskEnv(probe, compile_tasks(["F(Up & F(Down & F Up))"], probe.propositions, probe.alphabet))
# Adam divides by the gradient's size: with the usual epsilon it would make rounding of vanishing gradients visible.
if learner == "ppo":
    config = replace(PPO, network=ONE_HOT, epochs=1, adam_epsilon=1.0, learning_rate=0.3)
    made = make_ppo(env, config, episode_length=20, iterations=60)
else:  # whose replay is full and begins anew; two devices do not divide a batch; acting is a good part of the work
    dqn.clipped_adam = partial(dqn.clipped_adam, epsilon=1.0)
    sizes = {"num_envs": 256, "unroll_length": 4, "batch_size": 63, "buffer_size": 512, "learning_starts": 512}
    config = replace(DQN, network=SMALL, learning_rate=0.3, **sizes)
    made = dqn.make_dqn(env, config, episode_length=20, iterations=15)
agent = begun_quickly(made)

begun = {}

def trained(seeds, mesh):
    sharding = seed_sharding(len(seeds), agent.num_envs, per_seed=mesh[1])
    assert (None if sharding is None else tuple(sharding.mesh.shape.values())) == (None if mesh == (1, 1) else mesh)
    program = trace(agent, seeds, params_of_seeds(env, seeds), sharding=sharding)
    state = program.lowered_init.compile()(program.keys, program.env_params)
    iterate = program.lowered_iterate.compile()
    text = iterate.as_text()
    assert ("all-reduce" in text) == (mesh[1] > 1)  # gradients are summed over the devices of a seed
    products = re.findall(r"= f32\\[([0-9,]+)\\]\\S* dot\\(", text)
    numbers = sum(math.prod(map(int, shape.split(","))) for shape in products)  # that they give, on each device

    def go_on(state):
        for _ in range(2):
            state, metrics = iterate(state, program.env_params)
        return jax.device_get(state), jax.device_get((state.params, metrics))

    begun[mesh] = jax.device_get(state.params)
    return numbers, *go_on(state), lambda state: go_on(place(state, sharding))[1]

def same(one, other):
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-4, atol=1e-6), one, other)

numbers, state, alone, goes_on = trained((5,), (1, 1))
share, spread_state, spread, _ = trained((6, 5), (2, 2))
assert share < 0.6 * numbers, (share, numbers)
moved = jax.tree.map(lambda a, b: float(np.abs(a - b).max()), begun[1, 1], alone[0])
assert min(jax.tree.leaves(moved)) > 1e-3, moved  # so it learned
same(alone, jax.tree.map(lambda x: x[1:], spread))
same(goes_on(state), goes_on(jax.tree.map(lambda x: x[1:], spread_state)))  # as from a checkpoint, on one device
if learner == "dqn":  # which keeps a seed on one device where it is not asked to spread it
    _, _, apart, _ = trained((6, 7, 5, 8), (4, 1))
    same(alone, jax.tree.map(lambda x: x[2:3], apart))
"""


@pytest.mark.slow
@pytest.mark.parametrize("learner", ["ppo", "dqn"])
def test_two_seeds_over_four_devices_give_the_numbers_of_one_on_one(learner):
    run_on_four_devices(PROGRAM, learner)


@pytest.mark.parametrize(
    ("learner", "seeds", "asked", "mesh"),
    [
        (PPO, "5,", 0, (1, 4)),
        (DQN, "5,", 0, None),  # what it was before it could be spread
        (DQN, "5,6", 0, (2, 1)),
        (DQN, "5,6", 4, (2, 2)),
    ],
)
def test_where_a_run_trains_on_a_processor_of_four_devices(monkeypatch, learner, seeds, asked, mesh):
    monkeypatch.setattr(jax, "devices", lambda: [jax.local_devices()[0]] * 4)
    probe = DiscreteProbeEnv() if learner is DQN else ProbeEnv()
    run = RunConfig(devices_per_seed=asked)
    config = Config(env=EnvConfig(), task="F Up", learner=learner, seeds=seeds, run=run)
    placed = build(config, probe).sharding
    assert (None if placed is None else tuple(placed.mesh.shape.values())) == mesh


SHARES = """
import math, re
from dataclasses import replace
from t2tl_jax.agents.ppo import make_ppo
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.networks.context_config import ContextConfig
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.training.devices import seed_sharding
from t2tl_jax.training.program import params_of_seeds, trace
from tests.agents.sizes import GRU, PPO
from tests.agents.test_ppo import ONE_HOT
from tests.parameters import begun_quickly
from tests.probe import ProbeEnv

probe = ProbeEnv()
env = TaskEnv(probe, compile_tasks(["F(Up & F(Down & F Up))"], probe.propositions, probe.alphabet))

def products(context, per_seed):  # numbers that matrix products give, on each device
    config = replace(PPO, network=replace(ONE_HOT, context=context), num_envs=256, minibatch_size=512, epochs=1)
    agent = begun_quickly(make_ppo(env, config, episode_length=20, iterations=60))
    sharding = seed_sharding(1, agent.num_envs, per_seed=per_seed)
    program = trace(agent, (5,), params_of_seeds(env, (5,)), sharding=sharding)
    found = re.findall(r"= f32\\[([0-9,]+)\\]\\S* dot\\(", program.lowered_iterate.compile().as_text())
    return sum(math.prod(map(int, shape.split(","))) for shape in found)

for context in (None, ContextConfig(length=4, reader=GRU)):
    share = products(context, 4) / products(context, 1)
    assert share < 0.3, (context, share)
"""


@pytest.mark.slow
def test_each_of_four_devices_does_a_quarter_of_the_matrix_products():
    """Also of the values of a rollout: what every device computes for all is lost by those that share it out."""
    run_on_four_devices(SHARES)
