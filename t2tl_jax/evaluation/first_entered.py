"""Where a policy goes first: which proposition becomes true first in an episode."""

import jax
import jax.numpy as jnp
import numpy as np

from t2tl_jax.evaluation.episodes import CHUNK
from t2tl_jax.task_env import TaskEnv, TaskParams
from t2tl_jax.training.types import Agent, AgentCarry, Params, repeated
from t2tl_jax.training.unroll import Episode, Step, begin, player_of, unroll


def first_entered(
    env: TaskEnv,
    agent: Agent,
    params: Params,
    env_params: TaskParams,
    key: jax.Array,
    episodes: int,
    episode_length: int,
) -> jax.Array:
    """Number of the proposition that is the first to hold in each episode: int32[episodes]; -1 where none ever does.

    Played with the sampled policy. What holds before the first step does not count; of several at once, the first in
    the environment's order does. Pure; jit it.
    """
    sampled = player_of(agent, env, params, agent.embed(params, env_params.table), deterministic=False)
    reset_key, key = jax.random.split(key)

    def seen(step: Step) -> tuple[jax.Array, jax.Array]:
        inner = step.state.replace(pipeline_state=step.state.pipeline_state.env)
        labels = jax.vmap(env.env.labels)(inner)
        entered = jnp.where(labels.any(-1), labels.argmax(-1).astype(jnp.int32), -1)
        return entered, step.terminated | step.truncated

    def go_on(
        loop: tuple[Episode, AgentCarry, jax.Array, jax.Array, jax.Array],
    ) -> tuple[Episode, AgentCarry, jax.Array, jax.Array, jax.Array]:
        under_way, carry, found, alive, chunk = loop
        key_of_chunk, length = jax.random.fold_in(key, chunk), min(CHUNK, episode_length)
        under_way, carry, (entered, ended) = unroll(
            env, env_params, sampled, under_way, carry, key_of_chunk, length, episode_length, discount=1.0, keep=seen
        )

        def one_step(
            state: tuple[jax.Array, jax.Array], step: tuple[jax.Array, jax.Array]
        ) -> tuple[tuple[jax.Array, jax.Array], None]:
            found, alive = state
            return (jnp.where(alive & (found < 0), step[0], found), alive & ~step[1]), None

        (found, alive), _ = jax.lax.scan(one_step, (found, alive), (entered, ended))
        return under_way, carry, found, alive, chunk + 1

    start = (
        begin(env, env_params, reset_key, episodes, episode_length),
        repeated(agent.begin(), episodes),
        jnp.full(episodes, -1, jnp.int32),
        jnp.ones(episodes, bool),
        jnp.int32(0),
    )
    return jax.lax.while_loop(lambda loop: (loop[3] & (loop[2] < 0)).any(), go_on, start)[2]


def shares(first: np.ndarray, propositions: tuple[str, ...]) -> dict[str, float]:
    """Share of episodes by what they entered first, and under "none" that of those which entered nothing."""
    return {
        **{name: float((first == k).mean()) for k, name in enumerate(propositions)},
        "none": float((first < 0).mean()),
    }
