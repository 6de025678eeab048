"""What a training leaves behind, in memory or on disk: metrics, parameters, policies, evaluations."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import overload

import jax
import numpy as np

from t2tl_jax import checks
from t2tl_jax.env import LabelledEnv
from t2tl_jax.errors import UserError, check_type, explained
from t2tl_jax.evaluation.report import Report
from t2tl_jax.ltl import Formula, TaskFamily, TaskTable
from t2tl_jax.runs import evaluations
from t2tl_jax.runs.any_task import compile_each
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.evaluations import WHICH, Which
from t2tl_jax.runs.experiment import Experiment
from t2tl_jax.runs.policy import Policy, seed_slice
from t2tl_jax.runs.pools import make_table
from t2tl_jax.runs.success import success_since, window
from t2tl_jax.training.types import Params


@dataclass(frozen=True)
class Result:
    """A trained run; `train`, `resume` and `load` return one."""

    experiment: Experiment
    """Environment, task table and learner."""
    params: Mapping[Which, Params]
    """Parameters of every seed, leading axis [seeds]: ``params["final"]`` are those at the end of training, and
    ``params["best"]`` did best in episodes that were played to choose between them (see `Config.selection`)."""
    metrics: Mapping[str, np.ndarray]
    """By name, float64[seeds, iterations]: ``frames``, ``success_rate``, ``discounted_return``, losses and so on. NaN
    stands for an average over no episodes."""
    iteration: int
    """Iterations behind us."""
    ended: str = "complete"
    """Why the training ended: complete, converged, success (see `until_solved`), interrupted, or what a callback gave
    as reason."""
    folder: Path | None = None
    """Where the run lies; None for one that is not kept on disk."""

    @property
    def config(self) -> Config:
        """The configuration."""
        return self.experiment.config

    @property
    def seeds(self) -> tuple[int, ...]:
        """Numbers of the seeds, in the order of the leading axes."""
        return self.experiment.seeds

    @property
    def success_since(self) -> dict[int, int | None]:
        """By seed, the frames after which its success rate in training rose above 95 % and stayed there; None if not.

        Whether a seed has solved its task is for an evaluation of its final parameters to say, see `evaluate`.
        """
        since = (
            success_since(self.metrics["success_rate"], window(self.config))
            if "success_rate" in self.metrics
            else np.zeros(0, int)
        )
        frames = np.nanmin(self.metrics["frames"]) if len(since) else 0  # of a row
        return {seed: int(at * frames) or None for seed, at in zip(self.seeds, since, strict=True)}

    def index(self, seed: int | None) -> int:
        """Place of a seed on the leading axes, by default of the first one; UserError for one that is not there."""
        if seed is None:
            return 0
        if seed not in self.seeds:
            raise UserError(f"this run has no seed {seed}; its seeds: {', '.join(map(str, self.seeds))}")
        return self.seeds.index(seed)

    def params_of(self, which: Which) -> Params:
        """One of `params`, by its name; UserError for another name, or for one that was not kept."""
        if which in WHICH and which not in self.params:
            raise UserError(
                f"of {self.folder} the {' and '.join(self.params)} parameters alone are kept, not the {which}"
            )
        if which not in self.params:
            raise UserError(f"a run has parameters {' and '.join(WHICH)}, got which={which!r}")
        return self.params[which]

    def policy(
        self, seed: int | None = None, task: str | TaskFamily | TaskTable | None = None, which: Which = "final"
    ) -> Policy:
        """The policy of one seed.

        Args:
            seed: its number; by default the first one.
            task: another task than the one that was trained on, as a text or a table. A one-hot code has a fixed size
                and tells a table's rows apart by their places: it takes tables with no more open rows than that, and
                has learned nothing about the rows of another task.
            which: the final or the best parameters.

        Raises:
            UserError: for a seed or a task that does not fit.
        """
        experiment = self._on(task)
        params = seed_slice(self.params_of(which), self.index(seed))
        embedding = jax.jit(experiment.player.embed)(params, experiment.table)
        size = experiment.task_env.observation_size
        return Policy(params, embedding, experiment.table, experiment.player, size)

    @overload
    def evaluate(
        self,
        task: str | TaskFamily | TaskTable | None = None,
        episodes: int = 100,
        env: LabelledEnv | None = None,
        episode_length: int | None = None,
        which: Which = "final",
        tasks: None = None,
    ) -> dict[str, Report]: ...

    @overload
    def evaluate(
        self,
        task: None = None,
        episodes: int = 100,
        env: LabelledEnv | None = None,
        episode_length: int | None = None,
        which: Which = "final",
        *,
        tasks: Sequence[str],
    ) -> dict[str, dict[str, Report]]: ...

    def evaluate(
        self,
        task: str | TaskFamily | TaskTable | None = None,
        episodes: int = 100,
        env: LabelledEnv | None = None,
        episode_length: int | None = None,
        which: Which = "final",
        tasks: Sequence[str] | None = None,
    ) -> dict[str, Report] | dict[str, dict[str, Report]]:
        """Play complete episodes with every seed; reports with intervals of the deterministic and the sampled policy.

        Args:
            task: another task than the one that was trained on; of a one-hot code see `policy`.
            episodes: per seed, policy and task.
            env: another environment with the same observations, actions and propositions, such as other physics. A
                network over objects may meet others and more of them; one that tells them by role, other propositions.
            episode_length: another time limit, in steps.
            which: the final or the best parameters.
            tasks: several tasks instead, by name or as formulas, all in one compiled program.

        Returns:
            By the name of the policy; with `tasks`, by what each is called there, then by the name of the policy.

        Raises:
            UserError: for a task or an environment that does not fit.
        """
        if isinstance(episodes, bool) or not isinstance(episodes, int) or episodes < 1:
            raise UserError(f"episodes is a whole number of at least 1, got {episodes!r}")
        params = {which: self.params_of(which)}
        if task is not None and tasks is not None:
            raise UserError("evaluate takes one task or a list of tasks, got both")
        if isinstance(tasks, str):
            raise UserError(f"tasks is a list of names and formulas, got the text {tasks!r}; give [{tasks!r}]")
        length = self.episode_length(episode_length)
        check_type("env", env, LabelledEnv, type(None))
        if tasks is None:
            return evaluations.evaluate_policies(self._on(task, env), params, episodes, length)[which]
        tables, experiment = self._on_each(tasks, env)
        played = evaluations.evaluate_tables(experiment, params, list(tables.values()), episodes, length)[which]
        return dict(zip(tables, played, strict=True))

    def episode_length(self, given: int | None) -> int:
        """A time limit in steps, by default the run's own; UserError for one that cannot be."""
        with explained():
            return self.config.episode_length if given is None else checks.count("episode_length", given)

    def tables(self, tasks: Sequence[str]) -> dict[str, TaskTable]:
        """A table for each of some tasks, all of equal shapes; by what each is called in the list.

        Args:
            tasks: names or formulas.

        Raises:
            UserError: for a task that does not fit, or a network that cannot read formulas.
        """
        return self._on_each(tasks)[0]

    def elsewhere(self, env: LabelledEnv, tasks: Sequence[str]) -> "Result":
        """The same policies in another environment, as `evaluate` takes it, with the first of some tasks there.

        Args:
            env: where they are to play.
            tasks: names or formulas.

        Raises:
            UserError: for a task or an environment that does not fit.
        """
        return replace(self, experiment=self._on_each(tasks, env)[1])

    def _on_each(self, tasks: Sequence[str], env: LabelledEnv | None = None) -> tuple[dict[str, TaskTable], Experiment]:
        """Their tables, in the environment if one is given, and the experiment with the first of them."""
        tables = compile_each(self.experiment if env is None else replace(self.experiment, env=env), tasks)
        return tables, self._on(next(iter(tables.values())), env)

    def _on(self, task: str | TaskFamily | TaskTable | None, env: LabelledEnv | None = None) -> Experiment:
        """The experiment with another task or environment; UserError if the network cannot read it."""
        own = self.experiment
        env = own.env if env is None else env
        if task is None and env.propositions == own.env.propositions:
            return self._elsewhere(env, own.table)
        if task is None or isinstance(task, str | TaskFamily):
            with explained():
                table = make_table(self.config if task is None else self.config.for_task(task), env)
        else:
            hint = "; of a formula give the text, str(formula)" if isinstance(task, Formula) else ""
            check_type("task", task, str, TaskFamily, TaskTable, hint=hint)
            table = task
        experiment = self._elsewhere(env, table)
        try:
            jax.eval_shape(lambda params: experiment.player.embed(seed_slice(params, 0), table), self.params["final"])
        except (ValueError, TypeError) as error:
            raise UserError(
                f"the network of this run cannot read {task}: {error}\n"
                "A trained network keeps the kind and the sizes that it was made with: choose a task within them, or "
                "train another run for this one."
            ) from error
        return experiment

    def _elsewhere(self, env: LabelledEnv, table: TaskTable) -> Experiment:
        """The experiment in another environment; UserError unless the parameters fit the objects there."""
        experiment = self.experiment.elsewhere(env, table)
        if experiment.agent is self.experiment.agent:
            return experiment
        given = experiment.task_env.make_params(self.seeds[0])
        needed = jax.tree.map(np.shape, jax.eval_shape(experiment.agent.init, jax.random.key(0), given).params)
        if needed != jax.tree.map(lambda leaf: leaf.shape[1:], dict(self.params["final"])):
            raise UserError(
                f"the network of this run has no parameters for the observations of {type(env).__name__}; one with "
                "network.state=objects may meet more objects of the same propositions "
                f"({', '.join(self.experiment.env.propositions)}), and with network.state.identity=role others"
            )
        return experiment
