"""Doing the runs of a reproduction: one after another, resumable, on as many devices as there are.

A run that is complete is left as it is, one that was cut goes on. Several processes, on one GPU or on several, share
the work of one folder, see `locks.py`.
"""

import itertools
import os
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields, replace
from pathlib import Path

import jax
import numpy as np

from experiments import attention
from experiments.cli.errors import EXHAUSTED
from experiments.reproduction.anytask import tested
from experiments.reproduction.locks import claimed, device_names
from experiments.reproduction.plan import Run, Scale, cost
from t2tl_jax.errors import UserError
from t2tl_jax.registry import make_env
from t2tl_jax.runs import config_files, evaluations, train
from t2tl_jax.runs.callbacks import Callback, Row, TrainingProgress
from t2tl_jax.runs.checkpoints import CheckpointError
from t2tl_jax.runs.folder import RunFolder, read_json
from t2tl_jax.runs.interrupts import Interrupted, Stoppable
from t2tl_jax.runs.result import Result
from t2tl_jax.training.compiler_options import MPS

ENDS = ("complete", "converged", "success")
"""Why a training ends that is not to go on."""

OUT_OF_TIME = "out of time"

SHORT = jax.errors.JaxRuntimeError
"""What a run fails with that finds too little memory on its devices. XLA says so in many words, such as that no
algorithm is left to choose, so they are not read."""

LOST = 75
"""Exit code of a process whose device is lost. What others or a later process do of the same runs may well succeed."""

LOSS = ".loss"
"""Ending of the file that says of a run that a device was lost while it was done beside others, which any of them may
have caused. The next time the run itself is suspected, and done alone."""

LOOK = 30.0
"""Seconds between two looks of a client of MPS that waits whether its device still answers."""

CROWDED = ".crowded"
"""Ending of the file that says of a run that it failed beside others, and is to be done alone."""

WAIT = 2.0
"""Seconds between two looks at what other processes have done."""

READING = "attention.json"
"""What reading the agents of a run leaves in its folder."""


class LostDeviceError(Exception):
    """No call of this process to its device succeeds any more, whatever it is: the process has to end."""

    def __init__(self, failed: Sequence[str]) -> None:
        super().__init__("the device answers no more")
        self.failed = list(failed)
        """The runs that failed in this process."""


class Deadline(Callback):
    """Ends a training when the time is up; the same command goes on with it."""

    def __init__(self, minutes: float) -> None:
        self.at = time.monotonic() + 60 * minutes

    @property
    def passed(self) -> bool:
        """Whether the time is up."""
        return time.monotonic() >= self.at

    def on_iteration(self, progress: TrainingProgress, rows: Sequence[Row]) -> None:
        """Ask the training to stop, which writes a checkpoint first."""
        if self.passed:
            progress.stop = progress.stop or OUT_OF_TIME


class Alone(Callback):
    """Notes in the status that no other run of the reproduction was on the device."""

    def on_plan(self, progress: TrainingProgress) -> None:
        """Note it."""
        progress.notes["alone"] = True


def needed(runs: Mapping[str, Run], names: Sequence[str]) -> list[str]:
    """The runs of these names and those that they start from, each before what needs it."""
    found: dict[str, None] = {}
    for name in names:
        before = runs[name].before
        for one in ([] if before is None else needed(runs, [before])) + [name]:
            found[one] = None
    return list(found)


def in_order(runs: Mapping[str, Run], names: Sequence[str]) -> list[str]:
    """The needed runs as several processes best take them: those that are to come early, then those that most work has
    to follow on, their own counted, so that no long one is left for the end. Those that need a device alone come last,
    since they do not go with what others still do."""
    wanted = needed(runs, names)
    ahead = dict.fromkeys(wanted, 0.0)
    for name in reversed(wanted):  # each run stands behind the one that it starts from
        ahead[name] += cost(runs[name])
        if (before := runs[name].before) is not None:
            ahead[before] = max(ahead[before], ahead[name])
    return sorted(wanted, key=lambda name: (runs[name].alone, not runs[name].early, -ahead[name]))


class Progress:
    """How far several processes have come with the runs of a folder, in a line."""

    def __init__(self, runs: Mapping[str, Run], names: Sequence[str], scale: Scale, base: Path) -> None:
        self._runs, self._scale, self._base = runs, scale, base
        self._open = needed(runs, names)
        self._total = len(self._open)
        self._text = ""

    def __call__(self) -> str:
        """Look again; the same text as before where nothing more is done."""
        done = [name for name in self._open if is_done(self._runs[name], self._scale, self._base / name)]
        if done or not self._text:
            self._open = [name for name in self._open if name not in done]
            counts = f"{self._total - len(self._open)} of {self._total} runs are done"
            self._text = f"{counts}: {', '.join(done)}" if done else counts
        return self._text


def is_done(run: Run, scale: Scale, folder: Path) -> bool:
    """Whether a run is trained to its end, evaluated and read.

    Raises:
        UserError: if the folder holds a run of another configuration, or of other seeds.
    """
    files = RunFolder(folder)
    trained = files.status.is_file() and read_json(files.status).get("ended") in ENDS
    if run.measure is not None:
        return trained
    if files.config.is_file():
        config, wanted = config_files.load(files.config), scale.apply(run)
        if not make_env(config.env).renewable:
            config = replace(config, map_period=wanted.map_period)  # which then counts for nothing
        own = [field.name for field in fields(wanted) if field.name not in ("pretrained", "run")]  # these name folders
        if any(getattr(config, name) != getattr(wanted, name) for name in own):
            raise UserError(f"{folder} holds a run of other settings or seeds; move it away, or take another --folder")
    evaluated = not run.evaluated or {
        (entry["settings"].get("checkpoint"), entry["settings"].get("episode_length"))
        for entry in evaluations.stored(files)
    } >= set(itertools.product(("final", "best"), _limits(run, scale)))
    return (
        trained
        and evaluated
        and ((folder / READING).is_file() or not run.read)
        and (not run.tested or tested.is_complete(run, scale.name, folder))
    )


def do_all(
    runs: Mapping[str, Run],
    names: Sequence[str],
    scale: Scale,
    base: Path,
    deadline: Deadline,
    stop: Stoppable,
    say: Callable[[str], None] = print,
) -> list[str]:
    """Do what is to be done of these runs until the time is up or the user asks to stop; returns what failed, by name.

    After each run the first one of the order (`in_order`) that can be done comes next: one for which nothing is to be
    done before, on which no other process works, and, if it is to be alone, with whose devices no other one works.
    What others stand in the way of is tried again until they are done. A run that fails is told of, and the others go
    on. One that may have failed for lack of memory beside others is done once more after the others, with no other run
    on its devices, by whichever process comes to it; but processes that wait there still hold the memory that they once
    used.

    Args:
        runs: all runs by name.
        names: those to do.
        scale: how much is done.
        base: where they lie, each in a folder of its name.
        deadline: when to stop.
        stop: whether to, on the user's wish.
        say: told what is begun and what it took.

    Raises:
        LostDeviceError: once the device is lost; what is left is left to other processes, or to the same command later.
    """
    base.mkdir(parents=True, exist_ok=True)
    looked = time.monotonic()
    failed: list[str] = []
    done: set[str] = set()

    def is_known_done(name: str) -> bool:
        if name not in done:
            with _loss_told(failed):  # whether it is done asks its environment
                if is_done(runs[name], scale, base / name):
                    done.add(name)
        return name in done

    open_runs = [name for name in in_order(runs, names) if not is_known_done(name)]
    total, devices = len(open_runs), device_names()

    def crowded(name: str) -> bool:
        return (base / f"{name}{CROWDED}").exists()  # for all processes, and for the same command later

    while open_runs and not (deadline.passed or stop.requested):
        elsewhere = False
        for name in sorted(open_runs, key=crowded):
            run, alone = runs[name], runs[name].alone or crowded(name)
            if run.before is not None and not is_known_done(run.before):
                continue
            with claimed(base, name, devices, alone) as mine:
                if not mine:
                    elsewhere = True
                    continue
                open_runs.remove(name)
                if not is_known_done(name):
                    say(f"[{total - len(open_runs)}/{total}] {name}")
                    failure = _failure(run, scale, base, name, deadline, stop, say)
                    lost = failure is not None and not devices_answer()
                    if failure is not None and issubclass(failure, SHORT) and not alone:
                        first = lost and not (base / f"{name}{LOSS}").exists()
                        when = "" if first else " after the others, with no other run on its devices"
                        say(f"    once more{when}")
                        (base / f"{name}{LOSS if first else CROWDED}").touch()
                        open_runs.append(name)
                    elif failure is not None:
                        failed.append(name)
                    if lost:
                        raise LostDeviceError(failed)
            break
        else:
            if not elsewhere:
                break
            time.sleep(WAIT)
            if MPS in os.environ and time.monotonic() > looked + LOOK:
                looked = time.monotonic()
                if not devices_answer():  # what another client did ends this one too
                    raise LostDeviceError(failed)
    return failed + [name for name in open_runs if crowded(name) and not is_known_done(name)]


@contextmanager
def _loss_told(failed: Sequence[str]) -> Iterator[None]:
    """Makes a `LostDeviceError` of what a call to a lost device fails with."""
    try:
        yield
    except SHORT as error:
        if devices_answer():
            raise
        raise LostDeviceError(failed) from error


def devices_answer() -> bool:
    """Whether the devices of this process still do anything. After some errors, such as a launch that failed, none of
    its calls to a GPU succeeds. One whose memory is full answers."""
    try:
        jax.block_until_ready([jax.device_put(np.zeros(()), device) + 1 for device in jax.local_devices()])
    except SHORT as error:
        return any(words in str(error) for words in EXHAUSTED)
    return True


def _failure(
    run: Run, scale: Scale, base: Path, name: str, deadline: Deadline, stop: Stoppable, say: Callable[[str], None]
) -> type[Exception] | None:
    """Do a run and tell what came of it; returns what it failed with, since hours of other runs should not end with it.
    Only the class: an error holds the arrays of all functions that it came through."""
    began, failure = time.monotonic(), None
    try:
        ended = do(run, scale, base / name, None if run.before is None else base / run.before, deadline, stop)
    except Exception as error:
        ended, failure = f"failed: {type(error).__name__}: {error}", type(error)
        if not _is_explained(error):
            say(traceback.format_exc())
    say(f"    {ended} after {time.monotonic() - began:.0f} s")
    return failure


def _is_explained(error: Exception) -> bool:
    """Whether the message was written for this case. Training makes one of any ``ValueError``, also of a mistake in the
    program, whose place is only in the traceback."""
    return isinstance(error, UserError) and isinstance(error.__cause__, CheckpointError | None)


def do(run: Run, scale: Scale, folder: Path, before: Path | None, deadline: Deadline, stop: Stoppable) -> str:
    """Train a run, or go on with it, then evaluate and read it; returns why the training ended."""
    if run.measure is not None:
        run.measure(folder)
        return ENDS[0]
    config, callbacks = scale.apply(run), [deadline, *([Alone()] if run.alone else [])]
    try:
        if (folder / "config.json").is_file():
            result = train.resume(folder, callbacks=callbacks, stop=stop)
        else:
            result = train.train(config, pretrained=before, folder=folder, callbacks=callbacks, stop=stop)
        if result.ended in ENDS and run.evaluated:
            stop.call(lambda: _evaluate(result, _limits(run, scale), deadline), "while evaluating")
    except Interrupted as when:
        return f"stopped {when}"
    if result.ended in ENDS and deadline.passed and not is_done(run, scale, folder):
        return OUT_OF_TIME
    if result.ended in ENDS and run.read:
        episodes = str(config.run.evaluation_episodes)
        if code := attention.main([str(folder), "--all-seeds", "True", "--episodes", episodes]):
            raise UserError(f"reading {folder} failed with exit code {code}")
    if result.ended in ENDS and run.tested:
        return _test(run, scale, result, deadline, stop)
    return result.ended


def _test(run: Run, scale: Scale, result: Result, deadline: Deadline, stop: Stoppable) -> str:
    """Play what a run is tested on, as far as time allows; returns how that ended."""
    assert result.folder is not None
    folder, name = result.folder, scale.name

    def stopped() -> bool:
        return deadline.passed or stop.requested

    try:
        stop.call(lambda: tested.add(run, name, result, tested.missing(run, name, folder), stopped), "while testing")
    except Interrupted as when:
        return f"stopped {when}"
    return result.ended if tested.is_complete(run, name, folder) else OUT_OF_TIME


def _limits(run: Run, scale: Scale) -> list[int]:
    """Time limits within which a run is evaluated."""
    return sorted({scale.apply(run).episode_length, *(run.limits if scale.name == "full" else ())})


def _evaluate(result: Result, limits: Sequence[int], deadline: Deadline) -> None:
    """Play the final and the best parameters within every time limit, as far as time allows, and store what came of
    it."""
    assert result.folder is not None
    files, config = RunFolder(result.folder), result.config
    for limit in limits:
        if deadline.passed:
            return
        experiment = result.experiment.with_config(replace(config, episode_length=limit))
        reports = evaluations.evaluate_policies(experiment, result.params, config.run.evaluation_episodes, limit)
        for which, report in reports.items():
            what = evaluations.settings(files, experiment, which, result.iteration, config.run.evaluation_episodes)
            evaluations.store(files, what, report)
