"""Brax's own PPO trains the environment as it is."""

import jax
import jax.numpy as jnp
import pytest
from brax.training.agents.ppo import networks as ppo_networks
from brax.training.agents.ppo import train as ppo

from envs.zones import ZoneConfig, ZoneEnv


@pytest.fixture
def replicated_devices(monkeypatch):
    """brax 0.14 calls ``jax.device_put_replicated``, which is gone since jax 0.10: stand in for one device."""

    def device_put_replicated(tree, devices):
        assert len(devices) == 1
        return jax.tree.map(lambda x: jnp.asarray(x)[None], tree)

    monkeypatch.setattr(jax, "device_put_replicated", device_put_replicated, raising=False)


@pytest.mark.slow
def test_brax_ppo_runs_the_environment(replicated_devices):
    def small_networks(*args, **kwargs):
        sizes = {"policy_hidden_layer_sizes": (16,), "value_hidden_layer_sizes": (16,)}
        return ppo_networks.make_ppo_networks(*args, **sizes, **kwargs)

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
