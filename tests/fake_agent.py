"""The learning half of `fake_learner.py`: pure functions that look like a learner's and compile in an instant."""

import os
import time
from dataclasses import dataclass, field
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import optax
from flax import struct

from t2tl_jax.networks.gru import GRUConfig
from t2tl_jax.networks.task_encoder import TaskEncoderConfig
from t2tl_jax.training.types import Agent, EpisodeTotals, LearnerConfig, Metrics

FRAMES_PER_ITERATION = 100


def uniform(key: jax.Array) -> jax.Array:
    """A number from 0 to 1 that a key stands for; to draw one as usual takes longer to compile than all else here."""
    return (jax.random.key_data(key)[..., -1] >> 8) * jnp.float32(2**-24)


def spread(key: jax.Array, count: int) -> jax.Array:
    """So many numbers from -1 to 1 that a key stands for, in the same way."""
    bits = jax.random.key_data(key)[..., -1] * (np.uint32(2654435761) * np.arange(1, 2 * count, 2, np.uint32))
    return (bits >> 8) * jnp.float32(2**-23) - 1


def following(key: jax.Array) -> jax.Array:
    """A key's successor in the sequence of a generator as simple (Numerical Recipes)."""
    return jax.random.wrap_key_data(jax.random.key_data(key) * np.uint32(1664525) + np.uint32(1013904223))


@dataclass(frozen=True)
class FakeNetwork:
    """What every network has that can be pre-trained."""

    task_encoder: TaskEncoderConfig = field(default_factory=GRUConfig)
    """Named only; the fake learner reads nothing."""
    freeze_task_encoder: bool = False
    """Keep it as it is."""


@dataclass(frozen=True)
class FakeConfig(LearnerConfig):
    """The fake learner."""

    network: FakeNetwork = field(default_factory=FakeNetwork)
    """Its networks."""
    discount: float = 0.9
    """Discount factor gamma."""
    rate: float = 1e-2
    """Step size of Adam."""

    traced: ClassVar[tuple[str, ...]] = ("rate",)

    @property
    def task_encoder(self) -> TaskEncoderConfig:
        return self.network.task_encoder

    @property
    def frames_per_iteration(self) -> int:
        return FRAMES_PER_ITERATION


@struct.dataclass
class FakeState:
    params: Any
    opt_state: Any
    key: jax.Array
    iteration: jax.Array


def make_agent(
    env: Any = None, config: FakeConfig | None = None, episode_length: int = 5, iterations: int = 1
) -> Agent:
    del env, episode_length, iterations
    config = config or FakeConfig()
    optimizer = optax.adam(config.rate)

    def init(key: jax.Array, env_params: Any) -> FakeState:
        params = {"params": {"w": spread(key, 12).reshape(4, 3), "task_encoder": {"b": jnp.zeros(3)}}}
        if more := int(os.environ.get("FAKE_NUMBERS", "0")):
            params["params"]["more"] = spread(key, more)
        # The iteration is weakly typed on purpose: it must not lead to a second compilation.
        return FakeState(params, optimizer.init(params), key, jnp.asarray(0))

    def iterate(state: FakeState, env_params: Any) -> tuple[FakeState, Metrics]:
        if delay := float(os.environ.get("FAKE_SECONDS", "0")):
            jax.debug.callback(lambda: time.sleep(delay))
        key = following(state.key)
        draw = uniform(key)

        def loss(params: Any) -> jax.Array:
            x = spread(key, 32).reshape(8, 4)
            return jnp.square(jnp.tanh(x @ params["params"]["w"]) + params["params"]["task_encoder"]["b"]).mean()

        value, gradient = jax.value_and_grad(loss)(state.params)
        if config.network.freeze_task_encoder:
            gradient["params"]["task_encoder"]["b"] = jnp.zeros(3)
        updates, opt_state = optimizer.update(gradient, state.opt_state)
        episodes = (draw * 4).astype(jnp.int32)
        successes = episodes // 2
        totals = EpisodeTotals(
            episodes=episodes,
            successes=successes,
            violations=episodes - successes,
            timeouts=jnp.int32(0),
            env_terminations=jnp.int32(0),
            discounted_return=successes * 0.9 - value,
            total_reward=1.0 * successes,
            length=10.0 * episodes,
            success_length=7.0 * successes,
        )
        new = FakeState(
            params=optax.apply_updates(state.params, updates),
            opt_state=opt_state,
            key=key,
            iteration=state.iteration + 1,
        )
        return new, Metrics(totals, {"loss": value, "gradient_norm": optax.tree.norm(gradient)})

    def embed(params: Any, table: Any) -> jax.Array:
        if delay := float(os.environ.get("FAKE_EVALUATION_SECONDS", "0")):
            time.sleep(delay)
        return params["params"]["w"]

    def act(params: Any, embedding: Any, carry: Any, obs: jax.Array, row: jax.Array, key: jax.Array, deterministic):
        del params, embedding, carry, row
        if deterministic:
            return jnp.ones(obs.shape[:-1])
        draws = (spread(key, obs[..., 0].size) > 0).astype(jnp.float32)
        return draws.reshape(obs.shape[:-1])

    return Agent(init, iterate, embed, act, FRAMES_PER_ITERATION, restart=lambda state, env_params: state)
