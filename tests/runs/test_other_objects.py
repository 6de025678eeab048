"""A run is evaluated where there are more balls, or balls of other colours, as far as its network can read them."""

import dataclasses

import jax
import pytest

from envs.waterworld import WaterWorld, WaterWorldConfig
from t2tl_jax.agents.ppo_config import PPOConfig
from t2tl_jax.errors import UserError
from t2tl_jax.evaluation.episodes import player_of_seeds
from t2tl_jax.networks.actor_critic import NetworkConfig
from t2tl_jax.networks.lookahead import LookaheadConfig
from t2tl_jax.networks.objects import ObjectsConfig
from t2tl_jax.networks.state_encoders import FlatConfig
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.experiment import build
from t2tl_jax.runs.result import Result
from t2tl_jax.training.seeds import EVALUATION, stream_keys

BALLS = ObjectsConfig(layers=(4,), identity="role")
MORE_BALLS = WaterWorldConfig(colours=("a", "b"), balls_per_colour=3)
MORE_COLOURS = WaterWorldConfig(colours=("a", "b", "c"), balls_per_colour=1)


def untrained(state) -> Result:
    network = NetworkConfig(task_encoder=LookaheadConfig(4, 1), state=state, env_layers=(), actor_layers=())
    learner = PPOConfig(network=network, num_envs=2, unroll_length=2, minibatch_size=4)
    env = WaterWorldConfig(colours=("a", "b"), balls_per_colour=1)
    experiment = build(Config(env=env, task="F a & F b", learner=learner, frames=4, seeds="0,"))
    given = experiment.task_env.make_params(0)
    params = jax.jit(jax.vmap(lambda key: experiment.agent.init(key, given).params))(
        jax.random.split(jax.random.key(0), 1)
    )
    return Result(experiment, {"final": params, "best": params}, {}, 0)


@pytest.mark.slow
def test_by_role_other_colours_are_met():
    """Traced as the evaluation plays it."""
    result = untrained(BALLS)
    there = result._on("!a U (b & F c)", WaterWorld(MORE_COLOURS))
    assert there.table.propositions == ("a", "b", "c")
    reports = jax.eval_shape(
        player_of_seeds(there.task_env, there.agent, 2, 4, 0.9, True),
        result.params["final"],
        there.env_params("evaluation"),
        stream_keys(result.seeds, EVALUATION),
    )
    assert jax.tree.leaves(reports)[0].shape[0] == 1


@pytest.mark.slow
def test_by_name_more_balls_are_met_but_no_other_colours():
    result = untrained(dataclasses.replace(BALLS, identity="proposition"))
    there = result._on(None, WaterWorld(MORE_BALLS))
    assert there.env.observation_size == 28 and there.table is result.experiment.table
    with pytest.raises(UserError, match=r"no parameters for the observations of WaterWorld.*propositions \(a, b\)"):
        result.evaluate("F c", env=WaterWorld(MORE_COLOURS))


@pytest.mark.slow
def test_a_flat_network_meets_neither():
    with pytest.raises(UserError, match="no parameters for the observations of WaterWorld"):
        untrained(FlatConfig()).evaluate(env=WaterWorld(MORE_BALLS))
