"""A learner and an environment small enough to compile in an instant, for everything around the training.

`python fake_learner.py ARGUMENTS` is `python -m experiments.run` with them; FAKE_SECONDS slows each iteration down,
FAKE_COMPILE_SECONDS and FAKE_EVALUATION_SECONDS the tracing and the evaluation.
"""

import os
import sys
import time
from typing import Any

import jax
import jax.numpy as jnp
import optax
from flax import struct

from experiments import run
from experiments.build import Experiment
from experiments.configs import Config
from t2tl_jax.agent import Agent, EpisodeTotals, Metrics

FRAMES_PER_ITERATION = 100
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


@struct.dataclass
class FakeState:
    params: Any
    opt_state: Any
    key: jax.Array
    iteration: jax.Array
    best_params: Any
    best_score: jax.Array


def make_agent() -> Agent:
    optimizer = optax.chain(optax.clip_by_global_norm(1.0), optax.adam(1e-2))

    def init(key: jax.Array) -> FakeState:
        key, params_key = jax.random.split(key)
        params = {"params": {"w": jax.random.normal(params_key, (4, 3)), "task_encoder": {"b": jnp.zeros(3)}}}
        # The iteration is weakly typed on purpose: it must not lead to a second compilation.
        return FakeState(params, optimizer.init(params), key, jnp.asarray(0), params, jnp.float32(-jnp.inf))

    def iterate(state: FakeState) -> tuple[FakeState, Metrics]:
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
            discounted_return=successes * 0.9 - value,
            length=10.0 * episodes,
            success_length=7.0 * successes,
        )
        better = -value > state.best_score
        new = FakeState(
            params=optax.apply_updates(state.params, updates),
            opt_state=opt_state,
            key=key,
            iteration=state.iteration + 1,
            best_params=jax.tree.map(lambda a, b: jnp.where(better, a, b), state.params, state.best_params),
            best_score=jnp.maximum(-value, state.best_score),
        )
        return new, Metrics(totals, {"loss": value, "gradient_norm": optax.tree.norm(gradient)})

    def embed(params: Any) -> jax.Array:
        if delay := float(os.environ.get("FAKE_EVALUATION_SECONDS", "0")):
            time.sleep(delay)
        return params["params"]["w"]

    def act(params: Any, embedding: Any, memory: Any, obs: jax.Array, row: jax.Array, key: jax.Array, deterministic):
        del params, embedding, memory, row
        if deterministic:
            return jnp.ones(obs.shape[:-1])
        return jax.random.bernoulli(key, 0.5, obs.shape[:-1]).astype(jnp.float32)

    return Agent(init, iterate, embed, act, FRAMES_PER_ITERATION)


def build(config: Config) -> Experiment:
    if delay := float(os.environ.get("FAKE_COMPILE_SECONDS", "0")):
        print("building", flush=True)
        time.sleep(delay)
    return Experiment(FakeEnv(), make_agent(), -(-config.frames // FRAMES_PER_ITERATION))


if __name__ == "__main__":
    sys.exit(run.main(build=build))
