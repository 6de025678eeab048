"""Which tokens of a formula a Transformer attends to, and which of them the policy depends on.

Attention says where the encoder looks, not what its output depends on. So both are measured: the weights (the paper's
reading of its agent), and what changes in policy and value when a token is taken away.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct
from scipy import stats

from t2tl_jax.evaluation.episodes import Environment
from t2tl_jax.ltl import TaskTable
from t2tl_jax.ltl.tokens import token_names
from t2tl_jax.networks.task_encoders import TransformerTaskEncoder, attention_weights
from t2tl_jax.training.types import Agent, Params, PolicyMemory, repeated

Queries = Literal["all", "root"]
"""Who attends: every real token (their mean), or the formula's first token only."""


@dataclass(frozen=True)
class Attention:
    """The attention that each token of one formula receives."""

    tokens: tuple[str, ...]
    """What the n tokens say, in prefix order; no padding."""
    weights: np.ndarray
    """``float64[heads, n]``; every head sums to 1."""

    @property
    def total(self) -> np.ndarray:
        """Sum over the heads, ``float64[n]``; sums to the number of heads, so 8 / n is what chance gives 8 heads."""
        return self.weights.sum(0)

    @property
    def strongest(self) -> int:
        """The paper's rule, token* = argmax over the tokens of the summed weights; the first one of equals."""
        return int(self.total.argmax())


@dataclass(frozen=True)
class Removal:
    """What happens to the decisions when a token is taken away: means over observations, one entry per token."""

    policy: np.ndarray
    """``float64[n]``: change of the policy, in the unit of ``Agent.compare``."""
    value: np.ndarray
    """``float64[n]``: absolute change of the value."""
    observations: int
    """How many observations the means are over."""
    met: bool
    """Whether they were met in this row; if not, they are those that episodes begin with."""

    def agreement(self, attention: Attention, of: Literal["policy", "value"] = "policy") -> float | None:
        """Spearman's rank correlation of total attention and effect; None where one of them is constant."""
        effect = self.policy if of == "policy" else self.value
        if min(np.ptp(effect), np.ptp(attention.total)) == 0:
            return None
        return float(stats.spearmanr(attention.total, effect).statistic)


@struct.dataclass
class Met:
    """One step of each of E episodes: drawn from those that it spent in a row, or its first one if there are none."""

    obs: jax.Array  # float32[E, O]
    memory: PolicyMemory  # of the policy before that step
    steps: jax.Array  # int32[E], steps that the episode spent in the row


def attention_received(
    encoder: TransformerTaskEncoder,
    params: Params,
    table: TaskTable,
    row: int,
    layers: Sequence[int] | None = None,
    queries: Queries = "all",
) -> Attention:
    """The attention weights of one formula, by head and receiving token.

    A weight is averaged over ``layers`` and over the queries. Only real tokens count, as queries and as receivers: what
    an encoder without mask gives to padding is left out, and the rest scaled to a sum of 1 for every query.

    Args:
        encoder: the agent's task encoder.
        params: its parameters, ``agent_params["params"]["task_encoder"]``.
        table: any table over the propositions that the encoder was trained with.
        row: which formula of it.
        layers: numbers of the layers, from 0; all by default, as in the paper's rule.
        queries: "all" or "root". The published figure does not say which; in it every head sums to 1, as here.
    """
    count, known = encoder.config.layers, range(encoder.config.layers)
    chosen = list(known if layers is None else layers)
    if not chosen or not set(chosen) <= set(known):
        raise ValueError(f"the encoder has layers 0 to {count - 1}, got layers={tuple(chosen)}")
    if queries not in ("all", "root"):
        raise ValueError(f'queries are "all" or "root", got {queries!r}')
    row = _checked(table, row)
    length = int(table.mask[row].sum())
    weights = np.asarray(jax.jit(attention_weights, static_argnums=0)(encoder, params, _one_row(table, row)))
    weights = weights[chosen, 0, :, : (length if queries == "all" else 1), :length].astype(np.float64)
    weights /= weights.sum(-1, keepdims=True)
    tokens = token_names(np.asarray(table.tokens[row])[:length].tolist(), table.propositions)
    return Attention(tokens, weights.mean((0, 2)))


def codes_without_tokens(encoder: TransformerTaskEncoder, params: Params, table: TaskTable, row: int) -> jax.Array:
    """Codes of a formula as it is, then without each of its n tokens in turn: float32[1 + n, output].

    A token is taken away by masking it: no other token attends to it, and the pooling leaves it out. The others keep
    their positions. An encoder that reads padding goes on reading it.
    """
    row = _checked(table, row)
    length = int(table.mask[row].sum())
    present = table.mask[row] if encoder.config.masked else jnp.ones_like(table.mask[row])
    without = jnp.concatenate([jnp.zeros((1, present.size), bool), jnp.eye(length, present.size, dtype=bool)])
    altered = replace(
        table, tokens=jnp.broadcast_to(table.tokens[row], without.shape), mask=present[None, :] & ~without
    )
    masking = TransformerTaskEncoder(replace(encoder.config, masked=True))  # the same parameters
    codes = jax.jit(masking.apply)({"params": params}, altered)
    assert isinstance(codes, jax.Array)
    return codes


def meet(
    env: Environment, agent: Agent, params: Params, key: jax.Array, row: int, episodes: int, episode_length: int
) -> Met:
    """Play episodes with the sampled policy and keep one step of each, drawn from all steps that it spent in `row`.

    One step only: successive observations are nearly equal, and every episode counts the same. Pure; jit it.
    """
    embedding = agent.embed(params)
    reset_key, act_key = jax.random.split(key)
    state = jax.vmap(env.reset)(jax.random.split(reset_key, episodes))
    memory = repeated(agent.begin(), episodes)
    first = Met(state.obs, memory, jnp.zeros(episodes, jnp.int32))

    def under_way(carry: tuple) -> jax.Array:
        _, _, alive, _, step = carry
        return (step < episode_length) & alive.any()

    def advance(carry: tuple) -> tuple:
        state, memory, alive, met, step = carry
        act, draw = jax.random.split(jax.random.fold_in(act_key, step))
        rows = jax.vmap(env.row)(state)
        here = alive & (rows == row)
        steps = met.steps + here
        # The k-th step here takes the place of the one kept so far with probability 1 / k: in the end all are equal.
        taken = here & (jax.random.uniform(draw, (episodes,)) * steps < 1.0)

        def keep(new: jax.Array, old: jax.Array) -> jax.Array:
            return jnp.where(taken.reshape(-1, *[1] * (old.ndim - 1)), new, old)

        obs, kept = jax.tree.map(keep, (state.obs, memory), (met.obs, met.memory))
        action = agent.act(params, embedding, memory, state.obs, rows, act, False)
        moved = jax.vmap(env.step)(state, action)
        memory = agent.remember(params, memory, state.obs, action, moved.reward)
        return moved, memory, alive & (moved.done == 0), Met(obs, kept, steps), step + 1

    start = (state, memory, jnp.ones(episodes, bool), first, jnp.int32(0))
    return jax.lax.while_loop(under_way, advance, start)[3]


def removal_effects(agent: Agent, params: Params, codes: jax.Array, met: Met) -> Removal:
    """What each token does to the decisions on observations that the agent meets.

    Args:
        agent: offers ``compare``.
        params: of the agent.
        codes: of ``codes_without_tokens``.
        met: of ``meet``. Episodes that never were in the row are left out, unless none was.
    """
    if agent.compare is None:
        raise ValueError("this learner cannot compare the decisions that two codes of a task lead to")
    compare = agent.compare
    chosen = np.asarray(met.steps) > 0
    found = bool(chosen.any())
    index = np.flatnonzero(chosen | (not found))
    seen = jax.tree.map(lambda x: x[index], (met.obs, met.memory))

    def effects(params: Params, seen: tuple[jax.Array, PolicyMemory], codes: jax.Array) -> tuple[jax.Array, jax.Array]:
        obs, memory = seen

        def one_token(code: jax.Array) -> tuple[jax.Array, jax.Array]:
            policy, value = compare(params, memory, obs, codes[0], code)
            return policy.mean(), jnp.abs(value).mean()

        return jax.lax.map(one_token, codes[1:])  # one after the other: a formula can have very many tokens

    policy, value = jax.device_get(jax.jit(effects)(params, seen, codes))
    return Removal(policy.astype(np.float64), value.astype(np.float64), len(index), found)


def _one_row(table: TaskTable, row: int) -> TaskTable:
    return replace(table, tokens=table.tokens[row : row + 1], mask=table.mask[row : row + 1])


def _checked(table: TaskTable, row: int) -> int:
    if not 0 <= row < table.num_rows:
        raise ValueError(f"the table has rows 0 to {table.num_rows - 1}, got row={row}")
    return row
