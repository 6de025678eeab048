"""The TL-MDP: a labelled environment times a task table.

One step: act, read the labels of s', progress the task row, reward, done on a verdict. The reward of formulas is the
row's verdict, +1 / -1 / 0; reward machines pay by transition.
The row is part of `pipeline_state`, so every auto-reset that restores the pipeline state restores the task with it.
"""

import jax
import jax.numpy as jnp
from brax.envs.base import Env, State
from flax import struct

from t2tl_jax.env import LabelledEnv
from t2tl_jax.ltl import TaskTable


@struct.dataclass
class TaskState:
    """Pipeline state of a `TaskEnv`: the environment's own, and the formula that is left to satisfy."""

    env: struct.PyTreeNode  # the wrapped environment's pipeline state
    row: jax.Array  # int32 scalar, row of the task table


@struct.dataclass
class Shared:
    """What a step led to whatever the task is: with the table it is a transition of every row."""

    letter: jax.Array  # int32, the labels of s'
    reward: jax.Array  # float32, the environment's own
    ended: jax.Array  # bool, the environment ended the episode


class TaskEnv(Env):
    """An environment that rewards the agent for satisfying a formula (brax interface, unbatched, no time limit).

    `simultaneous` is the share of episodes that start in a random open row of the table instead of a task's first row:
    the on-policy form of the paper's learning on the extended set Psi of progressed sub-tasks.
    """

    def __init__(self, env: LabelledEnv, table: TaskTable, simultaneous: float = 0.0) -> None:
        """Combine `env` and `table`; ValueError when they do not speak of the same propositions."""
        if tuple(env.propositions) != tuple(table.propositions):
            raise ValueError(
                f"the table was compiled for propositions {table.propositions}, the environment offers "
                f"{env.propositions}; compile it with compile_tasks(..., env.propositions, env.alphabet)"
            )
        if env.alphabet == "every_subset" and table.alphabet == "at_most_one":
            raise ValueError(
                "the environment can make several propositions true at once, the table is exact only for at most one; "
                "compile it with alphabet='every_subset'"
            )
        if not 0.0 <= simultaneous <= 1.0:
            raise ValueError(f"simultaneous is a share of episodes, expected 0 to 1, got {simultaneous}")
        self.env = env
        self.table = table
        self.simultaneous = simultaneous

    def with_table(self, table: TaskTable) -> "TaskEnv":
        """The same environment with other tasks, which may be arrays of a traced function."""
        return TaskEnv(self.env, table, self.simultaneous)

    def reset(self, rng: jax.Array, turn: jax.Array | None = None) -> State:
        """A fresh layout and one of the table's tasks; the initial state's labels are not used.

        The task is drawn uniformly, or is number `turn` (int32 scalar) of those that take turns.
        """
        env_key, task_key, row_key = jax.random.split(rng, 3)
        tasks = self.table.initial_row
        row = jax.random.choice(task_key, tasks) if turn is None else tasks[turn % len(tasks)]
        if self.simultaneous > 0.0:
            share_key, row_key = jax.random.split(row_key)
            is_open = (self.table.verdict == 0).astype(jnp.float32)
            random_row = jax.random.categorical(row_key, jnp.log(is_open))
            row = jnp.where(jax.random.uniform(share_key) < self.simultaneous, random_row, row)
        return self.reset_to_row(env_key, row)

    def reset_to_row(self, rng: jax.Array, row: jax.Array) -> State:
        """Start an episode of a given row (int32 scalar)."""
        state = self.env.reset(rng)
        return state.replace(pipeline_state=TaskState(env=state.pipeline_state, row=jnp.asarray(row, jnp.int32)))

    def step(self, state: State, action: jax.Array) -> State:
        """Act, label, progress, reward (equation 2 of the paper, with the labels of s')."""
        return self.step_for_all(state, action)[0]

    def step_for_all(self, state: State, action: jax.Array) -> tuple[State, Shared]:
        """As `step`, with what the step would have been to an agent with another task."""
        env_state = self.env.step(state.replace(pipeline_state=state.pipeline_state.env), action)
        shared = Shared(
            letter=self.table.letter(self.env.labels(env_state)), reward=env_state.reward, ended=env_state.done > 0
        )
        row, reward = self.table.step(state.pipeline_state.row, shared.letter)
        after = env_state.replace(
            pipeline_state=TaskState(env=env_state.pipeline_state, row=row),
            reward=env_state.reward + reward,
            done=jnp.maximum(env_state.done, jnp.abs(self.table.verdict[row]).astype(jnp.float32)),
        )
        return after, shared

    def row(self, state: State) -> jax.Array:
        """The table row of the formula that is left: int32 scalar."""
        return state.pipeline_state.row

    def verdict(self, state: State) -> jax.Array:
        """+1 the task is carried out, -1 violated, 0 open: int8 scalar."""
        return self.table.verdict[state.pipeline_state.row]

    @property
    def observation_size(self) -> int:
        """Size of the environment's observation (the row is not part of it)."""
        return self.env.observation_size

    @property
    def action_size(self) -> int:
        """Size of a continuous action."""
        return self.env.action_size

    @property
    def num_actions(self) -> int | None:
        """Number of discrete actions, None when actions are continuous."""
        return self.env.num_actions

    @property
    def backend(self) -> str:
        """Name of the physics."""
        return self.env.backend
