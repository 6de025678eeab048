"""A task encoder of your own: a convolution over a formula's tokens, in the library's PPO.

    python examples/own_encoder.py 60000

An encoder maps the task table to one vector a row. Registered, it works on the command line, too:

    python -m experiments.run --import examples.own_encoder --config pretrain_zone \\
        --learner.network.task-encoder convolution --learner.network.task-encoder.width 64
"""

import argparse
from dataclasses import dataclass

import jax
import jax.numpy as jnp
from flax import linen as nn

import t2tl_jax
from t2tl_jax import NetworkConfig, PPOConfig, TaskEncoderConfig, TaskTable


@dataclass(frozen=True)
class ConvolutionConfig(TaskEncoderConfig):
    """Sizes of the convolution."""

    width: int = 32
    """Size of a token's vector and of the code."""
    window: int = 3
    """Tokens that are read together."""

    @property
    def code_size(self) -> int:
        """Numbers in the code of a task."""
        return self.width


class Convolution(nn.Module):
    """Reads neighbouring tokens together, and keeps the strongest answer of every feature."""

    config: ConvolutionConfig

    @nn.compact
    def __call__(self, table: TaskTable) -> jax.Array:
        """float32[rows, width], from the tokens int32[rows, length] and their mask bool[rows, length]."""
        mask = table.mask[..., None]
        tokens = nn.Embed(table.vocabulary_size, self.config.width, name="tokens")(table.tokens)
        features = nn.Conv(self.config.width, (self.config.window,), name="read")(tokens * mask)
        return jnp.tanh(jnp.where(mask, features, -jnp.inf).max(axis=-2))  # padding says nothing


t2tl_jax.register_task_encoder("convolution", ConvolutionConfig, Convolution)


def main(frames: int = 60_000) -> t2tl_jax.Result:
    """Train on one task, and look at how another one is read that was never seen."""
    network = NetworkConfig(task_encoder=ConvolutionConfig(), env_layers=(), actor_layers=(32,), critic_layers=(32,))
    learner = PPOConfig(network=network, num_envs=64, unroll_length=16, minibatch_size=256, learning_rate=3e-3)
    env = t2tl_jax.make_env("SingleState")
    run = t2tl_jax.train(env, "F(Red & F White)", learner, frames=frames, episode_length=20)
    print("success rate:", run.metrics["success_rate"][0, [0, -1]], "steps:", run.metrics["length"][0, [0, -1]])
    policy = run.policy(task="F(White & F Red)")
    for row in range(2, policy.table.num_rows):
        print(f"{policy.table.text(row):20} -> {env.propositions[int(policy(jnp.zeros(0), row))]}")
    return run


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("frames", type=int, nargs="?", default=60_000)
    main(**vars(parser.parse_args()))
