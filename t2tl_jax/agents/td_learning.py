"""What double DQN learns from a batch of transitions: TD targets for every sub-task, and the loss."""

from collections.abc import Callable
from functools import partial
from typing import Any, TypeAlias

import jax
import jax.numpy as jnp
import optax
from flax import struct

from t2tl_jax.agents.dqn_config import DQNConfig
from t2tl_jax.ltl import TaskTable
from t2tl_jax.networks.q_network import QNetwork, QNetworkConfig
from t2tl_jax.networks.windows import Carry, Tokens, newest, without_newest, without_oldest
from t2tl_jax.task_env import Shared
from t2tl_jax.training.types import Params

Embedding: TypeAlias = jax.Array | Callable[[jax.Array], jax.Array]
"""The codes of the table's rows, float32[rows, dim]; or from rows int32[...] to their codes [..., dim], where only
those that learn are encoded."""


@struct.dataclass
class Transition:
    """What replay keeps; the task is not part of it, beside the row that the agent was in."""

    obs: jax.Array  # float32[O]
    action: jax.Array  # int32
    next_obs: jax.Array  # float32[O], of s' before any reset
    row: jax.Array  # int32
    shared: Shared  # the letter of s', and what the environment itself paid and ended
    cut: jax.Array  # bool, ended by the time limit
    steps: Any = ()  # with context: the window that the policy acted on and, in one slot more, this step


@struct.dataclass
class Marked(Transition):
    """Where rows are drawn: a class of its own, so that other replays have the form that they always had on disk."""

    mark: Any = ()  # uint32, of the row's formula, see `learning_rows.py`


def td_target(
    config: DQNConfig,
    table: TaskTable,
    row: jax.Array,
    next_row: jax.Array,
    reward: jax.Array,
    chooser: jax.Array,
    target: jax.Array,
    shared: Shared,
    cut: jax.Array,
    phi: jax.Array | None = None,
) -> jax.Array:
    """What Q should be, float32[B, R], for R rows of every transition.

    row: the rows, int32[B, R] or [R]; next_row, reward: where each row's formula goes and what that pays, [B, R];
    chooser, target: Q at s' that choose the action and value it, float32[B, R, actions]; shared [B]; cut: bool[B]; phi:
    the rows' potential float32[rows] that shapes the reward, or None. What ends has the potential 0, whatever ends it.
    """
    value = jnp.take_along_axis(target, chooser.argmax(axis=-1, keepdims=True), axis=-1)[..., 0]
    ended = (table.verdict[next_row] != 0) | shared.ended[:, None]
    if config.timeout_is_terminal:
        ended = ended | cut[:, None]
    if phi is not None:
        value, reward = value + phi[next_row], reward - phi[row]
    return shared.reward[:, None] + reward + config.discount * jnp.where(ended, 0.0, value)


def td_targets(
    config: DQNConfig,
    table: TaskTable,
    online: jax.Array,
    target: jax.Array,
    shared: Shared,
    cut: jax.Array,
    phi: jax.Array | None = None,
) -> jax.Array:
    """What Q should be in every row for every transition, float32[B, rows].

    online, target: Q of all rows at s' by the two networks, float32[B, rows, actions]; shared [B]; cut bool[B]; phi as
    for `td_target`.
    """
    next_row, reward = (x.T for x in table.step_all(shared.letter))  # [B, rows]
    at_next = partial(jnp.take_along_axis, indices=next_row[..., None], axis=1)  # [B, rows, A], row u reads row u'
    chooser = online if config.double else target
    chooser = chooser if config.printed_argmax else at_next(chooser)
    row = jnp.arange(table.num_rows)
    return td_target(config, table, row, next_row, reward, chooser, at_next(target), shared, cut, phi)


def code_change(table: TaskTable, embedding: jax.Array, target_embedding: jax.Array) -> dict[str, jax.Array]:
    """How far the open rows' codes have moved since the target's copy: RMS, and as a share of their own RMS.

    embedding, target_embedding: float32[rows, dim], of now and of then. Values that are learned for a code hold for the
    one of now only as far as it stays where it was.
    """

    def rms(codes: jax.Array) -> jax.Array:
        return jnp.sqrt(jnp.mean(jnp.square(codes), where=table.is_open[:, None]))

    change = rms(embedding - target_embedding)
    return {"code_change": change, "code_change_relative": change / jnp.maximum(rms(target_embedding), 1e-8)}


def read_once(
    config: QNetworkConfig, network: QNetwork, params: Params, steps: Any
) -> tuple[Carry | Tokens, Carry | Tokens]:
    """The windows at s and at s' for the online network; no gradient flows through what is made of those at s'.

    All steps of the one at s' but the newest are in the one at s too, so that their tokens are made once.

    steps: windows [B, K + 1] whose last slot holds the step from s to s', or `()` without context.
    """
    before, after = without_newest(steps), without_oldest(steps)
    if config.context is None:
        return before, after
    make: Callable[..., Any] = partial(network.apply, method="tokens")
    made = make(params, before)
    fixed, last = jax.lax.stop_gradient((made, make(params, newest(steps))))
    tokens = jnp.concatenate([fixed.tokens[:, 1:], last.tokens], axis=1)
    return made, Tokens(tokens, jnp.concatenate([fixed.valid[:, 1:], last.valid], axis=1), fixed.empty)


def dqn_loss(
    config: DQNConfig,
    network: QNetwork,
    table: TaskTable,
    params: Params,
    embedding: Embedding,
    target_params: Params,
    target_embedding: Embedding,
    batch: Transition,
    phi: jax.Array | None = None,
    rows: jax.Array | None = None,
) -> tuple[jax.Array, dict[str, jax.Array]]:
    """Huber loss of the TD errors, averaged over transitions and over the rows that learn.

    `embedding` is what `params` make of the table's rows, `target_embedding` likewise; `phi` as for `td_target`. `rows`
    int32[B, R] are the rows that learn from each transition, R of them; None for every open one, or for the own one in
    plain DQN. Where every row learns, its values at s' are computed once and looked up by the rows that lead to it.
    """
    apply: Callable[..., Any] = network.apply  # Flax declares more results than this call can have
    before, after = read_once(config.network, network, params, batch.steps)
    target_after = without_oldest(batch.steps)
    here = there = embedding
    target_there = target_embedding
    if rows is None and not config.counterfactual:
        rows = batch.row[:, None]
    if rows is not None:
        next_row, reward = table.step(rows, batch.shared.letter[:, None])  # [B, R]
        here, there = _codes(embedding, jnp.stack([rows, next_row]))  # [B, R, dim]
        target_there = _codes(target_embedding, next_row)

    q = apply(params, batch.obs, here, before, method="every_row")  # [B, R, A]
    # A pass of its own over s', through which no gradient flows: together with s it would be differentiated too.
    fixed = jax.lax.stop_gradient((params, there))
    online = apply(fixed[0], batch.next_obs, fixed[1], after, method="every_row")
    target = apply(target_params, batch.next_obs, target_there, target_after, method="every_row")
    if rows is None:
        goal = td_targets(config, table, online, target, batch.shared, batch.cut, phi)
        learns = compared = jnp.broadcast_to(table.is_open, goal.shape)
    else:
        chooser = online if config.double else target
        if config.printed_argmax:
            theirs = target_params, _codes(target_embedding, rows), target_after
            chosen, codes, window = (params, here, after) if config.double else theirs
            chooser = apply(jax.lax.stop_gradient(chosen), batch.next_obs, codes, window, method="every_row")
        goal = td_target(config, table, rows, next_row, reward, chooser, target, batch.shared, batch.cut, phi)
        learns, compared = jnp.ones_like(goal, bool), table.is_open[next_row]

    # [B, R]; not looked up, since the gradient of that is scattered
    taken = jnp.sum(q, axis=-1, where=jnp.arange(q.shape[-1]) == batch.action[:, None, None])
    error = taken - jax.lax.stop_gradient(goal)
    loss = jnp.mean(optax.losses.huber_loss(error), where=learns)
    scalars = {"q": jnp.mean(taken, where=learns), "td_error": jnp.mean(jnp.abs(error), where=learns)}
    if config.counterfactual:
        # How far the target network's values are behind those of the online one: RMS over all actions at s'.
        lag = jnp.square(online - target).mean(axis=-1)
        scalars["target_lag"] = jnp.sqrt(jnp.mean(lag, where=compared))
    return loss, {"loss": loss, **scalars}


def _codes(embedding: Embedding, rows: jax.Array) -> jax.Array:
    return embedding(rows) if callable(embedding) else embedding[rows]
