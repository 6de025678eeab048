"""Which tokens of a formula a Transformer attends to, and which of them the policy depends on.

Attention says where the encoder looks, not what its output depends on. So both are measured: the weights (the paper's
reading of its agent), and what changes in policy and value when a token is taken away. The second needs no attention:
it reads every encoder of tokens, the graph network too.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np
from flax import linen as nn
from flax import struct
from scipy import stats

from t2tl_jax.env import State
from t2tl_jax.evaluation.episodes import CHUNK
from t2tl_jax.ltl import TaskTable
from t2tl_jax.ltl.tokens import token_names
from t2tl_jax.networks.task_encoders import TransformerTaskEncoder, attention_weights
from t2tl_jax.task_env import TaskEnv, TaskParams
from t2tl_jax.training.types import Agent, AgentCarry, Params, repeated
from t2tl_jax.training.unroll import Episode, Player, begin, player_of, unroll, where

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

    @property
    def strongest(self) -> int | None:
        """The token without which the policy moves most; the first one of equals, None where none does anything."""
        return int(self.policy.argmax()) if self.policy.max() > 0 else None

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
    carry: AgentCarry  # of the policy before that step
    steps: jax.Array  # int32[E], steps that the episode spent in the row


@struct.dataclass
class Meeting:
    """Episodes under way: the agent's carry, what was met so far, and whether an episode is still the first one."""

    carry: AgentCarry  # leading axis [E]
    met: Met
    alive: jax.Array  # bool[E]


def attention_received(
    encoder: nn.Module,
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
        encoder: the agent's task encoder, a Transformer.
        params: its parameters, ``agent_params["params"]["task_encoder"]``.
        table: any table over the propositions that the encoder was trained with.
        row: which formula of it.
        layers: numbers of the layers, from 0; all by default, as in the paper's rule.
        queries: "all" or "root". The published figure does not say which; in it every head sums to 1, as here.

    Raises:
        ValueError: for an encoder without attention, or layers, queries or a row that there are not.
    """
    if not isinstance(encoder, TransformerTaskEncoder):
        raise ValueError(f"a Transformer has attention, {type(encoder).__name__} has none; removal reads it too")
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


def has_attention(encoder: nn.Module) -> bool:
    """Whether `attention_received` can read this task encoder; removal needs no attention."""
    return isinstance(encoder, TransformerTaskEncoder)


def codes_without_tokens(encoder: nn.Module, params: Params, table: TaskTable, row: int) -> jax.Array:
    """Codes of a formula as it is, then without each of its n tokens in turn: float32[1 + n, code_size].

    A token is taken away by masking it. In a Transformer no other token attends to it, the pooling leaves it out, and
    the others keep their positions; one that reads padding goes on reading it. In the graph network the node is gone,
    and with it all that hangs on it. A recurrent network reads the formula without it.

    Args:
        encoder: any task encoder that reads tokens.
        params: its parameters, ``agent_params["params"]["task_encoder"]``.
        table: any table over the propositions that the encoder was trained with.
        row: which formula of it.

    Raises:
        ValueError: for an encoder that does not care what is masked.
    """
    row = _checked(table, row)
    length = int(table.mask[row].sum())
    present = np.asarray(table.mask[row])
    if isinstance(encoder, TransformerTaskEncoder) and not encoder.config.masked:
        present = np.ones_like(present)
        encoder = TransformerTaskEncoder(replace(encoder.config, masked=True))  # the same parameters
    # Of as many tokens as any formula of the table can have, so that one program serves all rows.
    without = np.concatenate([np.zeros((1, present.size), bool), np.eye(present.size, dtype=bool)])
    altered = replace(
        table,
        tokens=jnp.broadcast_to(table.tokens[row], without.shape),
        mask=jnp.asarray(present & ~without),
    )
    codes = _codes(encoder, params, altered)[: 1 + length]
    if (codes == codes[0]).all():
        raise ValueError(
            f"{type(encoder).__name__} gives the same code whatever token is masked: it does not read the table's mask "
            "(or not its tokens), so nothing can be taken away from it"
        )
    return codes


@partial(jax.jit, static_argnums=0)
def _codes(encoder: nn.Module, params: Params, table: TaskTable) -> jax.Array:
    codes = encoder.apply({"params": params}, table)
    assert isinstance(codes, jax.Array)
    return codes


def meet(
    env: TaskEnv,
    agent: Agent,
    params: Params,
    env_params: TaskParams,
    key: jax.Array,
    row: int,
    episodes: int,
    episode_length: int,
) -> Met:
    """Play episodes with the sampled policy and keep one step of each, drawn from all steps that it spent in `row`.

    One step only: successive observations are nearly equal, and every episode counts the same. Pure; jit it.
    """
    sampled = player_of(agent, env, params, agent.embed(params, env_params.table), deterministic=False)
    reset_key, key = jax.random.split(key)
    first = begin(env, env_params, reset_key, episodes, episode_length)
    carry = repeated(agent.begin(), episodes)

    # What was met goes along with the agent's carry: it is there when the agent acts, and knows when an episode ends.
    def act(loop: Meeting, state: State, key: jax.Array) -> tuple[jax.Array, Meeting, tuple[()]]:
        draw, key = jax.random.split(key)
        here = loop.alive & (env.row(state) == row)
        steps = loop.met.steps + here
        # The k-th step here takes the place of the one kept so far with probability 1 / k: in the end all are equal.
        taken = here & (jax.random.uniform(draw, (episodes,)) * steps < 1.0)
        obs, kept = where(taken, (state.obs, loop.carry), (loop.met.obs, loop.met.carry))
        action, carry, extras = sampled.act(loop.carry, state, key)
        return action, Meeting(carry, Met(obs, kept, steps), loop.alive), extras

    def observe(loop: Meeting, state: State, action: jax.Array, reward: jax.Array, ended: jax.Array) -> Meeting:
        return Meeting(sampled.observe(loop.carry, state, action, reward, ended), loop.met, loop.alive & ~ended)

    def go_on(loop: tuple[Episode, Meeting, jax.Array]) -> tuple[Episode, Meeting, jax.Array]:
        under_way, meeting, chunk = loop
        under_way, meeting, _ = unroll(
            env,
            env_params,
            Player(act, observe),
            under_way,
            meeting,
            jax.random.fold_in(key, chunk),
            min(CHUNK, episode_length),
            episode_length,
            discount=1.0,
        )
        return under_way, meeting, chunk + 1

    nothing = Met(first.state.obs, carry, jnp.zeros(episodes, jnp.int32))
    start = (first, Meeting(carry, nothing, jnp.ones(episodes, bool)), jnp.int32(0))
    return jax.lax.while_loop(lambda loop: loop[1].alive.any(), go_on, start)[1].met


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
    chosen = np.asarray(met.steps) > 0
    found = bool(chosen.any())
    index = np.flatnonzero(chosen | (not found))
    seen = jax.tree.map(lambda x: x[index], (met.obs, met.carry))
    policy, value = jax.device_get(_effects(agent.compare, params, seen, codes))
    return Removal(policy.astype(np.float64), value.astype(np.float64), len(index), found)


@partial(jax.jit, static_argnums=0)
def _effects(
    compare: Callable[..., tuple[jax.Array, jax.Array]],
    params: Params,
    seen: tuple[jax.Array, AgentCarry],
    codes: jax.Array,
) -> tuple[jax.Array, jax.Array]:
    """Mean change of policy and value by each of codes[1:] in place of codes[0]: float32[n] each."""
    obs, carry = seen

    def one_token(code: jax.Array) -> tuple[jax.Array, jax.Array]:
        policy, value = compare(params, carry, obs, codes[0], code)
        return policy.mean(), jnp.abs(value).mean()

    return jax.lax.map(one_token, codes[1:])  # one after the other: a formula can have very many tokens


def _one_row(table: TaskTable, row: int) -> TaskTable:
    return replace(table, tokens=table.tokens[row : row + 1], mask=table.mask[row : row + 1])


def _checked(table: TaskTable, row: int) -> int:
    if not 0 <= row < table.num_rows:
        raise ValueError(f"the table has rows 0 to {table.num_rows - 1}, got row={row}")
    return row
