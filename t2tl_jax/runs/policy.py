"""A trained policy that acts: a pytree of parameters and codes of tasks, so that jit and vmap work on it."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from t2tl_jax.errors import UserError
from t2tl_jax.ltl import Limits, TaskTable, compile_named
from t2tl_jax.training.types import Agent, AgentCarry, Params


@struct.dataclass
class Policy:
    """The policy of one seed on the tasks of one table.

    ``policy(obs, row)`` gives an action. A policy that remembers its episode also needs the carry: begin with
    ``carry = policy.begin()``, pass ``carry=carry``, and after every step go on with
    ``carry = policy.remember(carry, obs, action, reward)``.
    """

    params: Params
    """Parameters of the network."""
    embedding: Any
    """``float32[rows, dim]``: the code of every row of the table; with a plan, those of all ways."""
    table: TaskTable
    """The tasks, by row; `TaskTable.step` says how a row goes on."""
    agent: Agent = struct.field(pytree_node=False)
    """The learner's functions."""
    observation_size: int = struct.field(pytree_node=False)
    """Numbers of an observation."""

    def begin(self) -> AgentCarry:
        """What the policy remembers of one environment's episode at its start; () for a policy without memory."""
        return self.agent.begin()

    def remember(self, carry: AgentCarry, obs: jax.Array, action: jax.Array, reward: jax.Array) -> AgentCarry:
        """The carry after a step in which `action` was taken on `obs` and `reward` followed."""
        return self.agent.remember(self.params, carry, obs, action, reward)

    def decide(self, carry: AgentCarry, obs: jax.Array, row: jax.Array | int) -> AgentCarry:
        """The carry of a policy that plans, with the way that it chooses on `obs` for a row of the table.

        Ask for it before every action, and pass it on to `remember`, and the policy keeps to its choice; a call without
        chooses anew each time. Other policies decide nothing.
        """
        obs, row = self._checked(obs, row)
        return self.agent.decide(self.params, self.embedding, carry, obs, row)

    def row(self, task: str) -> int:
        """The row of the table that has the meaning of `task`: a formula, or the name of one.

        Raises:
            UserError: if no row has; the message lists them.
            LTLError: for a formula with mistakes.
        """
        limits = Limits(max_rows=max(Limits.max_rows, self.table.num_rows))
        wanted = compile_named(task, self.table.propositions, self.table.alphabet, limits=limits)
        text = wanted.text(int(wanted.initial_row[0]))
        texts = [self.table.text(row) for row in range(self.table.num_rows)]
        if text not in texts:
            raise UserError(
                f"{task} is no row of this policy's table; its rows: {'; '.join(texts[2:])}. "
                "For another task ask the run for a policy: run.policy(seed, task=...)"
            )
        return texts.index(text)

    def _checked(self, obs: Any, task: Any) -> tuple[jax.Array, jax.Array]:
        """Observations, and the row of the table that each is acted on by."""
        try:
            obs = jnp.asarray(obs)
        except (TypeError, ValueError) as error:
            raise UserError(f"an observation is an array of numbers, got {obs!r:.100}") from error
        if obs.shape[-1:] != (self.observation_size,):
            raise UserError(
                f"an observation has {self.observation_size} numbers along its last axis, got one of the shape "
                f"{obs.shape}"
            )
        row = self.row(task) if isinstance(task, str) else task
        is_number = isinstance(row, int | np.number | np.ndarray | jax.Array)
        if not is_number or not jnp.issubdtype(jnp.result_type(row), jnp.integer):
            raise UserError(f"a task is a row of the table, by its number, or a formula in words, got {task!r:.100}")
        if isinstance(row, int | np.integer) and not 0 <= row < self.table.num_rows:
            raise UserError(f"the table has rows 0 to {self.table.num_rows - 1}, got {row}")
        return obs, jnp.broadcast_to(jnp.asarray(row, jnp.int32), obs.shape[:-1])

    def __call__(
        self, obs: jax.Array, task: jax.Array | int | str, carry: AgentCarry = None, key: jax.Array | None = None
    ) -> jax.Array:
        """The action: the mode of the policy's distribution, or a draw from it if there is a `key`.

        Args:
            obs: float32[..., O].
            task: which row of the table is to be carried out, int32[...], or a formula in words (not inside jit).
            carry: what the policy remembers, with the leading axes of `obs`; needed only by a policy with memory.
            key: a random key, for a sampled action.

        Raises:
            UserError: if a policy with memory gets no carry, for an unknown task, or for observations of another size.
        """
        obs, row = self._checked(obs, task)
        if carry is None:
            if jax.tree.leaves(self.begin()):
                raise UserError(
                    "this policy remembers its episode: pass carry=policy.begin() at the start, and go on with "
                    "carry = policy.remember(carry, obs, action, reward) after every step"
                )
            carry = ()
        deterministic = key is None
        key = jax.random.key(0) if key is None else key
        carry = self.agent.decide(self.params, self.embedding, carry, obs, row)
        return self.agent.act(self.params, self.embedding, carry, obs, row, key, deterministic)


def seed_slice(tree: Any, index: int) -> Any:
    """The part of one seed, at `index`, of a tree with leading axis [seeds]."""
    return jax.tree.map(lambda leaf: leaf[index], tree)
