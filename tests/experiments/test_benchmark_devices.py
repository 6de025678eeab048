"""Benchmarks use all devices: trainings as a run of theirs does, and each device has its part of the environments."""

import pytest

from experiments.benchmarks.trainings import training, with_num_envs
from t2tl_jax.agents.ppo_config import PPOConfig
from t2tl_jax.errors import UserError
from tests.four_devices import run_on_four_devices

PROGRAM = """
from dataclasses import replace
import jax
from experiments.benchmarks import env_speed, training_speed
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.runs.experiment import build
from t2tl_jax.single_state import SingleStateConfig
from t2tl_jax.task_env import TaskEnv
from tests.agents.sizes import PPO
from tests.agents.test_ppo import ONE_HOT
from tests.fake_learner import CONFIG
from tests.parameters import begun_quickly
from tests.probe import ProbeEnv

timed = []

def kept(compiled):
    def compiled_and_kept(trace):
        program, costs = compiled(trace)
        timed.append(program)
        return program, costs
    return compiled_and_kept

for speed in (env_speed, training_speed):
    speed.compiled = kept(speed.compiled)

# ----- environments -----

def per_device(x, devices):
    parts = x.addressable_shards
    assert len({part.device for part in parts}) == devices, parts
    return {part.data.shape[0] for part in parts}

probe = ProbeEnv()
env = TaskEnv(probe, compile_tasks(["F Up"], probe.propositions, probe.alphabet))
episodes = env_speed.begun(env, env.make_params(0), 8, 20, env_speed.shared_out(8))
for x in jax.tree.leaves(episodes):
    assert per_device(x, 4) == {2}
assert [1 if over is None else over.mesh.size for over in map(env_speed.shared_out, (6, 7, 1))] == [3, 1, 1]
speed = env_speed.measure(env, 8, 5, 1, 20)
assert speed.devices == 4 and speed.steps_per_s > 0
assert all(tuple(over.spec) == ("envs",) for over in jax.tree.leaves(timed[-1].output_shardings[0]))
assert "all-gather" not in timed[-1].as_text()  # each device steps its own

# ----- trainings -----

def measured(seeds, devices_per_seed=0, config=CONFIG):
    config = replace(config, seeds=seeds, run=replace(config.run, devices_per_seed=devices_per_seed))
    speed = training_speed.measure(config, 1)
    assert speed.acting is None  # it would be timed on one
    return speed.devices, speed.frames

def mesh():  # of the training state, as the timed program takes it
    return tuple(timed[-1].input_shardings[0][0].key.mesh.shape.values())

def built_quickly(config):
    experiment = build(config)
    return replace(experiment, agent=begun_quickly(experiment.agent))

assert measured("5") == (4, 500) and mesh() == (4, 1)  # filled up to eight, of which three are not counted
training_speed.build = built_quickly
ppo = replace(CONFIG, env=SingleStateConfig(), learner=replace(PPO, network=ONE_HOT, epochs=1))
assert measured("1,", 4, ppo) == (4, 256) and mesh() == (1, 4)
assert "all-reduce" in timed[-1].as_text()  # gradients are summed
"""


@pytest.mark.slow
def test_four_devices_share_the_work():
    run_on_four_devices(PROGRAM)


def test_minibatches_grow_with_the_number_of_environments():
    before, many = training("zone_ppo_long:t2tl:mjx"), training("zone_ppo_long:t2tl:mjx:16384")
    assert (before.learner.num_envs, before.learner.minibatch_size) == (2048, 8192)
    assert (many.learner.num_envs, many.learner.minibatch_size) == (16384, 65536)
    assert many.learner.num_minibatches == before.learner.num_minibatches
    assert training("zone_ppo_long:::2048") == training("zone_ppo_long") and before.env == many.env


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("zone_ppo_long:t1tl:mjx:0", "whole number of at least 1, such as 16384, got '0'"),
        ("zone_ppo_long:t1tl:mjx:2e4", "got '2e4'"),
        ("zone_ppo_long:t1tl:mjx:-8", "got '-8'"),
        ("waterworld_dqn:t1tl::256", "DQNConfig has no minibatches"),
        ("zone_ppo_long:t2tl:mjx:3", "segment_length must divide minibatch_size"),
        ("zone_ppo_long:t1tl:mjx:8:8", "CONFIG:METHOD:PHYSICS:ENVIRONMENTS"),
    ],
)
def test_numbers_of_environments_that_cannot_be_are_explained(text, said):
    with pytest.raises(UserError) as error:
        training(text)
    assert said in str(error.value) and text in str(error.value)


def test_minibatches_that_would_not_be_whole_are_explained():
    learner = PPOConfig(num_envs=16, unroll_length=2, minibatch_size=8)
    assert with_num_envs(learner, "24", "mine").minibatch_size == 12
    with pytest.raises(UserError, match=r"mine: .* no whole number for 3; take a multiple of 16"):
        with_num_envs(learner, "3", "mine")
