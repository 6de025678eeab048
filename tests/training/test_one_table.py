"""One table for all seeds: in the arguments and inside of the compiled program, and none in what checkpoints keep."""

import dataclasses
import re

import jax
import pytest

from t2tl_jax.agents.dqn import make_dqn
from t2tl_jax.agents.dqn_config import DQNConfig
from t2tl_jax.agents.ppo import make_ppo
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.networks.actor_critic import NetworkConfig
from t2tl_jax.networks.q_network import QNetworkConfig
from t2tl_jax.networks.task_encoders import OneHotConfig
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.training.program import params_of_seeds, trace
from t2tl_jax.training.types import Agent, LearnerConfig
from tests.agents.sizes import PPO
from tests.probe import DiscreteProbeEnv

SEEDS = (0, 1, 2)
ONE_HOT = OneHotConfig(size=64)
LEARNERS: dict[str, tuple] = {
    "ppo": (make_ppo, dataclasses.replace(PPO, network=NetworkConfig(task_encoder=ONE_HOT))),
    "dqn": (
        make_dqn,
        DQNConfig(
            network=QNetworkConfig(task_encoder=ONE_HOT),
            num_envs=4,
            unroll_length=5,
            batch_size=8,
            buffer_size=100,
            learning_starts=20,
        ),
    ),
}


def task_env(steps: int) -> TaskEnv:
    """Its table has sizes that nothing else in the program has."""
    world = DiscreteProbeEnv()
    return TaskEnv(world, compile_tasks(f"F(Up & {'X ' * steps}Down)", world.propositions, world.alphabet))


def agent_of(learner: str, env: TaskEnv) -> Agent:
    make, config = LEARNERS[learner]
    assert isinstance(config, LearnerConfig)
    return make(env, config, 20, 10)


@pytest.mark.slow
@pytest.mark.parametrize("learner", LEARNERS)
def test_no_array_of_the_table_is_there_for_every_seed(learner):
    env = task_env(4)
    program = trace(agent_of(learner, env), SEEDS, params_of_seeds(env, SEEDS))
    given = jax.tree.leaves(program.env_params.table)
    assert [x.shape for x in given] == [x.shape for x in jax.tree.leaves(env.table)]
    text = program.lowered_iterate.as_text()
    types = {"int32": "i32", "int8": "i8", "bool": "i1", "float32": "f32"}
    for array in (*env.table.branches, env.table.tokens):
        is_read = array is not env.table.tokens  # this encoder reads none
        rest = "x".join(map(str, array.shape)) + f"x{types[str(array.dtype)]}"
        assert (f"tensor<{rest}>" in text) == is_read
        assert not re.search(rf"tensor<(\d+x)*{len(SEEDS)}x(\d+x)*{rest}>", text)
        assert not re.search(rf"stablehlo.constant dense<(?!\d).*> : tensor<{rest}>", text), "an argument, no constant"


@pytest.mark.slow
@pytest.mark.parametrize("learner", LEARNERS)
def test_checkpoints_hold_no_table(learner):
    """It is compiled again from the configuration. What is kept of rows is what a network has made of them."""
    small, large = (
        jax.eval_shape(agent_of(learner, env).init, jax.random.key(0), env.make_params(0))
        for env in (task_env(2), task_env(4))
    )
    sizes = [
        {jax.tree_util.keystr(path): x.shape for path, x in jax.tree_util.tree_leaves_with_path(state)}
        for state in (small, large)
    ]
    differ = [name for name in sizes[0] if sizes[0][name] != sizes[1][name]]
    assert differ == ([".target_embedding"] if learner == "dqn" else [])
