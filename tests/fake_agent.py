"""The learning half of `fake_learner.py`: pure functions that look like a learner's and compile in an instant."""

import os
import time
from dataclasses import dataclass, field
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import optax
from flax import struct

from t2tl_jax.networks.gru import GRUConfig
from t2tl_jax.networks.task_encoder import TaskEncoderConfig
from t2tl_jax.training.types import Agent, EpisodeTotals, LearnerConfig, Metrics

FRAMES_PER_ITERATION = 100


@dataclass(frozen=True)
class FakeNetwork:
    """What every network has that can be pre-trained."""

    task_encoder: TaskEncoderConfig = field(default_factory=GRUConfig)
    """Named only; the fake learner reads nothing."""
    freeze_task_encoder: bool = False
    """Without effect."""


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
    optimizer = optax.chain(optax.clip_by_global_norm(1.0), optax.adam(config.rate))

    def init(key: jax.Array, env_params: Any) -> FakeState:
        key, params_key = jax.random.split(key)
        params = {"params": {"w": jax.random.normal(params_key, (4, 3)), "task_encoder": {"b": jnp.zeros(3)}}}
        # The iteration is weakly typed on purpose: it must not lead to a second compilation.
        return FakeState(params, optimizer.init(params), key, jnp.asarray(0))

    def iterate(state: FakeState, env_params: Any) -> tuple[FakeState, Metrics]:
        if delay := float(os.environ.get("FAKE_SECONDS", "0")):
            jax.debug.callback(lambda: time.sleep(delay))
        key, draw = jax.random.split(state.key)

        def loss(params: Any) -> jax.Array:
            x = jax.random.normal(draw, (8, 4))
            return jnp.square(jnp.tanh(x @ params["params"]["w"]) + params["params"]["task_encoder"]["b"]).mean()

        value, gradient = jax.value_and_grad(loss)(state.params)
        updates, opt_state = optimizer.update(gradient, state.opt_state)
        episodes = jax.random.randint(draw, (), 0, 4)
        successes = episodes // 2
        totals = EpisodeTotals(
            episodes=episodes,
            successes=successes,
            violations=episodes - successes,
            timeouts=jnp.int32(0),
            env_terminations=jnp.int32(0),
            discounted_return=successes * 0.9 - value,
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
        return jax.random.bernoulli(key, 0.5, obs.shape[:-1]).astype(jnp.float32)

    return Agent(init, iterate, embed, act, FRAMES_PER_ITERATION, restart=lambda state, env_params: state)
