"""Seeds and their environments over several devices: what is shared out gives the same numbers."""

import pytest

from tests.four_devices import run_on_four_devices

PROGRAM = """
import dataclasses
import jax, numpy as np
from t2tl_jax.agents.ppo import make_ppo
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.training.devices import seed_sharding
from t2tl_jax.training.program import params_of_seeds, trace
from tests.agents.sizes import PPO
from tests.agents.test_ppo import ONE_HOT
from tests.parameters import begun_quickly
from tests.probe import ProbeEnv

probe = ProbeEnv()
env = TaskEnv(probe, compile_tasks(["F(Up & F(Down & F Up))"], probe.propositions, probe.alphabet))
# Adam divides by the gradient's size: with the usual epsilon it would make rounding of vanishing gradients visible.
config = dataclasses.replace(PPO, network=ONE_HOT, epochs=1, adam_epsilon=1.0, learning_rate=0.3)
agent = begun_quickly(make_ppo(env, config, episode_length=20, iterations=60))

def trained(seeds, mesh):
    sharding = seed_sharding(len(seeds), agent.num_envs, per_seed=mesh[1])
    assert (None if sharding is None else tuple(sharding.mesh.shape.values())) == (None if mesh == (1, 1) else mesh)
    program = trace(agent, seeds, params_of_seeds(env, seeds), sharding=sharding)
    state = program.lowered_init.compile()(program.keys, program.env_params)
    iterate = program.lowered_iterate.compile()
    text = iterate.as_text()
    for _ in range(2):
        state, metrics = iterate(state, program.env_params)
    return text, jax.device_get((state.params, metrics))

text, alone = trained((5,), (1, 1))
assert "all-reduce" not in text
spread_text, spread = trained((6, 5), (2, 2))
assert "all-reduce" in spread_text  # gradients are summed over the devices of a seed
jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b[1:], rtol=1e-4, atol=1e-6), alone, spread)
"""


@pytest.mark.slow
def test_two_seeds_over_four_devices_give_the_numbers_of_one_on_one():
    run_on_four_devices(PROGRAM)


SHARES = """
import math, re
from dataclasses import replace
from t2tl_jax.agents.ppo import make_ppo
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.networks.context_config import ContextConfig
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.training.devices import seed_sharding
from t2tl_jax.training.program import params_of_seeds, trace
from tests.agents.sizes import PPO
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

for context in (None, ContextConfig(length=4)):
    share = products(context, 4) / products(context, 1)
    assert share < 0.3, (context, share)
"""


@pytest.mark.slow
def test_each_of_four_devices_does_a_quarter_of_the_matrix_products():
    """Also of the values of a rollout: what every device computes for all is lost by those that share it out."""
    run_on_four_devices(SHARES)
