"""Brax's own PPO trains the environment as it is, and learns a task that a wrapper shows to it."""

import jax
import jax.numpy as jnp
import pytest
from brax.training.agents.ppo import networks as ppo_networks
from brax.training.agents.ppo import train as ppo

from envs.zones import ZoneConfig, ZoneEnv
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.wrappers import TaskInObservation
from tests.probe import ProbeEnv


@pytest.fixture
def replicated_devices(monkeypatch):
    """brax 0.14 calls ``jax.device_put_replicated``, which is gone since jax 0.10: stand in for one device."""

    def device_put_replicated(tree, devices):
        assert len(devices) == 1
        return jax.tree.map(lambda x: jnp.asarray(x)[None], tree)

    monkeypatch.setattr(jax, "device_put_replicated", device_put_replicated, raising=False)


def small_networks(*args, **kwargs):
    sizes = {"policy_hidden_layer_sizes": (16,), "value_hidden_layer_sizes": (16,)}
    return ppo_networks.make_ppo_networks(*args, **sizes, **kwargs)


@pytest.fixture(scope="module")
def either() -> TaskEnv:
    """One of two tasks that exclude each other: who cannot tell which one it is succeeds in half of the episodes."""
    probe = ProbeEnv()
    return TaskEnv(probe, compile_tasks(["!Down U Up", "!Up U Down"], probe.propositions, probe.alphabet))


@pytest.mark.slow
def test_brax_ppo_runs_the_environment(replicated_devices):
    seen = []
    _, params, metrics = ppo.train(
        environment=ZoneEnv(ZoneConfig(physics="closed_form", layout="random", pool_size=16)),
        num_timesteps=320,
        episode_length=20,
        num_envs=8,
        batch_size=8,
        num_minibatches=2,
        num_updates_per_batch=1,
        unroll_length=10,
        num_evals=2,
        num_eval_envs=8,
        network_factory=small_networks,
        progress_fn=lambda step, _: seen.append(step),
    )
    assert seen and seen[-1] >= 320
    assert metrics["eval/episode_reward"] == 0.0
    assert metrics["eval/avg_episode_length"] == 20.0
    assert all(jnp.isfinite(leaf).all() for leaf in jax.tree.leaves(params))


@pytest.mark.slow
def test_brax_ppo_learns_a_task_that_it_is_shown(replicated_devices, either):
    _, _, metrics = ppo.train(
        environment=TaskInObservation(either),
        num_timesteps=40_000,
        episode_length=10,
        num_envs=32,
        batch_size=32,
        num_minibatches=4,
        num_updates_per_batch=4,
        unroll_length=10,
        learning_rate=3e-3,
        discounting=0.9,
        num_evals=2,
        num_eval_envs=256,
        network_factory=small_networks,
    )
    assert metrics["eval/episode_reward"] > 0.9  # chance is 0: +1 or -1 with equal probability


def test_without_the_wrapper_a_task_cannot_be_told(either):
    """Both observations are the same from the start to the end."""
    for row in either.table.initial_row:
        state = either.reset_to_row(jax.random.key(0), row)
        done = either.step(state, jnp.ones(1))
        assert state.obs.tolist() == done.obs.tolist() == [1, 1, 1] and done.done == 1


def test_the_code_of_the_row_follows_the_observation(either):
    features = jnp.arange(float(2 * either.table.num_rows)).reshape(-1, 2)
    env = TaskInObservation(either, features)
    state = env.reset(jax.random.key(0))
    row = int(either.row(state))
    assert row in either.table.initial_row and env.observation_size == 5 == len(state.obs)
    assert state.obs.tolist() == [1, 1, 1, *features[row]]
    done = env.step(state, jnp.ones(1))
    assert done.obs.tolist() == [1, 1, 1, *features[int(either.row(done))]] and done.done == 1
    assert TaskInObservation(either).observation_size == 3 + either.table.num_rows
    with pytest.raises(ValueError, match=r"the 4 rows of the table, got shape \(3, 2\)"):
        TaskInObservation(either, features[:3])
