"""Train on a task in temporal logic, evaluate, store, load and play: the library from Python in one page.

    python examples/quickstart.py --frames 60000 --folder runs/quickstart

The world is `SingleState`: action k makes the k-th colour true. The task is to reach red, then white, never black.
"""

import argparse
import tempfile
from pathlib import Path

import jax
import jax.numpy as jnp

import t2tl_jax
from t2tl_jax import NetworkConfig, PPOConfig, TransformerConfig

TASK = "!Black U (Red & (!Black U White))"


def main(frames: int = 60_000, folder: str | None = None) -> t2tl_jax.Result:
    """Train for so many steps, in a folder that must not hold anything yet; by default in one that goes away again."""
    encoder = TransformerConfig(layers=1, width=32, heads=2, feed_forward=64)
    network = NetworkConfig(task_encoder=encoder, env_layers=(), actor_layers=(32,), critic_layers=(32,))
    learner = PPOConfig(
        network=network, num_envs=64, unroll_length=16, minibatch_size=256, discount=0.9, learning_rate=3e-3
    )
    env = t2tl_jax.make_env("SingleState")

    with tempfile.TemporaryDirectory() as elsewhere:
        where = Path(folder or elsewhere) / "run"
        run = t2tl_jax.train(env, TASK, learner, seeds=2, frames=frames, episode_length=20, folder=where)
        print("success rate in training, first and last iteration:", run.metrics["success_rate"][:, [0, -1]].tolist())
        print("success rate when evaluated:", run.evaluate(episodes=50)["deterministic"].success_rate.text())
        run = t2tl_jax.load(where, env=env)  # from disk: the same result

    # A saved run is played in three lines: load, policy, act. Here the task is progressed, too.
    policy = run.policy(seed=0)
    print("the policy on the whole task:", env.propositions[int(policy(jnp.zeros(0), TASK))])
    state, row = env.reset(jax.random.key(0)), policy.row(TASK)
    for _ in range(5):
        action = policy(state.obs, row)
        state = env.step(state, action)
        row, reward = policy.table.step(row, policy.table.letter(env.labels(state)))
        print(f"did {env.propositions[int(action)]}, reward {reward:+.0f}, left to do: {policy.table.text(int(row))}")
        if policy.table.verdict[row]:
            break
    return run


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=60_000)
    parser.add_argument("--folder")
    main(**vars(parser.parse_args()))
