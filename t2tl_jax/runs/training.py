"""A training run from start (or from its last checkpoint) to its evaluation and pictures."""

import dataclasses
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from t2tl_jax.runs import evaluation_run, machine_files, pretraining, folder as run_folder

from experiments.cli import display as run_display
from t2tl_jax.runs.build import Experiment
from experiments.configs import Config
from t2tl_jax.runs.current_run import Build, Run, write_status
from t2tl_jax.errors import UserError
from t2tl_jax.runs.folder import RunFolder
from t2tl_jax.training.types import Metrics
from t2tl_jax.evaluation import report
from t2tl_jax.evaluation.curves import plot_learning_curves
from t2tl_jax.runs import loop
from t2tl_jax.training import transfer
from t2tl_jax.runs.checkpoints import CheckpointError, Checkpoints, best_params
from t2tl_jax.runs.convergence import Convergence
from t2tl_jax.runs.interrupts import Interrupted, StopRequest
from t2tl_jax.runs.metrics_file import MetricsFileError, by_seed, lines_up_to, read_columns
from t2tl_jax.runs.prefetch import Prefetch
from t2tl_jax.training.program import Program, trace
from t2tl_jax.runs.progress import Progress
from t2tl_jax.runs.provenance import describe
from t2tl_jax.runs.recorder import Recorder
from t2tl_jax.training.seeds import parse_seeds, place

CHANGEABLE = ("frames", "convergence", "run")
"""Fields of a configuration that may change when a run is resumed."""


def start(config: Config, name: str, build: Build, command: Sequence[str]) -> int:
    """Train a configuration in a new folder. Everything that can be checked is checked before the folder is made.

    Raises:
        UserError: for settings that cannot work.
    """
    config = pretraining.located(config)
    with StopRequest() as stop:
        try:
            prepared = stop.call(lambda: _prepare(config, build), "while preparing")
        except Interrupted:
            print("stopped; nothing had been written")
            return stop.leave(0)
        folder = run_folder.create(Path(config.run.folder), name, config, describe(list(command)))
        config = machine_files.with_copy(config, folder.path)
        with run_folder.locked(folder):
            return _train_or_hint(Run(folder, config, *prepared, stop, build, list(command)))


def resume(path: Path, amend: Callable[[Config], Config], build: Build, command: Sequence[str]) -> int:
    """Continue a run from its last checkpoint, or from the beginning if it has none.

    Args:
        path: folder of the run.
        amend: applies the flags of this command; only ``frames``, ``convergence`` and ``run`` may change.
        build: from configuration to environment and learner.
        command: the command line, for the record.

    Raises:
        UserError: if the folder or the flags cannot be used.
    """
    folder, stored = run_folder.open_existing(path)
    config = amend(stored)
    changed = [
        field.name
        for field in dataclasses.fields(Config)
        if field.name not in CHANGEABLE and getattr(config, field.name) != getattr(stored, field.name)
    ]
    if changed:
        raise UserError(
            "a resumed run keeps its configuration; only --frames, --convergence.* and --run.* apply, "
            f"not {', '.join(changed)}"
        )
    if config.frames != stored.frames:
        print(f"frames {stored.frames:,} -> {config.frames:,}: schedules over the length of the run now end elsewhere")
    with run_folder.locked(folder), StopRequest() as stop:
        try:
            prepared = stop.call(lambda: _prepare(config, build, folder), "while preparing")
        except Interrupted:
            print("stopped; the run is as it was")
            return stop.leave(0)
        _log_session(folder, config, list(command))
        return _train_or_hint(Run(folder, config, *prepared, stop, build, list(command)))


def _prepare(
    config: Config, build: Build, folder: RunFolder | None = None
) -> tuple[Experiment, Program, tuple[int, ...]]:
    """Everything that can be checked of a configuration, and what it stands for; `folder` is that of a resumed run."""
    try:
        seeds = parse_seeds(config.seeds)
        resumed = folder is not None and _has_checkpoint(folder)
        if config.pretrained and not resumed:
            _check_pretraining(config, build)
        experiment = build(config)
        if experiment.pools is not None and experiment.agent.renew is None:
            raise ValueError(
                f"{config.task} is a family of random tasks, which change during training, and DQN's replay holds "
                "steps of former tasks; train families with ppo, or DQN on a single task"
            )
        if experiment.pools is not None and not resumed:
            experiment.pools(0)  # too small caps end a run here or never
        return experiment, trace(lambda seed: experiment.of_seed(seed)[1], seeds), seeds
    except (ValueError, TypeError) as error:
        raise UserError(str(error)) from error


def _has_checkpoint(folder: RunFolder) -> bool:
    with Checkpoints(folder.checkpoints) as checkpoints:
        return checkpoints.latest_iteration() is not None


def _check_pretraining(config: Config, build: Build) -> None:
    """Only for a run that has not begun: afterwards its encoder lies in its own checkpoint."""
    if not pretraining.is_auto(config):
        pretraining.open_fitting(config)
        return
    first = pretraining.matching(config)
    pretraining.check_padding(first, config, f"the pre-training on {first.task}")
    experiment = build(first)
    if experiment.pools is not None:
        experiment.pools(0)


def _log_session(folder: RunFolder, config: Config, command: list[str]) -> None:
    versions = run_folder.read_json(folder.versions)
    versions.setdefault("resumed", []).append(describe(command))
    run_folder.write_json(folder.versions, versions)
    run_folder.write_config(folder, config)


def _train_or_hint(run: Run) -> int:
    """Train, and if a signal stops it, say how to go on. Returns the exit code.

    Raises:
        UserError: if what a resumed run left is missing or damaged.
    """
    try:
        _train(run)
    except Interrupted as when:
        print(f"stopped {when}; continue with --resume {run.folder.path}")
    except MetricsFileError as error:
        hint = "A resumed run needs its rows so far: mend the file, bring back a copy of it, or begin a new run."
        raise UserError(f"{error}\n{hint}") from error
    return run.stop.leave(0)


def _train(run: Run) -> None:
    """Train to the end, or up to a signal. Gives no hint by itself, since a pre-training inside a run trains here too.

    Raises:
        Interrupted: saying when.
    """
    total = run.experiment.iterations
    print(run_display.plan(run), flush=True)
    with Checkpoints(run.folder.checkpoints) as checkpoints:
        done, state = _restore(run, checkpoints)
        if done >= total:
            print(f"all {total:,} iterations are done; --frames N with a larger N trains longer")
            _conclude(run, state, done)
            return
        if run.convergence.reached:
            print("training has converged; --convergence.window 0 trains on to the end")
            _conclude(run, state, done)
            return
        encoder = _pretrained_encoder(run) if state is None and run.config.pretrained else None
        begin = time.monotonic()
        init, iterate, renew = run.stop.call(lambda: _compile(run.program, fresh=state is None), "while compiling")
        run.compile_seconds = time.monotonic() - begin
        print(f"compiled in {run.compile_seconds:.1f} s", flush=True)
        if init is not None:
            state = init(run.program.keys)
            if encoder is not None:
                state = transfer.adopt(state, encoder, run.program.sharding)
        run.started_from = done
        done, state = _iterate(run, iterate, renew, checkpoints, state, done)
    _conclude(run, state, done)


def _pretrained_encoder(run: Run) -> Any:
    """The task encoder that the run starts with, pre-trained first if need be; leading axis [seeds].

    Raises:
        Interrupted: if the pre-training did not come to its end. It goes on where it stopped when the run is resumed.
    """
    config = run.config
    if not pretraining.is_auto(config):
        folder, stored = pretraining.open_fitting(config)
        experiment = run.build(stored)
    else:
        stored = pretraining.matching(config)
        try:
            prepared = run.stop.call(lambda: _prepare(stored, run.build), "while preparing")
            folder = run_folder.create_inside(run.folder, pretraining.FOLDER, stored, describe(run.command))
            stored = machine_files.with_copy(stored, folder.path)
            inner = Run(folder, stored, *prepared, run.stop, run.build, run.command)
            if inner.earlier.get("state") != "finished":
                with run_folder.locked(folder):
                    _train(inner)
        except Interrupted as when:
            raise Interrupted(f"during pre-training, {when}") from None
        experiment = inner.experiment
    encoder = pretraining.load(folder, stored, experiment, config)
    run.pretraining = pretraining.summary(folder, stored)
    print(f"pre-trained: {pretraining.in_words(run.pretraining)}", flush=True)
    return encoder


def _restore(run: Run, checkpoints: Checkpoints) -> tuple[int, Any]:
    if checkpoints.latest_iteration() is None:
        return 0, None
    try:
        if tuple(checkpoints.info().get("seeds", ())) != run.seeds:
            raise UserError(f"{run.folder.checkpoints} holds other seeds than {run.folder.config} names")
        done, state = checkpoints.restore(run.program.state)
    except CheckpointError as error:
        raise UserError(str(error)) from error
    if done < run.experiment.iterations:
        lines_up_to(run.folder.metrics, done)  # the recorder would say the same, but after compiling
    print(f"resuming after iteration {done:,}")
    run.convergence = Convergence(run.config.convergence, len(run.seeds), _returns(run, done))
    return done, place(state, run.program.sharding)


def _returns(run: Run, done: int) -> np.ndarray | None:
    """The discounted return of the iterations behind a checkpoint: float[seeds, done]; None if nothing asks for it."""
    if not run.config.convergence.window or done >= run.experiment.iterations:
        return None
    return by_seed(read_columns(run.folder.metrics), "discounted_return")[2][:, :done]


def _compile(program: Program, fresh: bool) -> tuple[Any, Any, Any]:
    renew = None if program.lowered_renew is None else program.lowered_renew.compile()
    return (program.lowered_init.compile() if fresh else None), program.lowered_iterate.compile(), renew


def _iterate(run: Run, iterate: Any, renew: Any, checkpoints: Checkpoints, state: Any, done: int) -> tuple[int, Any]:
    config, total = run.config, run.experiment.iterations
    per_iteration = run.experiment.agent.frames_per_iteration
    recorder = Recorder(run.folder.path, run.seeds, after=done)
    progress = Progress(total * per_iteration, done * per_iteration, len(run.seeds), quiet=not config.run.progress)
    begin = time.monotonic()

    def record(iteration: int, metrics: Metrics) -> None:
        rows = recorder.record(metrics, iteration, iteration * per_iteration)
        run.convergence.add(rows)
        progress.advance(per_iteration, rows)

    def save(iteration: int, train_state: Any) -> None:
        recorder.sync()  # first the rows, then the checkpoint that counts on them
        checkpoints.save(iteration, train_state, {"seeds": list(run.seeds), "frames": iteration * per_iteration})
        run.train_seconds = time.monotonic() - begin
        write_status(run, iteration, "training")

    # Which table comes next depends on the iteration alone, so a resumed run goes on with the same ones.
    pools = Prefetch(run.experiment.pools or (lambda number: None))

    def prepare(done: int, train_state: Any) -> Any:
        if renew is None or done % config.pool.period:
            return train_state
        return renew(train_state, pools.get(done // config.pool.period))

    def stop() -> bool:
        return run.stop.requested or run.convergence.reached

    try:
        with pools:
            hooks = loop.Hooks(record, save, stop, prepare)
            return loop.train(iterate, state, done, total, config.run.checkpoint_period, hooks)
    finally:
        run.train_seconds = time.monotonic() - begin
        progress.close()
        recorder.close()


def _conclude(run: Run, state: Any, done: int) -> None:
    """Pictures, evaluation, final words. The training is on disk by now, so a second signal may end this anywhere.

    Raises:
        Interrupted: if the training was stopped before its end, or now the evaluation.
    """
    total = run.experiment.iterations
    converged = run.convergence.reached and done < total
    finished = done >= total or converged
    write_status(run, done, "finished" if finished else "interrupted")
    if done == 0:
        raise Interrupted("before the first iteration was complete")
    with _noted("no learning curve"):
        print(run_display.curves_table(run.folder))
        plot_learning_curves(run.folder.metrics, run.folder.curves, title=f"{run.config.task} ({run.folder.path})")
    params = best_params(state)
    if not finished:
        _draw(run, params)
        raise Interrupted(f"after iteration {done:,} of {total:,}")
    run.stop.call(lambda: _evaluate(run, params, done), "while evaluating, with training complete")
    run.stop.call(lambda: _draw(run, params), "while drawing, with training complete")
    if converged:
        print(f"converged after iteration {done:,} of at most {total:,}")
    print(f"done: {run.folder.path}")
    if run.pretraining is not None:
        print(f"pre-training before that: {pretraining.in_words(run.pretraining)}")


def _evaluate(run: Run, params: Any, iteration: int) -> None:
    episodes = run.config.run.evaluation_episodes
    if not episodes:
        return
    print(f"evaluating the best parameters, {episodes} episodes per seed and policy", flush=True)
    reports = evaluation_run.evaluate(run.experiment, run.config, params, episodes)
    print(report.table(reports), flush=True)
    with _noted("the evaluation is not stored"):
        what = evaluation_run.settings(run.folder, run.config, "best", iteration, episodes)
        evaluation_run.store(run.folder, what, reports)


def _draw(run: Run, params: Any) -> None:
    if run.config.run.gif:
        with _noted("no animation"):
            evaluation_run.draw_episode(run.experiment, run.config, params, run.folder)


@contextmanager
def _noted(what: str) -> Iterator[None]:
    """Say what went wrong with a result, and go on: the training is on disk, and a picture less is no lost run."""
    try:
        yield
    except (UserError, MetricsFileError, OSError) as error:
        print(f"note: {what}: {error}", flush=True)
