"""A learner and an environment small enough to compile in an instant, for everything around the training.

They are registered as a user's own would be: ``--config fake``, in other processes with ``--import tests.fake_learner``
before it. There FAKE_SECONDS slows each iteration down, FAKE_COMPILE_SECONDS and FAKE_EVALUATION_SECONDS the
preparation and the evaluation. FAKE_NUMBERS is how many parameters it has that stay as they are, none by default.
"""

import os
import time
from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp

import experiments.configs  # noqa: F401, so that lists of what is registered begin with what is shipped
from t2tl_jax.env import EnvConfig, LabelledEnv, State
from t2tl_jax.registry import register_agent, register_config, register_env
from t2tl_jax.runs.config import Config, RunConfig, SelectionConfig
from t2tl_jax.single_state import SingleStateConfig
from tests.fake_agent import FakeConfig, make_agent, uniform

SUCCESS, VIOLATION = 0.6, 0.3  # of an episode's first step, if the action is 1


@dataclass(frozen=True)
class FakeEnvConfig(EnvConfig):
    """The fake environment has no settings."""


class FakeEnv(LabelledEnv):
    """Its first step makes Red true, or Black, or neither for good, with known probabilities."""

    propositions = ("Black", "White", "Red", "Yellow")
    alphabet = "at_most_one"
    num_actions = None
    action_size = 1
    observation_size = 3
    backend = "none"

    def reset(self, rng: jax.Array, params=None) -> State:
        return State((rng, jnp.int32(-1)), jnp.zeros(3), jnp.float32(0), jnp.float32(0))

    def step(self, state: State, action: jax.Array, params=None) -> State:
        key, _ = state.pipeline_state
        chance = uniform(key)
        label = jnp.where(chance < SUCCESS, 2, jnp.where(chance < SUCCESS + VIOLATION, 0, -1))
        label = jnp.where(action > 0.5, label, -1).astype(jnp.int32)
        return state.replace(pipeline_state=(key, label), obs=state.obs + 1)

    def labels(self, state: State) -> jax.Array:
        return jnp.arange(len(self.propositions)) == state.pipeline_state[1]


def make_env(config: FakeEnvConfig) -> FakeEnv:
    if delay := float(os.environ.get("FAKE_COMPILE_SECONDS", "0")):
        print("building", flush=True)
        time.sleep(delay)
    return FakeEnv()


register_env("fake", FakeEnvConfig, make_env)
register_agent("fake", FakeConfig, make_agent)

CONFIG = Config(
    env=FakeEnvConfig(),
    task="!Black U Red",
    learner=FakeConfig(),
    frames=200,
    episode_length=5,
    selection=SelectionConfig(points=0),
    run=RunConfig(compilation_cache="", progress=False),
)
register_config("fake", CONFIG, "the fake learner in the fake environment")

PRETRAINING = replace(CONFIG, env=SingleStateConfig(), task="Eventually_1_5_1_4", frames=200)
register_config("pretrain_fake", PRETRAINING, "the fake learner in the world with one state; see fake_pretraining.py")
