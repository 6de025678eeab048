"""Gradients that are not finite change nothing, the cause is named, and other seeds go on."""

from dataclasses import replace

import chex
import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest
from flax import struct

from t2tl_jax.registry import AGENTS, Kind
from t2tl_jax.runs.callbacks import Callback
from t2tl_jax.runs.train import train
from t2tl_jax.training.guard import CAUSES, Fault, watched
from t2tl_jax.training.optimizer import clipped_adam
from t2tl_jax.training.types import Agent, EpisodeTotals, Metrics
from tests import fake_agent
from tests.fake_learner import CONFIG

NAN, INF = float("nan"), float("inf")
NOBODY = EpisodeTotals(*[jnp.int32(0)] * 5, *[jnp.float32(0)] * 4)


@struct.dataclass
class Here:
    obs: jax.Array


@struct.dataclass
class Episodes:
    state: Here


@struct.dataclass
class State:
    episodes: Episodes


@pytest.mark.parametrize(
    ("obs", "scalars", "fault"),
    [
        (0.0, {}, Fault.NONE),
        (INF, {"entropy": NAN}, Fault.NONE),
        (0.0, {"gradient_norm": INF}, Fault.GRADIENT),
        (0.0, {"gradient_norm": NAN, "value_loss": NAN}, Fault.LOSS),
        (NAN, {"value_loss": INF}, Fault.ENVIRONMENT),
    ],
)
def test_the_first_cause_is_named(obs, scalars, fault):
    def iterate(state, env_params):
        return state, Metrics(NOBODY, {name: jnp.float32(value) for name, value in scalars.items()})

    state = State(Episodes(Here(jnp.full((2, 3), obs))))
    _, metrics = jax.jit(watched(Agent(None, iterate, None, None, 1)).iterate)(state, None)
    assert Fault(int(metrics.fault)) is fault and (fault in CAUSES) == (fault is not Fault.NONE)


@pytest.mark.slow
@pytest.mark.parametrize("bad", [NAN, INF, 1e30])
def test_a_gradient_that_is_not_finite_changes_nothing(bad):
    """Also one whose norm overflows."""
    optimizer = clipped_adam(1e-2, 0.5, gradient_steps=10, anneal=False)
    params = {"params": {"task_encoder": {"w": jnp.ones(2)}, "actor": {"w": jnp.ones(3)}}}
    state = optimizer.init(params)
    good = jax.tree.map(jnp.ones_like, params)
    spoiled = {"params": {**good["params"], "actor": {"w": jnp.array([1.0, bad, 1.0])}}}
    for gradient in (good, spoiled, good):
        updates, state = optimizer.update(gradient, state, params)
        after = optax.apply_updates(params, updates)
        moved = [float(jnp.abs(a - b).max()) for a, b in zip(*map(jax.tree.leaves, (params, after)), strict=True)]
        assert all(step == 0 for step in moved) if gradient is spoiled else all(step > 1e-3 for step in moved)
        params = after
    chex.assert_tree_all_finite((params, state))


class Ends(Callback):
    """Keeps what is noted at the end."""

    def on_end(self, progress):
        self.notes = dict(progress.notes)


def test_a_broken_seed_is_told_once_and_its_iterations_are_counted(monkeypatch, recwarn):
    def spoiling(*given):
        agent = fake_agent.make_agent(*given)

        def iterate(state, env_params):
            after, metrics = agent.iterate(state, env_params)
            spoiled = (jax.random.key_data(state.key)[-1] % 2 == 0) & (state.iteration >= 1)
            loss = jnp.where(spoiled, NAN, metrics.scalars["loss"])
            return after, Metrics(metrics.episodes, metrics.scalars | {"loss": loss})

        return agent._replace(iterate=iterate)

    monkeypatch.setitem(AGENTS._kinds, "fake", Kind(fake_agent.FakeConfig, spoiling))
    ends = Ends()
    result = train(replace(CONFIG, frames=800, seeds="4"), callbacks=[ends])
    broken = np.isnan(result.metrics["loss"])  # [seeds, iterations]
    told = ends.notes["faults"]
    assert broken.any() and {seed: entry["iterations"] for seed, entry in told.items()} == {
        str(seed): int(count) for seed, count in enumerate(broken.sum(axis=1)) if count
    }
    for seed, entry in told.items():
        assert entry["iteration"] == 1 + broken[int(seed)].argmax() and entry["cause"] == CAUSES[Fault.LOSS]
    assert sum("the loss was not finite" in str(warning.message) for warning in recwarn) == len(told)


def test_nothing_is_noted_where_all_is_finite():
    ends = Ends()
    train(CONFIG, callbacks=[ends])
    assert "faults" not in ends.notes
