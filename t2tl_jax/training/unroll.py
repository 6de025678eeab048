"""The episode loop: act, step, keep the last observation, reset. Training, evaluation and pictures all run this one.

N environments go side by side, each from episode to episode: one that ends is reset in the same step. What a step led
to is handed out before that reset, so that a time-out can be bootstrapped and the last state be drawn. Truncation by
the time limit is not termination.
"""

import dataclasses
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from flax import struct

from t2tl_jax.env import State
from t2tl_jax.ltl import TaskTable
from t2tl_jax.task_env import Shared, TaskEnv, TaskParams
from t2tl_jax.training.types import Agent, AgentCarry, EpisodeTotals, Params, TaskTotals, repeated

FAILED = "physics_failed"
"""Among the metrics of a step's state, where the environment says it: whether its physics failed, bool[N]."""


@struct.dataclass
class Episode:
    """Episodes under way in N environments; all arrays lead with [N]."""

    state: State  # of the TaskEnv
    elapsed: jax.Array  # int32, steps since the reset
    limit: jax.Array  # int32, the episode is cut when elapsed reaches it
    total: jax.Array  # float32, undiscounted return so far
    discounted: jax.Array  # float32, discounted return so far
    turn: jax.Array  # int32, number of the episode in its environment; -2**31 comes behind 2**31 - 1
    task: jax.Array  # int32, which of the table's tasks; -1 for a start in another row, which enters no totals


@struct.dataclass
class Step:
    """One step of N environments, before any reset; all arrays lead with [N]. What is not kept costs nothing."""

    obs: jax.Array  # float32[N, O], what the policy saw
    row: jax.Array  # int32, of the task then
    carry: AgentCarry  # what the policy knew then
    action: jax.Array  # [N, A], or int32[N]
    extras: Any  # what the policy says about its choice, such as the action's density
    state: State  # s', with `FAILED` among its metrics
    shared: Shared  # what every other row of the table can be progressed and paid by
    terminated: jax.Array  # bool, a verdict was reached, or the environment ended the episode
    truncated: jax.Array  # bool, cut by the time limit and not terminated
    elapsed: jax.Array  # int32, steps of the episode with this one
    total: jax.Array  # float32, undiscounted return of the episode with this step
    discounted: jax.Array  # float32, likewise its discounted return
    turn: jax.Array  # int32, number of the episode
    task: jax.Array  # int32, of the episode
    totals: EpisodeTotals  # of an episode that just ended, else zeros

    @property
    def reward(self) -> jax.Array:
        """float32[N], that of the task and the environment's own."""
        return self.state.reward


class Player(NamedTuple):
    """Who acts.

    act(carry, state, key) -> (action, carry, extras): for a batch of states of the `TaskEnv`
    observe(carry, state, action, reward, ended) -> carry to go on with: `action` on `state` led to `reward`, and where
        the episode `ended` bool[N] the next one begins
    """

    act: Callable[[AgentCarry, State, jax.Array], tuple[jax.Array, AgentCarry, Any]]
    observe: Callable[[AgentCarry, State, jax.Array, jax.Array, jax.Array], AgentCarry] = (
        lambda carry, state, action, reward, ended: carry
    )


def player_of(agent: Agent, env: TaskEnv, params: Params, embedding: jax.Array, deterministic: bool) -> Player:
    """A trained agent as it is evaluated: its parameters stay, and its carry begins anew with every episode."""

    def act(carry: AgentCarry, state: State, key: jax.Array) -> tuple[jax.Array, AgentCarry, tuple[()]]:
        obs, row = state.obs, env.row(state)
        carry = agent.decide(params, embedding, carry, obs, row)
        return agent.act(params, embedding, carry, obs, row, key, deterministic), carry, ()

    def observe(carry: AgentCarry, state: State, action: jax.Array, reward: jax.Array, ended: jax.Array) -> AgentCarry:
        after = agent.remember(params, carry, state.obs, action, reward)
        return where(ended, repeated(agent.begin(), len(ended)), after)

    return Player(act, observe)


def begin(
    env: TaskEnv, env_params: TaskParams, key: jax.Array, count: int, limit: int, staggered: bool = False
) -> Episode:
    """Reset `count` environments: fresh layouts, tasks by turns, `limit` steps to go.

    With `staggered` the first episodes are cut at random lengths, so that parallel environments do not reset in step.
    """
    reset_key, limit_key = jax.random.split(key)
    limits = jnp.full(count, limit, jnp.int32)
    if staggered:
        limits = jax.random.randint(limit_key, (count,), 1, limit + 1)
    keys = jax.random.split(reset_key, count)
    return jax.vmap(partial(_fresh, env, env_params))(keys, limits, jnp.arange(count))


def advance(
    env: TaskEnv,
    env_params: TaskParams,
    policy: Player,
    episodes: Episode,
    carry: AgentCarry,
    key: jax.Array,
    limit: int,
    discount: float | jax.Array,
) -> tuple[Episode, AgentCarry, Step]:
    """One step of all environments; finished episodes are replaced by new ones of `limit` steps."""
    act_key, reset_key = jax.random.split(key)
    before = episodes.state
    with jax.named_scope("policy"):
        action, chosen, extras = policy.act(carry, before, act_key)
    with jax.named_scope("environment"):
        after, shared = jax.vmap(partial(env.step_for_all, params=env_params))(before, action)
        failed = jax.vmap(env.failed)(after, shared)

    moved = dataclasses.replace(
        episodes,
        state=after,
        elapsed=episodes.elapsed + 1,
        total=episodes.total + after.reward,
        discounted=discounted(episodes.discounted, after.reward, episodes.elapsed, discount),
    )
    terminated = after.done > 0
    truncated = ~terminated & (moved.elapsed >= episodes.limit)
    ended = terminated | truncated
    step = Step(
        obs=before.obs,
        row=env.row(before),
        carry=carry,
        action=action,
        extras=extras,
        state=after if failed is None else after.replace(metrics={**after.metrics, FAILED: failed}),
        shared=shared,
        terminated=terminated,
        truncated=truncated,
        elapsed=moved.elapsed,
        total=moved.total,
        discounted=moved.discounted,
        turn=moved.turn,
        task=moved.task,
        totals=_totals(moved, env.verdict(after, env_params), ended, truncated),
    )
    keys = jax.random.split(reset_key, len(ended))
    limits = jnp.full(len(ended), limit, jnp.int32)
    with jax.named_scope("policy"):
        carry = policy.observe(chosen, before, action, after.reward, ended)
    with jax.named_scope("reset"):
        fresh = jax.vmap(partial(_fresh, env, env_params))(keys, limits, episodes.turn + 1)
        return where(ended, fresh, moved), carry, step


def unroll(
    env: TaskEnv,
    env_params: TaskParams,
    policy: Player,
    episodes: Episode,
    carry: AgentCarry,
    key: jax.Array,
    length: int,
    limit: int,
    discount: float | jax.Array,
    keep: Callable[[Step], Any] = lambda step: (),
) -> tuple[Episode, AgentCarry, Any]:
    """`length` steps of N environments, from episode to episode.

    Args:
        env: the environment.
        env_params: its parameters, the same for all N.
        policy: who acts.
        episodes: where the environments stand, from `begin` or from the last call.
        carry: what the policy takes from step to step.
        key: of actions and resets.
        length: steps in all.
        limit: steps after which new episodes are cut.
        discount: gamma of the discounted return.
        keep: what is kept of a step.

    Returns:
        Where the environments stand, the carry, and what was kept, with a leading axis [length].
    """

    def one_step(before: tuple[Episode, AgentCarry], key: jax.Array) -> tuple[tuple[Episode, AgentCarry], Any]:
        *after, step = advance(env, env_params, policy, *before, key, limit, discount)
        return tuple(after), keep(step)

    (episodes, carry), kept = jax.lax.scan(one_step, (episodes, carry), jax.random.split(key, length))
    return episodes, carry, kept


def discounted(so_far: jax.Array, reward: jax.Array, elapsed: jax.Array, discount: float | jax.Array) -> jax.Array:
    """The discounted return of an episode, sum of discount^t r_t, with one more reward after `elapsed` steps."""
    return so_far + discount ** elapsed.astype(jnp.float32) * reward


def where(chosen: jax.Array, new: Any, old: Any) -> Any:
    """`new` for the environments that are `chosen` bool[N], `old` for the others; trees with leading axes [N]."""

    def choose(new: jax.Array, old: jax.Array) -> jax.Array:
        return jnp.where(chosen.reshape(-1, *[1] * (old.ndim - 1)), new, old)

    return jax.tree.map(choose, new, old)


def summed(totals: EpisodeTotals) -> EpisodeTotals:
    """Totals of any number of steps and environments as one."""
    return jax.tree.map(jnp.sum, totals)


def env_scalars(metrics: dict[str, jax.Array]) -> dict[str, jax.Array]:
    """The environment's own metrics of any number of steps and environments: their means, named `env_...`.

    Raises:
        ValueError: for a metric called `termination_rate`, whose name would be that of a column of every run.
    """
    if "termination_rate" in metrics:
        raise ValueError("call the environment's metric something else: env_termination_rate is a column of every run")
    return {f"env_{name}": jnp.mean(values, dtype=jnp.float32) for name, values in metrics.items()}


def by_task(ended: jax.Array, task: jax.Array, score: jax.Array, num_tasks: int) -> dict[str, jax.Array]:
    """Episodes ended, mean and best return per step of each task, named `episodes_1`, `score_1`, `best_score_1`, ...

    A task of which no episode ended scores 0.

    Args:
        ended: int32[...], 1 where an episode that counts came to its end; of any number of steps and environments.
        task: int32[...], which task the episode is of.
        score: float32[...], its return per step.
        num_tasks: tasks of the table.
    """
    ended = ended.reshape(-1, 1) * jax.nn.one_hot(task.reshape(-1), num_tasks)
    scores = score.reshape(-1, 1) * ended
    episodes = ended.sum(axis=0)
    columns = {
        "episodes": episodes,
        "score": scores.sum(axis=0) / jnp.maximum(episodes, 1),
        "best_score": scores.max(0),
    }
    return {f"{name}_{k + 1}": values[k] for name, values in columns.items() for k in range(num_tasks)}


def task_totals(step: Step, table: TaskTable) -> TaskTotals | None:
    """The episodes that ended in a step of N environments by task; None unless pools take turns in the table."""
    if table.starts is None:
        return None
    before = ~table.starts[step.row]  # an open row that is not of the present pool

    def counted(ended: jax.Array) -> jax.Array:
        # A start in another row has no task, and counts as 0 episodes.
        return jnp.zeros((2, table.num_tasks), jnp.int32).at[before.astype(jnp.int32), step.task].add(ended)

    return TaskTotals(episodes=counted(step.totals.episodes), successes=counted(step.totals.successes))


def _fresh(env: TaskEnv, env_params: TaskParams, key: jax.Array, limit: jax.Array, turn: jax.Array) -> Episode:
    """The start of one episode; unbatched."""
    state = env.reset(key, env_params, turn)
    return Episode(
        state=state,
        elapsed=jnp.int32(0),
        limit=limit,
        total=jnp.float32(0),
        discounted=jnp.float32(0),
        turn=turn,
        task=env.task(state, env_params),
    )


def _totals(episode: Episode, verdict: jax.Array, ended: jax.Array, truncated: jax.Array) -> EpisodeTotals:
    """What an episode that `ended` counts as; zeros for one under way. A verdict counts, whoever ended the episode."""
    counted = (ended & (episode.task >= 0)).astype(jnp.int32)
    success, length = counted * (verdict > 0), episode.elapsed.astype(jnp.float32)
    return EpisodeTotals(
        episodes=counted,
        successes=success,
        violations=counted * (verdict < 0),
        timeouts=counted * truncated,
        env_terminations=counted * (~truncated & (verdict == 0)),
        discounted_return=counted * episode.discounted,
        total_reward=counted * episode.total,
        length=counted * length,
        success_length=success * length,
    )
