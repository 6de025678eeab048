"""A learner and an environment small enough to compile in an instant, for everything around the training.

`python fake_learner.py ARGUMENTS` is `python -m experiments.run` with them; FAKE_SECONDS slows each iteration down,
FAKE_COMPILE_SECONDS and FAKE_EVALUATION_SECONDS the tracing and the evaluation.
"""

import os
import sys
import time

import jax
import jax.numpy as jnp
from fake_agent import FRAMES_PER_ITERATION, make_agent
from flax import struct
from t2tl_jax.runs.build import Experiment

from experiments import run
from experiments.configs import Config

SUCCESS, VIOLATION = 0.6, 0.3  # of an episode's first step, if the action is 1


@struct.dataclass
class World:
    """State of the environment: its own randomness and what the last step led to."""

    key: jax.Array
    row: jax.Array
    obs: jax.Array
    reward: jax.Array
    done: jax.Array


class FakeEnv:
    """Decided at its first step: success, violation, or never, with known probabilities."""

    def reset(self, rng: jax.Array) -> World:
        return World(rng, jnp.int32(2), jnp.zeros(3), jnp.float32(0), jnp.float32(0))

    def step(self, state: World, action: jax.Array) -> World:
        chance = jax.random.uniform(state.key)
        verdict = jnp.where(chance < SUCCESS, 1.0, jnp.where(chance < SUCCESS + VIOLATION, -1.0, 0.0)) * (action > 0.5)
        return state.replace(reward=verdict, done=jnp.abs(verdict), obs=state.obs + 1)

    def row(self, state: World) -> jax.Array:
        return state.row

    def verdict(self, state: World) -> jax.Array:
        return jnp.sign(state.reward)


def build(config: Config) -> Experiment:
    if delay := float(os.environ.get("FAKE_COMPILE_SECONDS", "0")):
        print("building", flush=True)
        time.sleep(delay)
    return Experiment(FakeEnv(), make_agent(), -(-config.frames // FRAMES_PER_ITERATION))


if __name__ == "__main__":
    sys.exit(run.main(build=build))
