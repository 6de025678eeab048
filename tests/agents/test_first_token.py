"""The token that no step has made, in PPO's windows when a training begins: what it is, and what it spares."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest

from experiments import configs  # noqa: F401, registers the published program
from t2tl_jax.agents.ppo import make_ppo
from t2tl_jax.agents.ppo_config import PPOConfig
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.networks.actor_critic import NetworkConfig
from t2tl_jax.networks.context import ContextEncoder
from t2tl_jax.networks.context_config import ContextConfig
from t2tl_jax.networks.gru import GRUConfig
from t2tl_jax.networks.q_network import QNetworkConfig
from t2tl_jax.networks.task_encoders import OneHotConfig
from t2tl_jax.networks.windows import append, empty_window, without_oldest
from t2tl_jax.registry import named_config
from t2tl_jax.task_env import TaskEnv
from tests.agents import sizes
from tests.parameters import begun_quickly, parameters
from tests.probe import CueEnv, DiscreteCueEnv

LEARNER = named_config("zone_ppo_published").learner
assert isinstance(LEARNER, PPOConfig) and LEARNER.network.context is not None
PUBLISHED = LEARNER.network.context
MADE_UP = ContextConfig(length=3, reader=sizes.TRANSFORMER, reset=False, first_token="made_up")


def begun(probe, context):
    """A learner's first state, and what embeds its observations."""
    env = TaskEnv(probe, compile_tasks(["F Up"], probe.propositions, probe.alphabet))
    network = NetworkConfig(
        task_encoder=OneHotConfig(), env_layers=(4,), actor_layers=(), critic_layers=(), context=context
    )
    agent = begun_quickly(make_ppo(env, dataclasses.replace(sizes.PPO, network=network), 5, 10))
    return jax.jit(agent.init)(jax.random.key(3), env.make_params(0)), agent


@pytest.mark.slow
@pytest.mark.parametrize("probe", [CueEnv(), DiscreteCueEnv()], ids=["continuous", "discrete"])
def test_every_environment_begins_with_a_token_of_its_own_and_nothing_else_changes(probe):
    (without, _), (state, agent) = (
        begun(probe, dataclasses.replace(MADE_UP, first_token=token)) for token in ("none", "made_up")
    )
    carry, action = state.carry, np.asarray(state.carry.action[:, -1])
    np.testing.assert_array_equal(carry.valid, [[False, False, True]] * sizes.PPO.num_envs)
    np.testing.assert_array_equal(carry.seen[:, -1], state.episodes.state.obs)
    assert not carry.reward.any() and not carry.action[:, :-1].any() and not carry.seen[:, :-1].any()
    assert np.abs(action).max() <= (1 if probe.num_actions is None else probe.num_actions - 1)
    assert len(np.unique(action, axis=0)) >= (sizes.PPO.num_envs if probe.num_actions is None else 2)
    # All other draws are those of a training without it, whose windows are empty, as those of an evaluation.
    assert not without.carry.valid.any() and not agent.begin().valid.any()
    jax.tree.map(
        np.testing.assert_array_equal,
        *(
            dataclasses.replace(one, carry=(), key=jax.random.key_data(one.key), episodes=one.episodes.state.obs)
            for one in (without, state)
        ),
    )


@pytest.mark.slow
def test_the_published_reader_needs_it_for_a_gradient_of_ordinary_size():
    module, rng = ContextEncoder(PUBLISHED), np.random.default_rng(0)
    empty = empty_window(PUBLISHED.length, jnp.zeros(2), 4)
    action, seen = (rng.uniform(-1, 1, size).astype(np.float32) for size in (2, 4))
    begun = without_oldest(append(empty, jnp.asarray(action), jnp.zeros(()), jnp.asarray(seen)))
    params = parameters(module, empty, empty.seen)
    for path, leaf in jax.tree_util.tree_leaves_with_path(params):
        if path[-1].key == "bias":
            leaf *= 0  # as a training begins with

    @jax.jit
    def size(window):
        return optax.tree.norm(jax.grad(lambda p: module.apply(p, window, window.seen).sum())(params))

    assert size(begun) < 1e3 and size(empty) > 1e3 * size(begun)


def test_where_it_makes_no_sense_it_is_refused():
    assert ContextConfig().first_token == "none" and PUBLISHED.first_token == "made_up"
    with pytest.raises(ValueError, match="first_token=made_up needs reset=False"):
        ContextConfig(first_token="made_up")
    with pytest.raises(ValueError, match="a state that is carried has none; use first_token=none, or carried=False"):
        ContextConfig(carried=True, reader=GRUConfig(), reset=False, first_token="made_up")
    with pytest.raises(ValueError, match=r"first_token=made_up is of PPO's windows .*use first_token=none"):
        QNetworkConfig(context=MADE_UP)
