"""From a configuration to the objects that train and evaluate it, each of them built once."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import jax
import numpy as np
from jax.sharding import NamedSharding

from t2tl_jax.agents.plan import planning
from t2tl_jax.env import EnvParams, LabelledEnv, Purpose
from t2tl_jax.errors import UserError, explained
from t2tl_jax.ltl import TaskTable, ways
from t2tl_jax.registry import AGENTS, ENVS
from t2tl_jax.renaming import Renamed
from t2tl_jax.runs import kept_traces
from t2tl_jax.runs.compilation import Compilation
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.pools import Pools, make_pools, make_table
from t2tl_jax.task_env import TaskEnv, TaskParams
from t2tl_jax.training.devices import seed_sharding
from t2tl_jax.training.guard import watched
from t2tl_jax.training.numbers import make_given, numbers_of
from t2tl_jax.training.program import OVER_SEEDS, Program, of_each_seed, params_of_seeds, trace
from t2tl_jax.training.seeds import TRAINING, parse_seeds, stream_keys
from t2tl_jax.training.types import Agent


@dataclass(frozen=True)
class Experiment:
    """What a configuration stands for."""

    config: Config
    """The configuration."""
    env: LabelledEnv
    """The environment without a task."""
    table: TaskTable
    """The task; of a family, tasks to evaluate on, a pool of its own that training never has."""
    agent: Agent
    """The learner."""
    pools: Pools | None
    """The tables of a family, which training takes one after another; None where the tasks are fixed."""

    @property
    def seeds(self) -> tuple[int, ...]:
        """Numbers of the seeds, all of which train in one program, side by side."""
        return parse_seeds(self.config.seeds)

    @property
    def lanes(self) -> tuple[int, ...]:
        """What metrics and checkpoints call the trainings that go side by side: the seeds."""
        return self.seeds

    @property
    def numbers(self) -> list[dict[str, float]]:
        """The numbers of each lane that only enter arithmetic; see `training/numbers.py`."""
        return [numbers_of(self.config.learner, self.config.random_starts)] * len(self.seeds)

    @property
    def discounts(self) -> tuple[float, ...]:
        """The discount factor of each lane."""
        return tuple(numbers.get("discount", self.config.learner.discount) for numbers in self.numbers)

    @property
    def player(self) -> Agent:
        """The learner as it plays: by its policy, or by a plan if the configuration asks for one.

        Raises:
            UserError: for a learner or a task that cannot be planned with.
        """
        if self.config.plan == "none":
            return self.agent
        with explained():
            ways.check(self.table)
        return planning(self.agent, self.config.learner.task_encoder)

    @property
    def task_env(self) -> TaskEnv:
        """For evaluation: every episode starts with a whole task."""
        return TaskEnv(self.env, self.table, labels=self.config.labels)

    def table_at(self, done: int) -> TaskTable:
        """The tasks that are trained on after `done` iterations; they depend on nothing else, so a resumed run goes on
        with the same ones."""
        return self.table if self.pools is None else self.pools.training(done // self.config.pool.period)

    def env_params(self, purpose: Purpose) -> TaskParams:
        """What varies between the seeds, stacked with leading axis [seeds], and the one table of all of them.

        Where maps or tasks are random, each purpose has its own. An evaluation is of one configuration, which the
        learner was made from; elsewhere the numbers of each lane come in as well. In training no seed is frozen yet.
        """
        table, numbers = self.table, None if purpose == "evaluation" else self.numbers
        if self.pools is not None and purpose != "evaluation":
            table = self.table_at(0) if purpose == "training" else self.pools.selection()
        given = params_of_seeds(TaskEnv(self.env, table), self.seeds, purpose, numbers)
        return replace(given, fault=np.zeros(len(self.seeds), np.int32)) if purpose == "training" else given

    @property
    def renews_maps(self) -> bool:
        """Whether training goes on with new maps from time to time."""
        return self.env.renewable and self.config.map_period > 0

    def maps(self, renewal: int) -> EnvParams:
        """The environment's parameters for training after so many renewals, stacked with leading axis [seeds]; they
        depend on nothing else, so a resumed run goes on with the same ones."""
        if not renewal:
            return of_each_seed(self.env.make_params, self.seeds)
        return of_each_seed(lambda seed: self.env.renewed_params(seed, renewal), self.seeds)

    @property
    def sharding(self) -> NamedSharding | None:
        """Where the seeds and their environments are placed; None on a single device."""
        return self._placed(len(self.seeds))

    def _placed(self, count: int) -> NamedSharding | None:
        per_seed = self.config.run.devices_per_seed or self.agent.devices_per_seed
        return seed_sharding(count, self.agent.num_envs, per_seed)

    @property
    def devices(self) -> int:
        """How many devices train."""
        return 1 if self.sharding is None else len(self.sharding.device_set)

    @cached_property
    def program(self) -> Program:
        """The one program that trains all seeds, traced but not compiled."""
        return self._traced(
            self.seeds,
            self.env_params("training"),
            restartable=self.pools is not None and not self.config.pool.finish,
        )

    def _traced(self, seeds: Sequence[int], env_params: TaskParams, restartable: bool) -> Program:
        """The program of these seeds, which is not traced anew where `runs/kept_traces.py` has it."""
        sharding = self._placed(len(seeds))
        kept = kept_traces.file_of(self.config, self.table, env_params, sharding)
        return trace(self.agent, seeds, env_params, restartable, sharding, kept)

    def compilation(self, fresh: bool) -> Compilation:
        """The program, compiling beside other work since this was first called; see `Compilation`."""
        known: list[Compilation] = self._compilations
        if not known or known[0].fresh != fresh:
            known[:] = [Compilation(self.program_for(self.config.run.seeds_at_once), fresh)]
        return known[0]

    def program_for(self, width: int) -> Program:
        """The program of the first `width` seeds, by which groups of so many can be trained; of all for 0."""
        if not 0 < width < len(self.seeds):
            return self.program
        own = self.env_params("training")
        env, numbers, fault = jax.tree.map(lambda x: x[:width], (own.env, own.numbers, own.fault))
        return self._traced(
            self.seeds[:width],
            replace(own, env=env, numbers=numbers, fault=fault),
            restartable=self.pools is not None,
        )

    @cached_property
    def _compilations(self) -> list[Compilation]:
        return []

    @cached_property
    def params_shapes(self) -> Any:
        """Shapes and dtypes of the parameters of all seeds, leading axis [seeds]: a tree of ``jax.ShapeDtypeStruct``.

        Raises:
            ValueError: if the network cannot read the task.
        """
        init = jax.vmap(self.agent.init, in_axes=(0, OVER_SEEDS))
        return jax.eval_shape(init, stream_keys(self.seeds, TRAINING), self.env_params("evaluation")).params

    def with_config(self, config: Config) -> "Experiment":
        """The same objects under a configuration that says the same in other words; what was traced stays."""
        same = replace(self, config=config)
        same.__dict__.update(
            {name: self.__dict__[name] for name in ("program", "_compilations") if name in self.__dict__}
        )
        return same

    def with_table(self, table: TaskTable) -> "Experiment":
        """The same learner and environment with another task, to evaluate on."""
        return replace(self, table=table)

    def elsewhere(self, env: LabelledEnv, table: TaskTable) -> "Experiment":
        """The same learner in another environment, to evaluate in.

        Where its observation describes other objects, the learner is made anew for them.

        Raises:
            UserError: if it cannot read them.
        """
        there = replace(self, env=env, table=table)
        if env.objects == self.env.objects:
            return there
        with explained():
            make = AGENTS.maker(self.config.learner)
            agent = make(there.task_env, self.config.learner, self.config.episode_length, self.config.iterations)
        return replace(there, agent=agent)

    def row_texts(self) -> Sequence[str]:
        """What every row of the task table says, for pictures."""
        return tuple(self.table.text(row) for row in range(self.table.num_rows))


def build(config: Config, env: LabelledEnv | None = None) -> Experiment:
    """Environment, task table and learner.

    Args:
        config: what to build.
        env: the environment itself, where it is given instead of named.

    Raises:
        UserError: for an unknown task or impossible settings, in the words of whoever noticed.
    """
    with explained():
        env = ENVS.maker(config.env)(config.env) if env is None else env
        pools = make_pools(config, env)
        table = make_table(config, env) if pools is None else pools.evaluation
        world = Renamed(env) if config.renaming else env
        training_env = TaskEnv(world, table, config.random_starts, config.labels)
        make = AGENTS.maker(config.learner)
        agent = watched(make_given(make, training_env, config.learner, config.episode_length, config.iterations))
        if pools is not None and agent.restart is None:
            raise UserError(
                f"{config.task} is a family of random tasks, which change during training, and this learner cannot go "
                "on with other tasks: it offers no `restart`; train families with ppo or dqn, or give a single task"
            )
        experiment = Experiment(config, env, table, agent, pools)
        experiment.player  # noqa: B018, refuses a plan that cannot be made
        return experiment
