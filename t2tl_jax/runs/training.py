"""A training from its start, or from its last checkpoint, to its end: compile, iterate, save, tell the callbacks."""

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from t2tl_jax.errors import UserError
from t2tl_jax.ltl import Curriculum, TaskTable
from t2tl_jax.runs import chunks, faults, loop, pool_workers, pretraining
from t2tl_jax.runs.callbacks import Callback, TrainingProgress
from t2tl_jax.runs.checkpoints import CheckpointError, Checkpoints
from t2tl_jax.runs.compilation import Compiled
from t2tl_jax.runs.convergence import Convergence, optimal_return
from t2tl_jax.runs.evaluations import Which
from t2tl_jax.runs.experiment import Experiment
from t2tl_jax.runs.folder import RunFolder
from t2tl_jax.runs.history import History
from t2tl_jax.runs.interrupts import Interrupted, Stoppable
from t2tl_jax.runs.lessons import Lesson, Lessons
from t2tl_jax.runs.loggers import CSVLogger
from t2tl_jax.runs.metrics_file import MetricsFileError, history, lines_up_to
from t2tl_jax.runs.pools import LessonOf, Pools
from t2tl_jax.runs.prefetch import Prefetch
from t2tl_jax.runs.result import Result
from t2tl_jax.runs.rows import Rows, make_rows
from t2tl_jax.runs.selection import Scorer, Selected, Selection
from t2tl_jax.runs.status import StatusFile
from t2tl_jax.runs.success import SuccessWatch, window
from t2tl_jax.runs.tensorboard import TensorBoardLogger
from t2tl_jax.runs.thinning import Thinning
from t2tl_jax.training import hosts, transfer
from t2tl_jax.training.devices import place
from t2tl_jax.training.program import place_params
from t2tl_jax.training.types import Metrics

ENDS = ("complete", "converged", "success", faults.ALL_FROZEN)
"""Why a training ends that is not to go on."""


@dataclass
class Training:
    """One session of a training. Call `run` once."""

    experiment: Experiment
    """What is trained."""
    stop: Stoppable
    """Who may ask to stop."""
    callbacks: Sequence[Callback] = ()
    """Those of the user."""
    paths: RunFolder | None = None
    """Where the run is kept; None for nowhere."""
    pretrain: Callable[[], Result] | None = None
    """Gives the earlier training whose task encoder a new run starts with; it may take a while."""
    resumed: Callable[[], None] | None = None
    """Told when what an earlier session left can be gone on with, before anything of it changes."""

    progress: TrainingProgress = field(init=False)
    checkpoints: Checkpoints | None = field(init=False, default=None)
    past: History = field(init=False)
    thinning: Thinning = field(init=False)
    convergence: Convergence = field(init=False)
    success: SuccessWatch = field(init=False)
    selection: Selection = field(init=False)
    lessons: Lessons | None = field(init=False, default=None)
    scorer: Scorer | None = field(init=False, default=None)
    best: Any = field(init=False, default=None)
    damaged: tuple[int, ...] = field(init=False, default=())
    lacks_replay: bool = field(init=False, default=False)
    width: int = field(init=False, default=0)
    """Seeds that are on the devices together; 0 until that is known."""

    def run(self) -> Result:
        """Train to the end, or to a reason to stop.

        Raises:
            UserError: if what a resumed run left cannot be used, or its files cannot be written.
            Interrupted: if the user asks to stop before the first iteration is complete, or while compiling.
        """
        try:
            return self._run()
        except CheckpointError as error:
            raise UserError(str(error)) from error

    def _run(self) -> Result:
        experiment, config = self.experiment, self.experiment.config
        frames = experiment.agent.frames_per_iteration
        path = None if self.paths is None else self.paths.path
        pools = experiment.pools is not None
        self.progress = progress = TrainingProgress(
            config, experiment.lanes, config.iterations, frames, pools, path, experiment.devices
        )
        with ExitStack() as stack:
            files = self._open(stack)
            state = self._restore()
            hosts.meet()  # from here on the first process changes what all of them have read
            if self.checkpoints is not None and hosts.is_first():
                self.checkpoints.put_aside(self.damaged)
            if self.resumed is not None and hosts.is_first():
                self.resumed()
            callbacks, planned = [self.past, *files, *self.callbacks], []
            try:
                for callback in callbacks:
                    planned.append(callback)
                    callback.on_plan(progress)
                if not progress.stop:
                    progress.stop = "complete" if progress.done >= config.iterations else self._reason()
                if not progress.stop:
                    compiled, state = self._begin(state)
                    for callback in callbacks:
                        callback.on_start(progress)
                    state = self._iterate(compiled, state, [self.past, *files])
            except Interrupted:
                progress.stop = "interrupted"
                raise
            finally:
                progress.stop = progress.stop or "failed"
                _end(planned, progress)
        if progress.done == 0:
            raise Interrupted(f"before the first iteration was complete: {progress.stop}")
        final = self._own(state)  # both as arrays of the host: one program plays them
        params: dict[Which, Any] = {"final": final, "best": final if self.best is None else self.best}
        return Result(experiment, params, self.past.arrays(), progress.done, progress.stop, path)

    def _open(self, stack: ExitStack) -> list[Callback]:
        """Open the run's checkpoints; the callbacks that write its files."""
        paths = self.paths
        if paths is None:
            return []
        self.checkpoints = stack.enter_context(Checkpoints(paths.checkpoints))
        if not hosts.is_first():
            return []
        self.checkpoints.clean()
        tensorboard = TensorBoardLogger(paths.path / "tensorboard")
        return [CSVLogger(paths.metrics), tensorboard, StatusFile(paths, self.progress)]

    def _restore(self) -> Any:
        """The state behind the newest checkpoint, on the devices; None where there is none."""
        experiment, config = self.experiment, self.experiment.config
        state, earlier, selected, info = None, {}, None, {}
        if self.checkpoints is not None and self.checkpoints.latest_iteration() is not None:
            stored = self.checkpoints.read(self._wanted, experiment.agent.replay)
            self.damaged = stored.damaged
            if stored.info.get("selection"):
                selected = Selected.of(stored.items["selection"], stored.info["selection"])
            state, self.best = stored.items["state"], stored.items["best"]
            self.lacks_replay, self.width = stored.lacks_replay, stored.info.get("width", 0)
            self.progress.done = self.progress.started_from = stored.iteration
            info, stored_rows = stored.info, stored.info.get("rows", {})
            self.progress.last_row = stored_rows.get("last", stored.iteration)  # early versions had every row
            earlier = self._earlier(stored.iteration, self.progress.last_row)
        faults.restore(self.progress, info.get(faults.NAME, {}))
        if isinstance(config.task, Curriculum):
            self.lessons = Lessons(config.task, config.pool.period, config.pool.size, info.get("lessons"))
        seeds = len(experiment.lanes)
        rows = info.get("rows", {"last": self.progress.last_row})
        self.thinning = Thinning(config.iterations, experiment.lanes, rows)
        self.past = History(earlier)
        self.convergence = Convergence(
            config.convergence, seeds, earlier.get("discounted_return"), earlier.get("optimal_return")
        )
        self.selection = Selection(config, selected)
        self.success = SuccessWatch(seeds, window(config), earlier.get("success_rate"))
        if info.get("watch"):  # the rows of the file are too few to say
            self.success.go_on(info["watch"]["success"])
            self.convergence.go_on(info["watch"]["convergence"])
        if self.progress.done < config.iterations and not self._reason():
            self._require_replay()
        return state

    def _wanted(self, info: Mapping[str, Any]) -> dict[str, Any]:
        """What is read of a checkpoint, with its shapes; UserError if it is one of other seeds."""
        assert self.checkpoints is not None
        if tuple(info.get("seeds", ())) != self.experiment.lanes:
            raise UserError(f"{self.checkpoints.folder} holds other seeds than the configuration names")
        state = self.experiment.program.stored
        sets = ("best", "selection") if info.get("selection") else ("best",)
        return {"state": state} | dict.fromkeys(sets, state.params)

    def _require_replay(self) -> None:
        """UserError if the run ended in a checkpoint that it cannot go on from."""
        if self.lacks_replay:
            raise UserError(
                f"{self.progress.folder} was complete, and its replay is not kept: it can be evaluated, but not "
                "trained further. A run that is to go on later is trained with --run.keep-replay True"
            )

    def _earlier(self, done: int, last: int) -> dict[str, np.ndarray]:
        """The metrics behind a checkpoint, by name float[seeds, rows]; the last row is of iteration `last`."""
        assert self.paths is not None
        going_on = done < self.experiment.config.iterations
        try:
            if going_on and last:
                lines_up_to(self.paths.metrics, last)  # the logger would say the same, but after compiling
            curves = history(self.paths.metrics) if last else {}
            frames = np.nanmax(curves["frames"], axis=0) if curves else np.zeros(0)
            behind = frames <= last * self.progress.frames_per_iteration
            return {name: values[:, behind] for name, values in curves.items()}
        except MetricsFileError as error:
            if not going_on:  # the parameters can be used without
                return {}
            hint = "A resumed run needs its rows so far: mend the file, bring back a copy of it, or begin a new run."
            raise UserError(f"{error}\n{hint}") from error

    def _reason(self) -> str:
        """Why to stop now, in any of the processes; '' to go on."""
        return next((reason for reason in hosts.exchanged(self.progress.stop or self._own_reason()) if reason), "")

    def _own_reason(self) -> str:
        if self.stop.requested:
            return "interrupted"
        if faults.all_frozen(self.progress):
            return faults.ALL_FROZEN
        if self.convergence.reached:
            return "converged"
        return "success" if self.experiment.config.until_solved and self.success.all else ""

    def _begin(self, state: Any) -> tuple[Compiled, Any]:
        """Compile, beside the pre-training of a new run if it has one, and make its first state."""
        experiment, progress = self.experiment, self.progress
        program, fresh, clock = experiment.program, state is None, time.monotonic
        compilation, encoder = experiment.compilation(fresh), None
        try:
            if fresh and self.pretrain is not None:
                begin = clock()
                first = self.pretrain()
                progress.pretraining_seconds = clock() - begin
                encoder = pretraining.encoder(experiment, first)
                progress.notes["pretraining"] = pretraining.summary(first)
            begin = clock()
            self.width, compiled = self.stop.call(
                lambda: chunks.fit(experiment, compilation, self.width), "while compiling"
            )
            progress.compile_wait_seconds = clock() - begin
        except BaseException:
            self.stop.abandon(compilation.thread)
            raise
        progress.compile_seconds = compiled.seconds
        if fresh:
            state = compiled.init(program.keys, program.env_params)
            if encoder is not None:
                state = transfer.adopt(experiment.agent, state, encoder, program.sharding)
        if self.width < program.count:
            return compiled, chunks.on_host(state)
        return compiled, state if fresh else place(state, program.sharding)

    def _abandon_scorer(self) -> None:
        if self.scorer is not None:
            self.stop.abandon(self.scorer.thread)

    def _select(self, iteration: int, state: Any) -> None:
        """Let the parameters behind an iteration compete, if it is one of the points."""
        if self.scorer is None and self.selection.is_near(iteration):
            self.scorer = Scorer(self.experiment)  # compiles beside the training, which does not wait for it yet
        if self.scorer is not None:
            self.scorer.check()
            if self.selection.competes(iteration):
                self.selection.add(iteration, self._own(state), self.scorer(state.params))

    def _best(self, iteration: int, state: Any) -> Selected | None:
        """What was selected. Those that a run ends with compete too, for itself only: when it goes on, they never did,
        so that it selects what an uninterrupted run does."""
        selected = self.selection.best
        if self.progress.stop and self.scorer is not None and selected and not self.selection.competes(iteration):
            return self.selection.with_last(iteration, self._own(state), self.scorer(state.params))
        return selected

    def _own(self, state: Any) -> Any:
        """The parameters of the seeds themselves, on the host."""
        return self.experiment.program.unpadded(state.params)

    def _pools_ahead(self, tables: Pools | None, lesson_of: LessonOf) -> Prefetch[TaskTable]:
        """The tables of random tasks, made ahead of time."""
        experiment, lessons, run = self.experiment, self.lessons, self.experiment.config.run
        if tables is None:
            return Prefetch(lambda number: experiment.table)
        if lessons is not None:
            return Prefetch(lambda number: tables.training(number, lesson_of), knows=lessons.knows)
        if run.pool_processes:
            workers = pool_workers.executor(experiment.config, experiment.env)
            return Prefetch(pool_workers.draw, executor=workers, ahead=2 * run.pool_processes)
        return Prefetch(tables.training)

    def _iterate(self, compiled: Compiled, state: Any, recorders: Sequence[Callback]) -> Any:
        """Train from where the run stands to its end, or to a reason to stop, and return the last state.

        The recorders are given rows that may stand for several iterations; the callbacks of the user, every iteration.
        """
        experiment, progress = self.experiment, self.progress
        program, config, frames = experiment.program, experiment.config, progress.frames_per_iteration
        env_params, fault = program.env_params, faults.codes(progress)
        if fault.any():
            env_params = place_params(replace(env_params, fault=fault), program.sharding)
        tables, lessons = experiment.pools, self.lessons
        lesson_of = lessons.of if lessons is not None else lambda number: Lesson()
        pools = self._pools_ahead(tables, lesson_of)
        maps = Prefetch(experiment.maps)
        optima: dict[int, list[float]] = {}
        begin = time.monotonic()

        def prepare(done: int, state: Any) -> tuple[Any, Any]:
            nonlocal env_params
            if experiment.renews_maps and (done % config.map_period == 0 or done == progress.started_from):
                placed = replace(env_params, env=maps.get(done // config.map_period))
                env_params = place_params(placed, program.sharding)
            renew = experiment.pools is not None and done % config.pool.period == 0
            if experiment.pools is not None and (renew or done == progress.started_from):
                table = pools.get(number := done // config.pool.period)
                best = {discount: optimal_return(table, discount) for discount in set(experiment.discounts)}
                optima[number] = [best[discount] for discount in experiment.discounts]
                env_params = place_params(replace(env_params, table=table), program.sharding)
            if renew and done and compiled.restart is not None:
                state = compiled.restart(state, env_params)
            return state, env_params

        def record(iteration: int, metrics: Metrics) -> None:
            progress.done, progress.train_seconds = iteration, time.monotonic() - begin
            metrics = program.unpadded(metrics)
            faults.note(progress, np.asarray(metrics.fault))
            pool, more = (iteration - 1) // config.pool.period, {}
            if tables is not None:
                more["optimal_return"] = np.array(optima[pool])
                if lessons is not None:
                    if metrics.tasks is None:
                        raise UserError(f"{config.task} counts success by task, which this learner does not report")
                    lessons.add(iteration, metrics.tasks, tables.names(pool, lesson_of))
                    more |= lessons.columns(pool, len(progress.seeds))
                    pools.prepare(pool + 2)
            at = iteration, iteration * frames
            new = make_rows(metrics, *at, progress.seeds, more)
            self.convergence.add(new)
            self.success.add(new)
            progress.success_since = tuple(self.success.since.tolist())
            write(self.thinning.add(new, *at, metrics, more))
            for callback in self.callbacks:
                callback.on_iteration(progress, new)

        def write(complete: Rows | None) -> None:
            progress.last_row = self.thinning.last
            if complete is not None:
                for callback in recorders:
                    callback.on_iteration(progress, complete)

        def save(iteration: int, state: Any) -> None:
            now = time.monotonic()
            progress.train_seconds = now - begin
            over = iteration >= progress.iterations or progress.stop in ENDS
            if over:
                write(self.thinning.flush(iteration, iteration * frames))
            for callback in (*recorders, *self.callbacks):
                callback.on_checkpoint(progress)
            best, going_on = self._best(iteration, state), self.selection.best
            self.best = None if best is None else best.params
            if self.checkpoints is not None:
                info: dict[str, Any] = {"seeds": list(progress.seeds), "frames": iteration * frames}
                info |= {"best": best and best.info(), "selection": going_on and going_on.info()}
                info |= {"lessons": lessons.state()} if lessons is not None else {}
                info |= {"rows": self.thinning.info(), "width": self.width}
                info[faults.NAME] = progress.notes.get(faults.NAME, {})
                if self.thinning.stride > 1:
                    info["watch"] = {"success": self.success.info(), "convergence": self.convergence.info()}
                self.checkpoints.save(
                    *(iteration, state, info, self.best, going_on and going_on.params),
                    replay=experiment.agent.replay,
                    seeds=program.count,
                    last=over and not config.run.keep_replay,
                    broken=faults.first(progress),
                )
            progress.checkpoint_seconds += time.monotonic() - now

        def stopping() -> bool:
            progress.stop = self._reason()
            return bool(progress.stop)

        with pools, maps:
            hooks = loop.Hooks(self._select, record, save, stopping, prepare)
            iterate = faults.given_back(compiled.iterate, env_params.fault)
            period = config.run.checkpoint_period if self.checkpoints is not None else float("inf")
            done, state = loop.run_loop(iterate, state, progress.done, progress.iterations, period, hooks)
        self._abandon_scorer()
        if self.checkpoints is not None:
            self.checkpoints.wait()
        progress.train_seconds = time.monotonic() - begin
        progress.stop = progress.stop if done < progress.iterations else "complete"
        return state


def _end(callbacks: Sequence[Callback], progress: TrainingProgress) -> None:
    """Tell all of them of the end, whatever any of them raises; an error has the one before it as its context."""
    if callbacks:
        try:
            callbacks[0].on_end(progress)
        finally:
            _end(callbacks[1:], progress)
