"""DQN's seeds over several devices: each stays on one, and has the numbers that it has alone."""

import pytest

from tests.four_devices import run_on_four_devices

PROGRAM = """
import dataclasses
import jax, numpy as np
from t2tl_jax.agents.dqn import make_dqn
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.training.devices import seed_sharding
from t2tl_jax.training.program import params_of_seeds, trace
from tests.agents.test_dqn import DQN, SMALL
from tests.parameters import begun_quickly
from tests.probe import DiscreteProbeEnv

probe = DiscreteProbeEnv()
env = TaskEnv(probe, compile_tasks(["F(Up & F(Down & F Up))"], probe.propositions, probe.alphabet))
config = dataclasses.replace(DQN, network=SMALL, unroll_length=10, buffer_size=64, learning_starts=80)
agent = begun_quickly(make_dqn(env, config, episode_length=20, iterations=15))

def trained(seeds, devices):
    sharding = seed_sharding(len(seeds), agent.num_envs, per_seed=4)
    assert (1 if sharding is None else len(sharding.device_set)) == devices
    program = trace(agent, seeds, params_of_seeds(env, seeds), sharding=sharding)
    state = program.lowered_init.compile()(program.keys, program.env_params)
    iterate = program.lowered_iterate.compile()
    assert "all-reduce" not in iterate.as_text()
    for _ in range(3):
        state, metrics = iterate(state, program.env_params)
    return jax.device_get((state.params, metrics))

alone, spread = trained((5,), 1), trained((6, 7, 5, 8), 4)
assert alone[1].scalars["loss"] > 0
jax.tree.map(lambda a, b: np.testing.assert_allclose(a[0], b[2], rtol=1e-4, atol=1e-5), alone, spread)
"""


@pytest.mark.slow
def test_four_seeds_over_four_devices_have_the_numbers_of_one_alone():
    """One seed leaves three of four devices idle, whatever it is told of devices for a seed."""
    run_on_four_devices(PROGRAM)
