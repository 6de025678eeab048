"""A learner: REINFORCE with the return that is left, on the library's environments, episode loop and task encoders."""

from dataclasses import dataclass, field
from typing import Any

import jax
import jax.numpy as jnp
import optax
from flax import linen as nn
from flax import struct

from somebody.encoder import BagConfig
from t2tl_jax import Agent, LearnerConfig, TaskEncoderConfig, TaskEnv, register_agent
from t2tl_jax.networks.task_encoders import make_task_encoder
from t2tl_jax.training.types import Metrics
from t2tl_jax.training.unroll import Episode, Player, begin, env_scalars, summed, unroll


@dataclass(frozen=True)
class LogitsConfig:
    """The network of `ReinforceConfig`."""

    task_encoder: TaskEncoderConfig = field(default_factory=BagConfig)
    """What reads the task."""
    width: int = 32
    """Size of the hidden layer."""


@dataclass(frozen=True)
class ReinforceConfig(LearnerConfig):
    """Constants of REINFORCE, for discrete actions."""

    network: LogitsConfig = field(default_factory=LogitsConfig)
    """The policy."""
    num_envs: int = 32
    """Parallel environments."""
    unroll_length: int = 16
    """Steps of each in one iteration."""
    discount: float = 0.9
    """Discount factor gamma."""
    learning_rate: float = 1e-2
    """Step size of Adam."""

    @property
    def task_encoder(self) -> TaskEncoderConfig:
        return self.network.task_encoder

    @property
    def frames_per_iteration(self) -> int:
        return self.num_envs * self.unroll_length


class Logits(nn.Module):
    config: LogitsConfig
    actions: int

    def setup(self) -> None:
        self.task_encoder = make_task_encoder(self.config.task_encoder)  # by this name it can be pre-trained
        self.hidden, self.out = nn.Dense(self.config.width), nn.Dense(self.actions)

    def embed(self, table):
        return self.task_encoder(table)

    def __call__(self, obs, task):
        return self.out(nn.tanh(self.hidden(jnp.concatenate([obs, task], axis=-1))))

    def initialise(self, table, obs, row):
        return self(obs, self.embed(table)[row])


@struct.dataclass
class ReinforceState:
    params: Any
    opt_state: Any
    episodes: Episode
    key: jax.Array


built = []
"""Configurations that `make_reinforce` was called with."""


def make_reinforce(env: TaskEnv, config: ReinforceConfig, episode_length: int, iterations: int) -> Agent:
    built.append(config)
    assert env.num_actions is not None
    network, optimizer = Logits(config.network, env.num_actions), optax.adam(config.learning_rate)

    def embed(params, table):
        return network.apply(params, table, method="embed")

    def act(params, embedding, carry, obs, row, key, deterministic):
        logits = network.apply(params, obs, embedding[row])
        return logits.argmax(-1) if deterministic else jax.random.categorical(key, logits)

    def init(key, env_params):
        params_key, episodes_key, key = jax.random.split(key, 3)
        episodes = begin(env, env_params, episodes_key, config.num_envs, episode_length)
        params = network.init(
            params_key, env_params.table, episodes.state.obs, env.row(episodes.state), method="initialise"
        )
        return ReinforceState(params, optimizer.init(params), episodes, key)

    def loss(params, table, steps):
        obs, row, action, gain = steps
        chosen = jax.nn.log_softmax(network.apply(params, obs, embed(params, table)[row]))
        chosen = jnp.take_along_axis(chosen, action[..., None], axis=-1)[..., 0]
        return -(chosen * (gain - gain.mean())).mean()

    def iterate(state, env_params):
        embedding, (key, act_key) = embed(state.params, env_params.table), jax.random.split(state.key)

        def sample(carry, now, key):
            return act(state.params, embedding, carry, now.obs, env.row(now), key, False), carry, ()

        def keep(step):
            ended = step.terminated | step.truncated
            return (step.obs, step.row, step.action), step.reward, ended, step.totals, step.state.metrics

        unrolled = unroll(
            env, env_params, Player(sample), state.episodes, (), act_key,
            config.unroll_length, episode_length, config.discount, keep,
        )  # fmt: skip
        episodes, _, (seen, reward, ended, totals, metrics) = unrolled

        def backwards(gain, now):
            reward, ended = now
            gain = reward + config.discount * jnp.where(ended, 0.0, gain)
            return gain, gain

        _, gain = jax.lax.scan(backwards, jnp.zeros(config.num_envs), (reward, ended), reverse=True)
        value, gradient = jax.value_and_grad(loss)(state.params, env_params.table, (*seen, gain))
        updates, opt_state = optimizer.update(gradient, state.opt_state)
        totals = summed(totals)
        after = ReinforceState(optax.apply_updates(state.params, updates), opt_state, episodes, key)
        return after, Metrics(totals, {"loss": value} | env_scalars(metrics))

    return Agent(init, iterate, embed, act, config.frames_per_iteration)


register_agent("reinforce", ReinforceConfig, make_reinforce)
