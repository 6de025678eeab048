"""A policy that chooses how to go on: among the ways that its task leaves open, the one that its critic values most.

An exact look-ahead tells of the shortest way to true, counted in letters. On a map another way may be nearer, or the
only one. So the code of every way is made ahead (`ltl/ways.py`), the critic is asked for the value of each in the
present state, and the policy acts as if there were no other way than the best one.
"""

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from t2tl_jax.errors import UserError
from t2tl_jax.ltl import TaskTable
from t2tl_jax.ltl.ways import with_ways
from t2tl_jax.networks.task_encoder import TaskEncoderConfig
from t2tl_jax.training.types import Agent, AgentCarry, Params

MOST_WAYS = 8
"""Ways of a row that are looked at; of more, those from which true is nearest."""

MARGIN = 0.1
"""By how much another way must be worth more than the one that was chosen, where success is worth 1."""

NOWHERE = np.int32(-1)
"""No row."""


@struct.dataclass
class WaysAhead:
    """What a planning policy knows of a table."""

    codes: jax.Array  # float32[rows + ways, dim]
    whose: jax.Array  # int32[rows, K], the rows of the ways of each row


@struct.dataclass
class Plan:
    """What a planning policy takes from step to step of an episode."""

    carry: AgentCarry  # the policy's own
    row: jax.Array  # int32, the row that was decided about
    way: jax.Array  # int32, the row of the way that was decided on


def planning(agent: Agent, reader: TaskEncoderConfig | None, most: int = MOST_WAYS, margin: float = MARGIN) -> Agent:
    """The same learner, whose policy plans: `embed` makes the codes of all ways, and `decide` chooses among them.

    A choice stands until the row changes, or another way is worth more by the margin: values that are nearly equal
    change places from step to step, and who follows them goes to and fro. Where a row has one way only, the action is
    the policy's own, bit for bit.

    Args:
        agent: the learner.
        reader: configuration of its task encoder.
        most: ways of a row that are looked at.
        margin: by how much more another way must be worth.

    Raises:
        UserError: for a learner without a critic, or a task encoder that reads no transitions.
    """
    if agent.value is None:
        raise UserError("a plan needs a critic, and this learner offers none (Agent.value); leave plan at none")
    if reader is None or not reader.reads_transitions:
        raise UserError(
            "a plan needs codes that are read off the table's transitions, such as lookahead, roles or automaton; "
            f"a code of {type(reader).__name__} is the same for all ways. Leave plan at none"
        )
    value = agent.value

    def embed(params: Params, table: TaskTable) -> WaysAhead:
        longer, whose = with_ways(table, reader.letters_told(table), most)
        return WaysAhead(agent.embed(params, longer), whose)

    def values(params: Params, ahead: WaysAhead, plan: Plan, obs: jax.Array, row: jax.Array) -> jax.Array:
        """Of every way, [..., K]."""
        of_way = jax.vmap(lambda way: value(params, ahead.codes, plan.carry, obs, way), in_axes=-1, out_axes=-1)
        return of_way(ahead.whose[row])

    def begin() -> Plan:
        return Plan(agent.begin(), jnp.int32(NOWHERE), jnp.int32(NOWHERE))

    def decide(params: Params, ahead: WaysAhead, plan: Plan, obs: jax.Array, row: jax.Array) -> Plan:
        ways, worth = ahead.whose[row], values(params, ahead, plan, obs, row)
        best = worth.argmax(axis=-1, keepdims=True)
        is_kept = (ways == plan.way[..., None]) & (plan.row == row)[..., None]
        kept = jnp.where(is_kept, worth, -jnp.inf).max(axis=-1)
        way = jnp.take_along_axis(ways, best, axis=-1)[..., 0]
        return Plan(plan.carry, row, jnp.where(worth.max(axis=-1) > kept + margin, way, plan.way))

    def act(
        params: Params,
        ahead: WaysAhead,
        plan: Plan,
        obs: jax.Array,
        row: jax.Array,
        key: jax.Array,
        deterministic: bool,
    ) -> jax.Array:
        way = jnp.where(plan.row == row, plan.way, row)
        return agent.act(params, ahead.codes, plan.carry, obs, way, key, deterministic)

    def remember(params: Params, plan: Plan, obs: jax.Array, action: jax.Array, reward: jax.Array) -> Plan:
        return Plan(agent.remember(params, plan.carry, obs, action, reward), plan.row, plan.way)

    def best_value(params: Params, ahead: WaysAhead, plan: Plan, obs: jax.Array, row: jax.Array) -> jax.Array:
        return values(params, ahead, plan, obs, row).max(axis=-1)

    given = agent.given
    return agent._replace(
        begin=begin,
        embed=embed,
        decide=decide,
        act=act,
        remember=remember,
        value=best_value,
        given=None if given is None else lambda env_params: planning(given(env_params), reader, most, margin),
    )
