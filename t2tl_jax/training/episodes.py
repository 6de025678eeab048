"""Episodes with a time limit, one after another: truncation is not termination, and the last observation is kept."""

import dataclasses

import jax
import jax.numpy as jnp
from brax.envs.base import State
from flax import struct

from t2tl_jax.task_env import Shared, TaskEnv
from t2tl_jax.training.types import EpisodeTotals


@struct.dataclass
class Episode:
    """An episode under way; all fields unbatched."""

    state: State  # of the TaskEnv
    elapsed: jax.Array  # int32, steps since the reset
    limit: jax.Array  # int32, the episode is cut when elapsed reaches it
    total: jax.Array  # float32, undiscounted return so far
    turn: jax.Array  # int32, number of the episode in its environment
    task: jax.Array  # int32, which of the table's tasks; -1 for a start in another row, which enters no totals


@struct.dataclass
class Outcome:
    """What one step led to. `next_obs` and `next_row` are those of s', before any reset."""

    next_obs: jax.Array  # float32[O]
    next_row: jax.Array  # int32
    shared: Shared  # what every other row of the table can be progressed and paid by
    reward: jax.Array  # float32
    terminated: jax.Array  # bool, a verdict was reached, or the environment ended the episode (its physics failed)
    truncated: jax.Array  # bool, cut by the time limit without a verdict
    task: jax.Array  # int32, of the episode
    score: jax.Array  # float32, return per step of the episode that just ended, else 0
    totals: EpisodeTotals  # of the episode that just ended, else zeros


def begin(env: TaskEnv, key: jax.Array, limit: jax.Array | int, turn: jax.Array | int = 0) -> Episode:
    """Reset the environment: fresh layout, the task whose turn it is, `limit` steps to go."""
    state = env.reset(key, jnp.asarray(turn, jnp.int32))
    is_first_row = env.table.initial_row == env.row(state)
    return Episode(
        state=state,
        elapsed=jnp.int32(0),
        limit=jnp.asarray(limit, jnp.int32),
        total=jnp.float32(0),
        turn=jnp.asarray(turn, jnp.int32),
        task=jnp.where(is_first_row.any(), is_first_row.argmax(), -1).astype(jnp.int32),
    )


def advance(
    env: TaskEnv, episode: Episode, action: jax.Array, key: jax.Array, limit: int, discount: float
) -> tuple[Episode, Outcome]:
    """One step; a finished episode is replaced by a new one of `limit` steps. Unbatched: vmap it."""
    state, shared = env.step_for_all(episode.state, action)
    elapsed = episode.elapsed + 1
    total = episode.total + state.reward
    terminated = state.done > 0
    truncated = ~terminated & (elapsed >= episode.limit)
    done = terminated | truncated

    verdict = env.table.verdict[env.row(state)]
    ended = (done & (episode.task >= 0)).astype(jnp.int32)
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
        shared=shared,
        reward=state.reward,
        terminated=terminated,
        truncated=truncated,
        task=episode.task,
        score=ended * total / length,
        totals=totals,
    )
    under_way = dataclasses.replace(episode, state=state, elapsed=elapsed, total=total)
    fresh = begin(env, key, limit, episode.turn + 1)
    return jax.tree.map(lambda new, old: jnp.where(done, new, old), fresh, under_way), outcome


def by_task(totals: EpisodeTotals, task: jax.Array, score: jax.Array, num_tasks: int) -> dict[str, jax.Array]:
    """Episodes ended, mean and best return per step of each task, named `episodes_1`, `score_1`, `best_score_1`, ...

    All of any number of steps and environments, `[...]`, as in `Outcome`. A task of which no episode ended scores 0.
    """
    ended = totals.episodes.reshape(-1, 1) * jax.nn.one_hot(task.reshape(-1), num_tasks)
    scores = score.reshape(-1, 1) * ended
    episodes = ended.sum(axis=0)
    columns = {
        "episodes": episodes,
        "score": scores.sum(axis=0) / jnp.maximum(episodes, 1),
        "best_score": scores.max(0),
    }
    return {f"{name}_{k + 1}": values[k] for name, values in columns.items() for k in range(num_tasks)}
