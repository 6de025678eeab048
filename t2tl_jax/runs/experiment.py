"""From a configuration to the objects that train and evaluate it."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import jax
import numpy as np

from envs import registry
from t2tl_jax.env import LabelledEnv
from envs.waterworld import WaterWorldConfig
from experiments.configs import Config
from t2tl_jax.errors import explained
from t2tl_jax.training.types import Agent
from t2tl_jax.agents.dqn import make_dqn
from t2tl_jax.agents.ppo import make_ppo
from t2tl_jax.ltl import AT_MOST_ONE, TaskTable, TooLargeError, compile_named, compile_pool, is_family
from t2tl_jax.networks.actor_critic import NetworkConfig
from t2tl_jax.networks.q_network import QNetworkConfig
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.training.seeds import parse_seeds

DRAWS_PER_POOL = 10
"""How often a pool is drawn until its formulas fit into the table; after that, the first pool comes again."""


@dataclass(frozen=True)
class Experiment:
    """What a configuration stands for."""

    env: TaskEnv
    """For evaluation: every episode starts with a whole task. Of a family, these are tasks that training never drew
    on purpose: a pool of its own."""
    agent: Agent
    """The learner."""
    iterations: int
    """As many as are needed for the frames asked for."""
    row_texts: tuple[str, ...] = ()
    """What every row of the task table says, for pictures."""
    member: Callable[[jax.Array], tuple[TaskEnv, Agent]] | None = None
    """Environment and learner as a function of the seed, where they differ between the seeds of a run."""

    pools: Callable[[int], TaskTable] | None = None
    """The tables that training takes one after another, by their number; None where the tasks are fixed."""

    def of_seed(self, seed: jax.Array) -> tuple[TaskEnv, Agent]:
        """Environment (for evaluation) and learner of one seed, whose number may be traced."""
        return (self.env, self.agent) if self.member is None else self.member(seed)


def build(config: Config) -> Experiment:
    """Environment, task table and learner.

    Raises:
        UserError: for an unknown task or impossible settings, in the words of whoever noticed.
    """
    with explained():
        env = registry.make(config.env)
        _check_maps(config)
        table = make_table(config, env)
        iterations = -(-config.frames // config.learner.frames_per_iteration)

        def member(seed: jax.Array) -> tuple[TaskEnv, Agent]:
            own = env.for_seed(seed)
            return TaskEnv(own, table), _make_agent(config, TaskEnv(own, table, config.simultaneous), iterations)

        agent = _make_agent(config, TaskEnv(env, table, config.simultaneous), iterations)
        texts = tuple(table.text(row) for row in range(table.num_rows))
        return Experiment(TaskEnv(env, table), agent, iterations, texts, member, make_pools(config, env))


def _check_maps(config: Config) -> None:
    """Every seed must have its map where maps go by seed; traced numbers cannot be checked later."""
    env = config.env
    if isinstance(env, WaterWorldConfig) and env.layout == "by_seed":
        largest = max(parse_seeds(config.seeds))
        if largest >= env.pool_size:
            raise ValueError(
                f"seed {largest} trains on map {largest}, but the pool holds the maps 0 to {env.pool_size - 1}; "
                f"set env.pool_size to {largest + 1} or more, or env.layout to fixed"
            )


def make_table(config: Config, env: LabelledEnv) -> TaskTable:
    """Compile the task of a configuration for an environment; of a family, a pool to evaluate on.

    Raises:
        ValueError: for an unknown task, a formula with mistakes, one of other propositions, or one that is decided
            before the first step.
    """
    if is_family(config.task, env.propositions):
        return _pool(config, env, "evaluation")
    table = compile_named(config.task, env.propositions, env.alphabet, length=config.task_length or None)
    _check_open(config.task, table)
    return table


def _check_open(task: str, table: TaskTable) -> None:
    """Refuse what every episode would end with at its first step, whatever the agent does."""
    verdicts = np.asarray(table.verdict)[np.asarray(table.initial_row)]
    if (verdicts > 0).any():
        raise ValueError(f"{task} is true from the start, so there is nothing to learn; give another task")
    if (verdicts < 0).any():
        reason = ""
        if table.alphabet == AT_MOST_ONE:
            reason = f": at most one of {', '.join(table.propositions)} holds at a time in this environment"
        raise ValueError(
            f"{task} can never be satisfied{reason}; give a task that can, such as one goal after another, F(a & F b)"
        )


def make_pools(config: Config, env: LabelledEnv) -> Callable[[int], TaskTable] | None:
    """The pools that a family is trained on, by number; None for any other task.

    Asking for pool 0 raises ``TooLargeError`` where the caps are too small. Later pools always come: a run that could
    begin does not end because of an unlucky draw.
    """
    if not is_family(config.task, env.propositions):
        return None

    @cache
    def first() -> TaskTable:
        return _pool(config, env, "0")

    def pool(number: int) -> TaskTable:
        if number == 0:
            return first()
        # By the number alone, so that a resumed run meets the same pools.
        for which in (str(number), *(f"{number} again {draw}" for draw in range(1, DRAWS_PER_POOL))):
            try:
                return _pool(config, env, which)
            except TooLargeError:
                continue
        return first()

    return pool


def _pool(config: Config, env: LabelledEnv, which: str) -> TaskTable:
    if config.network.task_encoder == "one_hot":
        raise ValueError(
            f"{config.task} is a family of random tasks, and a one-hot code says nothing about a task that was not "
            "seen before; use a task encoder that reads formulas, such as transformer"
        )
    if config.task_length:
        raise ValueError(f"rows of a pool have pool.length={config.pool.length} tokens; leave task_length at 0")
    pool = config.pool
    try:
        return compile_pool(
            config.task.strip(),
            env.propositions,
            env.alphabet,
            f"{pool.seed} {which}",
            size=pool.size,
            rows=pool.rows,
            length=pool.length,
        )
    except TooLargeError as error:
        raise TooLargeError(f"{error}; the flags: --pool.length, --pool.rows, --pool.size") from error


def _make_agent(config: Config, env: TaskEnv, iterations: int) -> Agent:
    if config.dqn is not None:
        assert isinstance(config.network, QNetworkConfig)  # checked when the configuration was made
        return make_dqn(env, config.network, config.dqn, config.episode_length, iterations)
    assert config.ppo is not None and isinstance(config.network, NetworkConfig)
    renewable = is_family(config.task, env.env.propositions)
    return make_ppo(env, config.network, config.ppo, config.episode_length, iterations, renewable)
