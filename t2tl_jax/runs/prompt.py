"""Formulas that are played as soon as they are typed: compiled programs that wait for the next one."""

import time
from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np

from t2tl_jax.errors import UserError, check_type, explained
from t2tl_jax.evaluation.animation import Recording, recorder
from t2tl_jax.garbage import garbage_kept
from t2tl_jax.ltl import LTLSyntaxError, TaskTable, resolve_tasks
from t2tl_jax.runs.any_task import check_reads_formulas, compile_formulas
from t2tl_jax.runs.evaluations import Which
from t2tl_jax.runs.policy import seed_slice
from t2tl_jax.runs.pools import check_open
from t2tl_jax.runs.result import Result
from t2tl_jax.task_env import TaskParams
from t2tl_jax.training.seeds import ANIMATION, stream_keys
from t2tl_jax.training.types import Agent, Params, repeated
from t2tl_jax.training.unroll import begin, player_of


@dataclass(frozen=True)
class Played:
    """One episode of a formula."""

    table: TaskTable
    """The formula as it was compiled."""
    recording: Recording
    """What happened."""
    action: np.ndarray
    """The first action of the episode."""
    compile_ms: float
    """From the text to the table on the device, milliseconds."""
    action_ms: float
    """From the text to the first action, milliseconds; where `is_new_shape`, with what its program took to compile."""
    is_new_shape: bool
    """Whether a program had to compile, since no formula before was as large."""

    def progress(self) -> list[tuple[int, str]]:
        """What was left to do, and from which step on."""
        rows = self.recording.rows.tolist()
        changes = [step for step, row in enumerate(rows) if step == 0 or row != rows[step - 1]]
        return [(step, self.table.text(rows[step])) for step in changes]


class Prompt:
    """The deterministic policy of one seed, ready for any formula that its network can read."""

    def __init__(
        self, result: Result, seed: int | None = None, which: Which = "final", episode_length: int | None = None
    ) -> None:
        """Choose a policy; nothing compiles before the first formula.

        Args:
            result: a trained run.
            seed: its number; by default the first one.
            which: the final or the best parameters.
            episode_length: time limit in steps; by default the run's own.

        Raises:
            UserError: for a seed that is not there, or a network that cannot read formulas.
        """
        check_type("result", result, Result, hint="; load(folder) gives that of a run on disk")
        check_reads_formulas(result.experiment)
        self._experiment = experiment = result.experiment
        index = result.index(seed)
        length = result.episode_length(episode_length)
        self._params = jax.device_put(seed_slice(result.params_of(which), index))
        every = experiment.env_params("evaluation")
        self._env_params = jax.device_put(replace(every, env=seed_slice(every.env, index)))
        self._key, self._next = jax.random.split(stream_keys(experiment.seeds, ANIMATION)[index])
        self._shapes: set[tuple[tuple[int, ...], ...]] = set()
        env, agent = experiment.task_env, experiment.player
        self._record = recorder(env, experiment.env.view(), agent, length, deterministic=True)

        def first_action(params: Params, env_params: TaskParams, key: jax.Array) -> jax.Array:
            """What the recorded episode begins with."""
            reset_key, key = jax.random.split(key)
            table = env_params.table
            if _reads_rows_alone(agent, params, table):  # then the first row's code is all that is waited for
                code = agent.embed(params, _first_row(table))
                embedding = jnp.broadcast_to(code, (table.num_rows, code.shape[-1]))
            else:
                embedding = agent.embed(params, table)
            policy = player_of(agent, env, params, embedding, deterministic=True)
            start = begin(env, env_params, reset_key, 1, length)
            return policy.act(repeated(agent.begin(), 1), start.state, key)[0][0]

        self._first_action = jax.jit(first_action)

    def play(self, task: str) -> Played:
        """Play one episode of a formula, or of a task by name; every call has a start of its own.

        The first formula of a size waits for programs that compile, which `Played.action_ms` counts: the times of the
        others are those without `Played.is_new_shape`.

        Raises:
            UserError: for a formula with mistakes, in one line.
        """
        with garbage_kept():  # to look for it takes many times longer than a formula does
            started = time.perf_counter()
            table = self._compiled(task)
            compiled = time.perf_counter()
            given = (self._params, replace(self._env_params, table=table), self._key)
            action = np.asarray(self._first_action(*given))
            acted = time.perf_counter()
        self._key, self._next = jax.random.split(self._next)  # here, where nobody waits for it
        shapes = tuple(leaf.shape for leaf in jax.tree.leaves(table))
        is_new = shapes not in self._shapes
        self._shapes.add(shapes)
        recording = self._record(*given)
        return Played(table, recording, action, 1e3 * (compiled - started), 1e3 * (acted - started), is_new)

    def _compiled(self, task: str) -> TaskTable:
        try:
            (formula,) = resolve_tasks([task]).values()
            with explained():
                table = compile_formulas(self._experiment, [formula])
                check_open(task, table)
        except LTLSyntaxError as error:
            expected = f"; expected {error.expected}" if error.expected else ""
            raise UserError(f"{error.problem} at character {error.position + 1}{expected}") from error
        except ValueError as error:
            raise UserError(str(error).splitlines()[0]) from error  # below it a caret shows the place
        return table


def _reads_rows_alone(agent: Agent, params: Params, table: TaskTable) -> bool:
    """Whether the code of a row is made of its own tokens, and not of other rows and transitions."""
    try:
        code = jax.eval_shape(agent.embed, params, _first_row(table))
    except (TypeError, ValueError):  # one part of it is, and the other does not fit beside it
        return False
    return isinstance(code, jax.ShapeDtypeStruct) and code.shape[0] == 1


def _first_row(table: TaskTable) -> TaskTable:
    """A table of the one row that its task starts in, to be encoded by itself."""
    return replace(table, tokens=table.tokens[table.initial_row], mask=table.mask[table.initial_row])
