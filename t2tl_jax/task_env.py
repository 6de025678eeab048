"""The TL-MDP: a labelled environment times a task table.

One step: act, read the labels of s', progress the task row, reward, done on a verdict. The reward of formulas is the
row's verdict, +1 / -1 / 0; reward machines pay by transition. The paper prints L(s) instead, the labels of the state in
which the action is taken: `labels="state"`. Its words begin with the label of the initial state, and every verdict
comes one step later.
The row is part of `pipeline_state`, so every auto-reset that restores the pipeline state restores the task with it.
"""

import copy
from typing import Literal, get_args

import jax
import jax.numpy as jnp
from flax import struct
from jax.typing import ArrayLike

from t2tl_jax.env import Env, EnvParams, LabelledEnv, Purpose, State
from t2tl_jax.ltl import TaskTable
from t2tl_jax.objects import Objects

Labels = Literal["next", "state"]
"""Which state's labels a step reads: those of s', or those of s as the paper prints."""


@struct.dataclass
class TaskParams:
    """Everything that varies between seeds and tasks, as one pytree: an argument of `reset` and `step`, not a constant.

    Over the seeds of a run `env`, `numbers` and `fault` are stacked, and all of them share one `table`.
    """

    env: EnvParams  # of the wrapped environment
    table: TaskTable  # the tasks
    numbers: dict[str, jax.Array] = struct.field(default_factory=dict)  # float32 scalars: see `training/numbers.py`
    fault: ArrayLike | tuple[()] = ()  # int32, why the seed is frozen, 0 if it is not: see `training/guard.py`


@struct.dataclass
class TaskState:
    """Pipeline state of a `TaskEnv`: the environment's own, and the formula that is left to satisfy."""

    env: struct.PyTreeNode  # the wrapped environment's pipeline state
    row: jax.Array  # int32 scalar, row of the task table


@struct.dataclass
class Shared:
    """What a step led to whatever the task is: with the table it is a transition of every row."""

    letter: jax.Array  # int32, the labels of s', or of s with labels="state"
    reward: jax.Array  # float32, the environment's own
    ended: jax.Array  # bool, the environment ended the episode


class TaskEnv(Env):
    """An environment that rewards the agent for satisfying a formula (brax interface, unbatched, no time limit).

    `random_starts` is the share of episodes that start in a random open row of the table instead of a task's first row:
    the on-policy form of the paper's simultaneous learning on the extended set Psi of progressed sub-tasks.

    `labels` says what an episode s_0, s_1, ... is read as: "next" (the default) as the word L(s_1), L(s_2), ...; the
    initial labels are not used. "state" as L(s_0), L(s_1), ..., as printed; a step then pays for the state it left.
    """

    def __init__(self, env: LabelledEnv, table: TaskTable, random_starts: float = 0.0, labels: Labels = "next") -> None:
        """Combine `env` with tasks; `table` is part of the parameters, and the default for calls without them.

        Raises:
            ValueError: when they do not speak of the same propositions.
        """
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
        if not 0.0 <= random_starts <= 1.0:
            raise ValueError(f"random_starts is a share of episodes, expected 0 to 1, got {random_starts}")
        if labels not in get_args(Labels):
            raise ValueError(f"labels must be one of {', '.join(get_args(Labels))}, got {labels!r}")
        self.env = env
        self.table = table
        self.random_starts: float | jax.Array = random_starts
        self.starts_anywhere = random_starts > 0.0
        self.labels = labels

    def with_random_starts(self, share: jax.Array) -> "TaskEnv":
        """The same with another share (float32 scalar) in a program under way; not of an environment without any."""
        same = copy.copy(self)
        same.random_starts = share
        return same

    def make_params(self, seed: int, purpose: Purpose = "training") -> TaskParams:
        """The environment's parameters for a seed, and the table; see `LabelledEnv.make_params`."""
        return TaskParams(env=self.env.make_params(seed, purpose=purpose), table=self.table)

    def reset(self, rng: jax.Array, params: TaskParams | None = None, turn: jax.Array | None = None) -> State:
        """A fresh layout and one of the table's tasks, of which nothing is progressed yet.

        The task is drawn uniformly, or is number `turn` (int32 scalar) of those that take turns. A counter of episodes
        that has overflowed and is less than 0 does as well, since the remainder is that of Python.
        """
        params = self.make_params(0) if params is None else params
        env_key, task_key, row_key = jax.random.split(rng, 3)
        tasks = params.table.initial_row
        row = jax.random.choice(task_key, tasks) if turn is None else tasks[turn % len(tasks)]
        if self.starts_anywhere:
            share_key, row_key = jax.random.split(row_key)
            random_row = _random_start(row_key, params.table)
            row = jnp.where(jax.random.uniform(share_key) < self.random_starts, random_row, row)
        return self.reset_to_row(env_key, row, params)

    def reset_to_row(self, rng: jax.Array, row: jax.Array, params: TaskParams | None = None) -> State:
        """Start an episode of a given row (int32 scalar)."""
        params = self.make_params(0) if params is None else params
        state = self.env.reset(rng, params.env)
        return state.replace(pipeline_state=TaskState(env=state.pipeline_state, row=jnp.asarray(row, jnp.int32)))

    def step(self, state: State, action: jax.Array, params: TaskParams | None = None) -> State:
        """Act, label, progress, reward (equation 2 of the paper, with the labels of s' unless `labels` says other)."""
        return self.step_for_all(state, action, params)[0]

    def step_for_all(self, state: State, action: jax.Array, params: TaskParams | None = None) -> tuple[State, Shared]:
        """As `step`, with what the step would have been to an agent with another task."""
        params = self.make_params(0) if params is None else params
        table = params.table
        before = state.replace(pipeline_state=state.pipeline_state.env)
        env_state = self.env.step(before, action, params.env)
        read = before if self.labels == "state" else env_state
        shared = Shared(letter=table.letter(self.env.labels(read)), reward=env_state.reward, ended=env_state.done > 0)
        row, reward = table.step(state.pipeline_state.row, shared.letter)
        after = env_state.replace(
            pipeline_state=TaskState(env=env_state.pipeline_state, row=row),
            reward=env_state.reward + reward,
            done=jnp.maximum(env_state.done, jnp.abs(table.verdict[row]).astype(jnp.float32)),
        )
        return after, shared

    def failed(self, state: State, shared: Shared) -> jax.Array | None:
        """Whether the environment's physics failed in the step that led to `state` and was `shared`; see there."""
        own = state.replace(
            pipeline_state=state.pipeline_state.env, reward=shared.reward, done=shared.ended.astype(jnp.float32)
        )
        return self.env.failed(own)

    def row(self, state: State) -> jax.Array:
        """The table row of the formula that is left: int32, of any batch of states."""
        return state.pipeline_state.row

    def task(self, state: State, params: TaskParams | None = None) -> jax.Array:
        """Which of the table's tasks starts in the state's row: int32 scalar; -1 for none, as after a random start."""
        params = self.make_params(0) if params is None else params
        is_first_row = params.table.initial_row == self.row(state)
        return jnp.where(is_first_row.any(), is_first_row.argmax(), -1).astype(jnp.int32)

    def verdict(self, state: State, params: TaskParams | None = None) -> jax.Array:
        """+1 the task is carried out, -1 violated, 0 open: int8, of any batch of states."""
        table = self.table if params is None else params.table
        return table.verdict[self.row(state)]

    @property
    def observation_size(self) -> int:
        """Size of the environment's observation (the row is not part of it; see `TaskInObservation`)."""
        return self.env.observation_size

    @property
    def objects(self) -> Objects | None:
        """What the environment says about its observation; see `LabelledEnv.objects`."""
        return self.env.objects

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


def _random_start(key: jax.Array, table: TaskTable) -> jax.Array:
    """A row in which an episode may begin, each as likely as the others: int32 scalar."""
    if table.starts is None:
        return jax.random.categorical(key, jnp.log(table.is_open.astype(jnp.float32)))
    # One random number instead of one for every row, of which there may be thousands in each of thousands of resets.
    so_far = jnp.cumsum(table.starts)
    which = jax.random.randint(key, (), 1, so_far[-1] + 1)
    return jnp.searchsorted(so_far, which, method="scan_unrolled").astype(jnp.int32)
