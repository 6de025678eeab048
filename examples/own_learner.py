"""A learner of your own: REINFORCE as a plain loop over the library's parts, a task environment, its table, `unroll`.

    python examples/own_learner.py 40000

What such a loop is made of, as functions `init`, `iterate`, `embed` and `act`, is a `t2tl_jax.Agent`; `register_agent`
gives one a name, and `train`, checkpoints and the command line know it: tests/extension/somebody/learner.py.
"""

import argparse
from functools import partial

import jax
import jax.numpy as jnp
import optax
from flax import linen as nn

import t2tl_jax
from t2tl_jax.training import unroll
from t2tl_jax.training.advantages import generalised_advantages

ENVS, STEPS, LIMIT, DISCOUNT = 64, 16, 20, 0.9


class Net(nn.Module):
    """Logits of the actions from an observation and the row of what is left to do."""

    rows: int
    actions: int

    @nn.compact
    def __call__(self, obs: jax.Array, row: jax.Array) -> jax.Array:
        """obs [..., O], row int32[...] -> [..., actions]."""
        x = jnp.concatenate([obs, jax.nn.one_hot(row, self.rows)], axis=-1)
        return nn.Dense(self.actions)(nn.tanh(nn.Dense(32)(x)))


def main(frames: int = 40_000) -> list[float]:
    """Train for so many steps, or up to an iteration more, and return the success rate of every iteration."""
    iterations = -(-frames // (ENVS * STEPS))
    world = t2tl_jax.make_env("SingleState")
    table = t2tl_jax.compile_tasks("F(Red & F White) & (!Black U White)", world.propositions, world.alphabet)
    env = t2tl_jax.TaskEnv(world, table)
    env_params, key = env.make_params(seed=0), jax.random.key(0)
    net, optimizer = Net(table.num_rows, env.num_actions), optax.adam(1e-2)

    def act(params, carry, state, key):
        return jax.random.categorical(key, net.apply(params, state.obs, env.row(state))), carry, ()

    def loss(params, step, gain):
        surprise = optax.softmax_cross_entropy_with_integer_labels(net.apply(params, step.obs, step.row), step.action)
        return (surprise * (gain - gain.mean())).mean()

    @jax.jit
    def iterate(params, opt_state, episodes, key):
        policy = unroll.Player(partial(act, params))
        episodes, _, steps = unroll.unroll(
            env, env_params, policy, episodes, (), key, STEPS, LIMIT, DISCOUNT, keep=lambda step: step
        )  # every array of `steps` leads with [STEPS, ENVS]
        none = jnp.zeros_like(steps.reward)  # without a critic and with lambda 1, the advantage is the return to come
        gain = generalised_advantages(steps.reward, none, none, steps.terminated, steps.truncated, DISCOUNT, 1.0)
        updates, opt_state = optimizer.update(jax.grad(loss)(params, steps, gain), opt_state)
        return optax.apply_updates(params, updates), opt_state, episodes, unroll.summed(steps.totals)

    episodes = unroll.begin(env, env_params, key, ENVS, LIMIT)
    params = net.init(key, episodes.state.obs, env.row(episodes.state))
    opt_state, rates = optimizer.init(params), []
    for iteration in range(iterations):
        key, now = jax.random.split(key)
        params, opt_state, episodes, totals = iterate(params, opt_state, episodes, now)
        rates.append(float(totals.successes / jnp.maximum(totals.episodes, 1)))
        if (iteration + 1) * 10 // iterations > iteration * 10 // iterations:  # ten lines in all
            print(f"iteration {iteration + 1:5}  success {rates[-1]:.2f}  steps {totals.length / totals.episodes:.1f}")
    return rates


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("frames", type=int, nargs="?", default=40_000)
    main(**vars(parser.parse_args()))
