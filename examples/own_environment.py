"""An environment of your own, in which several propositions hold at once: overlapping discs in the plane.

    python examples/own_environment.py 100000

It is an ordinary JAX object. Registered, it works on the command line too, with its fields as flags:

    python -m experiments.run --import examples.own_environment --config discs --env.overlap 0.4
"""

import argparse
from dataclasses import dataclass

import jax
import jax.numpy as jnp

import t2tl_jax
from t2tl_jax import Config, EnvConfig, LabelledEnv, NetworkConfig, OneHotConfig, PPOConfig
from t2tl_jax.env import State

RADIUS, SPEED = 0.4, 0.2


@dataclass(frozen=True)
class DiscsConfig(EnvConfig):
    """Two discs side by side."""

    overlap: float = 0.3
    """How far one reaches into the other."""


class Discs(LabelledEnv):
    """A point in [-1, 1]^2 that an action moves; it may be in the left disc, in the right one, or in both."""

    propositions = ("Left", "Right")
    alphabet = "every_subset"  # "at_most_one" would promise that two never hold at the same time
    num_actions = None  # actions are float[action_size] in [-1, 1]
    action_size = observation_size = 2
    backend = "none"  # the name of the physics

    def __init__(self, config: DiscsConfig = DiscsConfig()) -> None:
        self.centres = jnp.array([[-1.0, 0.0], [1.0, 0.0]]) * (RADIUS - config.overlap / 2)

    def reset(self, rng, params=None) -> State:
        """Somewhere; all that a reset must restore lies in `pipeline_state`."""
        return self._at(jax.random.uniform(rng, (2,), minval=-1.0))

    def step(self, state, action, params=None) -> State:
        """Move; the task's reward and the end of its episode are not the environment's affair."""
        return self._at(jnp.clip(state.pipeline_state + SPEED * jnp.clip(action, -1, 1), -1, 1))

    def labels(self, state) -> jax.Array:
        """bool[2], in the order of `propositions`."""
        return jnp.linalg.norm(state.pipeline_state - self.centres, axis=-1) < RADIUS

    def _at(self, place: jax.Array) -> State:
        none, metrics = jnp.float32(0), {"distance": jnp.linalg.norm(place)}  # a metric of its own: env_distance
        return State(place, place, none, none, metrics)


t2tl_jax.register_env("discs", DiscsConfig, Discs)

NETWORK = NetworkConfig(task_encoder=OneHotConfig(4), env_layers=(32,), actor_layers=(32,), critic_layers=(32,))
LEARNER = PPOConfig(network=NETWORK, num_envs=64, unroll_length=32, minibatch_size=512, discount=0.95)
TASK = "F(Left & Right & F(Left & !Right & F(Right & !Left)))"
t2tl_jax.register_config("discs", Config(env=DiscsConfig(), task=TASK, learner=LEARNER, episode_length=50), "two discs")


def main(frames: int = 100_000) -> t2tl_jax.Result:
    """Train by the registered name."""
    run = t2tl_jax.train("discs", frames=frames)
    for name in ("success_rate", "length", "env_distance"):
        print(f"{name:13} {run.metrics[name][0, 0]:.3f} -> {run.metrics[name][0, -1]:.3f}")
    return run


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("frames", type=int, nargs="?", default=100_000)
    main(**vars(parser.parse_args()))
