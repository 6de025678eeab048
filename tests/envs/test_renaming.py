"""Renamed propositions: what is shown, what is labelled and what the task asks for change their names together."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from envs.waterworld import WaterWorld, WaterWorldConfig
from envs.zones import ZoneConfig, ZoneEnv
from t2tl_jax.agents.ppo_config import PPOConfig
from t2tl_jax.networks.actor_critic import NetworkConfig
from t2tl_jax.networks.task_encoders import OneHotConfig
from t2tl_jax.objects import Objects
from t2tl_jax.renaming import Renamed, RenamedState
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.experiment import build
from t2tl_jax.single_state import SingleState

COLOURS = ("a", "b", "c", "d")


@pytest.fixture(scope="module")
def water() -> Renamed:
    return Renamed(WaterWorld(WaterWorldConfig(colours=COLOURS, events="level")))


@pytest.fixture(scope="module")
def played(water):
    """Episodes of 60 steps under 16 orders: (states, leading axes [16, 60]; their labels)."""

    @jax.jit
    @jax.vmap
    def play(key):
        def step(state, action):
            state = water.step(state, action)
            return state, (state, water.labels(state))

        return jax.lax.scan(step, water.reset(key), jax.random.randint(key, 60, 0, 5))[1]

    return play(jax.random.split(jax.random.key(0), 16))


def test_a_label_is_that_of_the_ball_which_is_shown_to_be_there(water, played):
    """Read off the observation alone: a colour holds where one of its balls touches the agent."""
    states, labels = played
    params, objects = water.make_params(0), water.objects
    each = np.asarray(states.obs[..., 4:]).reshape(16, 60, 8, 4)
    distance = np.linalg.norm(each[..., :2] * params.arena, axis=-1)
    reach = params.agent_radius + params.ball_radius[0]
    clear = np.abs(distance - reach) > 0.01  # float32 knows no better
    touching = distance <= reach
    for colour in range(4):
        of_colour = np.array(objects.proposition) == colour
        seen, sure = touching[..., of_colour].any(-1), clear[..., of_colour].all(-1)
        np.testing.assert_array_equal(seen[sure], np.asarray(labels)[..., colour][sure])
    assert np.asarray(labels).any((0, 1)).all()


def test_names_stay_for_an_episode_and_all_come(water, played):
    orders = np.asarray(played[0].pipeline_state.order)
    assert (orders == orders[:, :1]).all() and (np.sort(orders[:, 0]) == np.arange(4)).all()
    assert all(len(set(orders[:, 0, k])) == 4 for k in range(4))


def test_under_their_own_names_nothing_changes(water, played):
    """The same world: each colour's numbers are those of the one that bears its name."""
    states = jax.tree.map(lambda x: x[:, -1], played[0])
    observe = jax.jit(jax.vmap(lambda state: water.env._observe(state, water.env._given(None))))
    own = observe(states.pipeline_state.env)
    for shown, inner, order in zip(states.obs, own, states.pipeline_state.order, strict=True):
        np.testing.assert_allclose(shown[:4], inner[:4], atol=1e-6)
        blocks = np.asarray(inner[4:]).reshape(4, 8)
        np.testing.assert_allclose(np.asarray(shown[4:]).reshape(4, 8), blocks[np.asarray(order)], atol=1e-6)


@pytest.mark.slow
def test_lidars_are_renamed_in_their_own_order():
    """The lidars of ZoneEnv stand in another order than its propositions, in the open arena not side by side."""
    env = ZoneEnv(ZoneConfig(physics="closed_form", arena="open", layout="random", pool_size=2))
    renamed = Renamed(env)
    state = jax.jit(env.reset)(jax.random.key(0))
    order = jnp.array([2, 0, 3, 1])
    shown = jax.jit(renamed._shown)(state, order).obs
    part, rest = env.observation_parts, np.ones(env.observation_size, bool)
    for name, before in enumerate(order.tolist()):
        now, then = part[env.propositions[name]], part[env.propositions[before]]
        np.testing.assert_array_equal(shown[now], state.obs[then])
        rest[now] = False
    assert rest.sum() == 16
    np.testing.assert_array_equal(shown[rest], state.obs[rest])


@pytest.mark.slow
def test_a_run_renames_in_training_only():
    learner = PPOConfig(
        network=NetworkConfig(task_encoder=OneHotConfig()), num_envs=2, unroll_length=2, minibatch_size=4
    )
    config = Config(env=WaterWorldConfig(colours=COLOURS), task="F a", learner=learner, frames=4, renaming=True)
    experiment = build(config)
    given = experiment.task_env.make_params(0)
    state = jax.eval_shape(experiment.agent.init, jax.random.key(0), given)
    assert isinstance(state.episodes.state.pipeline_state.env, RenamedState)
    assert isinstance(experiment.task_env.env, WaterWorld)
    after, _ = jax.eval_shape(experiment.agent.iterate, state, given)
    assert jax.tree.map(jnp.shape, after) == jax.tree.map(jnp.shape, state)


def test_what_cannot_be_renamed_is_refused(monkeypatch):
    with pytest.raises(ValueError, match=r"LabelledEnv\.objects.*use renaming=False"):
        Renamed(SingleState())
    env = WaterWorld(WaterWorldConfig(colours=COLOURS))
    monkeypatch.setattr(WaterWorld, "objects", Objects.blocks(range(4, 24, 4), 4, (0, 0, 1, 2, 3)))
    with pytest.raises(ValueError, match="got 2, 1, 1, 1 for the 4 of this environment"):
        Renamed(env)
