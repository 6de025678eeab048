"""Episodes with a time limit, one after another: truncation is not termination, and the last observation is kept."""

import dataclasses

import jax
import jax.numpy as jnp
from brax.envs.base import State
from flax import struct

from t2tl_jax.agent import EpisodeTotals
from t2tl_jax.task_env import TaskEnv


@struct.dataclass
class Episode:
    """An episode under way; all fields unbatched."""

    state: State  # of the TaskEnv
    elapsed: jax.Array  # int32, steps since the reset
    limit: jax.Array  # int32, the episode is cut when elapsed reaches it
    total: jax.Array  # float32, undiscounted return so far
    counted: jax.Array  # bool, started at a task's first row: only these enter the totals


@struct.dataclass
class Outcome:
    """What one step led to. `next_obs` and `next_row` are those of s', before any reset."""

    next_obs: jax.Array  # float32[O]
    next_row: jax.Array  # int32
    letter: jax.Array  # int32, the labels of s', from which any other row of the table can be progressed
    reward: jax.Array  # float32
    terminated: jax.Array  # bool, a verdict was reached (or the physics failed)
    truncated: jax.Array  # bool, cut by the time limit without a verdict
    totals: EpisodeTotals  # of the episode that just ended, else zeros


def begin(env: TaskEnv, key: jax.Array, limit: jax.Array | int) -> Episode:
    """Reset the environment: fresh layout, fresh task, `limit` steps to go."""
    state = env.reset(key)
    return Episode(
        state=state,
        elapsed=jnp.int32(0),
        limit=jnp.asarray(limit, jnp.int32),
        total=jnp.float32(0),
        counted=jnp.any(env.table.initial_row == env.row(state)),
    )


def advance(
    env: TaskEnv, episode: Episode, action: jax.Array, key: jax.Array, limit: int, discount: float
) -> tuple[Episode, Outcome]:
    """One step; a finished episode is replaced by a new one of `limit` steps. Unbatched: vmap it."""
    state = env.step(episode.state, action)
    elapsed = episode.elapsed + 1
    total = episode.total + state.reward
    terminated = state.done > 0
    truncated = ~terminated & (elapsed >= episode.limit)
    done = terminated | truncated

    verdict = env.table.verdict[env.row(state)]
    ended = (done & episode.counted).astype(jnp.int32)
    length = elapsed.astype(jnp.float32)
    success = ended * (verdict > 0)
    totals = EpisodeTotals(
        episodes=ended,
        successes=success,
        violations=ended * (verdict < 0),
        timeouts=ended * truncated,
        discounted_return=ended * total * discount ** (length - 1),
        length=ended * length,
        success_length=success * length,
    )
    outcome = Outcome(
        next_obs=state.obs,
        next_row=env.row(state),
        letter=env.letter(state),
        reward=state.reward,
        terminated=terminated,
        truncated=truncated,
        totals=totals,
    )
    under_way = dataclasses.replace(episode, state=state, elapsed=elapsed, total=total)
    fresh = begin(env, key, limit)
    return jax.tree.map(lambda new, old: jnp.where(done, new, old), fresh, under_way), outcome
