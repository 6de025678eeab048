"""Learning by dynamic programming in the world of a single state, which is small enough to be solved.

There a task is its automaton and nothing else, so the value of every action in every row follows from the table (value
iteration), and the network learns them as they are instead of from episodes that it plays. It is another way through
the paper's pre-training: the same world and the same network, without the noise of exploring. Read `make_dp` from top
to bottom.
"""

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import optax
from flax import struct

from t2tl_jax.agents.acting import acting_of
from t2tl_jax.agents.dp_config import DPConfig
from t2tl_jax.agents.row_codes import make_codes
from t2tl_jax.ltl import TaskTable
from t2tl_jax.networks.actor_critic import ActorCritic
from t2tl_jax.registry import register_agent
from t2tl_jax.single_state import SingleState
from t2tl_jax.task_env import TaskEnv, TaskParams
from t2tl_jax.training import few_kernels
from t2tl_jax.training.optimizer import clipped_adam
from t2tl_jax.training.types import Agent, EpisodeTotals, Metrics, Params

PRECISION = 1e-6
"""Value iteration ends when no value changes by more than this."""

TIE = 1e-4
"""Actions whose values differ by no more than this are as good as each other."""


@struct.dataclass
class DPState:
    """Everything that the next iteration depends on."""

    params: Params
    opt_state: optax.OptState
    key: jax.Array


@struct.dataclass
class Solution:
    """The best that can be done in every row."""

    action_value: jax.Array  # float32[rows, P + 1], of making each proposition true for a step, and last, none
    value: jax.Array  # float32[rows], before it is known what is offered; 0 for rows that are decided


def solve(table: TaskTable, offered: int, discount: float | jax.Array) -> Solution:
    """The world of a single state, solved by value iteration.

    Args:
        table: its tasks.
        offered: how many propositions can be chosen at a step, or none of them; 0 for all, one of which has to be.
        discount: discount factor, less than 1.
    """
    count = len(table.propositions)
    letters = table.letter(jnp.eye(count + 1, count, dtype=bool))  # the last one is that of no proposition
    after, reward = table.step_all(letters)  # [rows, P + 1]

    def action_value(value: jax.Array) -> jax.Array:
        return reward + discount * value[after]

    def best(values: jax.Array) -> jax.Array:
        chosen, none = values[:, :count], values[:, count]
        if not offered:
            return chosen.max(axis=-1)
        # Of k that are offered among P, the one of rank i is the best in C(P - i, k - 1) of C(P, k) sets.
        shares = [math.comb(count - rank, offered - 1) / math.comb(count, offered) for rank in range(1, count + 1)]
        descending = -jnp.sort(-chosen, axis=-1)
        return jnp.maximum(descending, none[:, None]) @ jnp.array(shares, jnp.float32)

    def sweep(found: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array]:
        value, _ = found
        better = jnp.where(table.is_open, best(action_value(value)), 0.0)
        return better, jnp.abs(better - value).max()

    start = jnp.zeros(table.num_rows, jnp.float32), jnp.float32(jnp.inf)
    value, _ = jax.lax.while_loop(lambda found: found[1] > PRECISION, sweep, start)
    return Solution(action_value(value), value)


def make_dp(env: TaskEnv, config: DPConfig, episode_length: int, iterations: int) -> Agent:
    """The learner for one seed. `iterations` is the length of the run, which schedules refer to."""
    del episode_length  # nothing is played
    world = env.env
    if not isinstance(world, SingleState):
        raise ValueError(
            f"dynamic programming solves the world of a single state, single_state, and not {type(world).__name__}: "
            "in others, states matter that no table lists; use ppo there, and give it this run as its pre-training"
        )
    offered, count = world.config.offered, len(world.propositions)
    network = ActorCritic(config.network, world.num_actions, discrete=True)
    apply: Callable[..., Any] = network.apply  # Flax declares more results than this call can have
    optimizer = clipped_adam(
        config.learning_rate,
        config.max_gradient_norm,
        iterations * config.updates_per_iteration,
        anneal=config.anneal_learning_rate,
        epsilon=config.adam_epsilon,
        task_encoder_learning_rate=config.task_encoder_learning_rate,
        freeze_task_encoder=config.freezes_task_encoder,
        each=config.gradient_clipping == "each",
    )
    embed, codes = make_codes(
        config.task_encoder,
        config.freezes_task_encoder,
        partial(apply, method="embed"),
        partial(apply, method="embed_rows"),
    )

    def init(key: jax.Array, env_params: TaskParams) -> DPState:
        params_key, key = jax.random.split(key)
        row = env_params.table.initial_row[:1]
        obs = jnp.zeros((1, world.observation_size))
        params = network.init(params_key, env_params.table, obs, row, (), method="initialise")
        return DPState(params, optimizer.init(params), key)

    def offers(key: jax.Array, rows: int) -> tuple[jax.Array, jax.Array]:
        """What is offered in each of some rows, and what is seen of it: bool[rows, actions], float32[rows, O]."""
        if not offered:
            return jnp.ones((rows, count), bool), jnp.zeros((rows, 0))
        some = jnp.broadcast_to(jnp.arange(count) < offered, (rows, count))
        some = jax.random.permutation(key, some, axis=1, independent=True)
        return jnp.concatenate([some, jnp.ones((rows, 1), bool)], axis=1), some.astype(jnp.float32)

    def gradient_step(
        table: TaskTable, known: jax.Array, solution: Solution, carry: tuple[Params, optax.OptState], key: jax.Array
    ) -> tuple[tuple[Params, optax.OptState], dict[str, jax.Array]]:
        params, opt_state = carry
        rows_key, offers_key = jax.random.split(key)
        order = jnp.where(table.is_open, jax.random.uniform(rows_key, (table.num_rows,)), 2.0).argsort()
        rows = order[: config.minibatch_size]  # open ones first
        weight = table.is_open[rows] / jnp.maximum(table.is_open[rows].sum(), 1)
        free, obs = offers(offers_key, len(rows))
        worth = jnp.where(free, solution.action_value[rows, : world.num_actions], -jnp.inf)
        wanted = jax.nn.softmax(worth / config.temperature)

        def loss(params: Params) -> tuple[jax.Array, dict[str, jax.Array]]:
            policy, value = apply(params, obs, codes(params, table, known, rows))
            logits = jax.nn.log_softmax(policy.logits)
            policy_loss = optax.losses.kl_divergence(logits, wanted)
            value_loss = jnp.square(value - solution.value[rows])
            chosen = jnp.take_along_axis(worth, logits.argmax(axis=-1, keepdims=True), axis=-1)[:, 0]
            per_row = {
                "policy_loss": policy_loss,
                "value_loss": value_loss,
                "agreement": (chosen >= worth.max(axis=-1) - TIE).astype(jnp.float32),
            }
            scalars = {name: (weight * of).sum() for name, of in per_row.items()}
            return scalars["policy_loss"] + config.value_coefficient * scalars["value_loss"], scalars

        gradient, scalars = jax.grad(loss, has_aux=True)(params)
        updates, opt_state = optimizer.update(gradient, opt_state, params)
        scalars["gradient_norm"] = few_kernels.global_norm(gradient)
        return (optax.apply_updates(params, updates), opt_state), scalars

    def iterate(state: DPState, env_params: TaskParams) -> tuple[DPState, Metrics]:
        table = env_params.table
        key, updates_key = jax.random.split(state.key)

        # PLAN
        solution = solve(table, offered, config.discount)

        # UPDATE
        known = embed(state.params, table)  # of a small table nobody reads it, and it is not computed
        (params, opt_state), scalars = jax.lax.scan(
            partial(gradient_step, table, known, solution),
            (state.params, state.opt_state),
            jax.random.split(updates_key, config.updates_per_iteration),
        )
        return DPState(params, opt_state, key), Metrics(_no_episodes(), jax.tree.map(jnp.mean, scalars))

    def restart(state: DPState, env_params: TaskParams) -> DPState:
        """Nothing of it speaks of the former tasks."""
        del env_params
        return state

    acting = acting_of(apply)
    return Agent(
        init=init,
        iterate=iterate,
        embed=embed,
        act=acting.act,
        frames_per_iteration=config.frames_per_iteration,
        restart=restart,
        compare=acting.compare,
        value=acting.value,
    )


def _no_episodes() -> EpisodeTotals:
    counts, sums = (jnp.int32(0),) * 5, (jnp.float32(0),) * 4
    return EpisodeTotals(*counts, *sums)


register_agent("dp", DPConfig, make_dp)
