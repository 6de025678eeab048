"""Doing the runs of a reproduction: one after another, resumable, on as many devices as there are.

A run that is complete is left alone, one that was cut goes on. A process claims a run by locking a file beside its
folder, so several processes, one for each GPU, share the work of one folder.
"""

import fcntl
import itertools
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields, replace
from pathlib import Path

from experiments import attention
from experiments.reproduction.plan import Run, Scale
from t2tl_jax.errors import UserError
from t2tl_jax.runs import config_files, evaluations, train
from t2tl_jax.runs.callbacks import Callback, Row, TrainingProgress
from t2tl_jax.runs.folder import RunFolder, read_json
from t2tl_jax.runs.interrupts import Interrupted, Stoppable
from t2tl_jax.runs.result import Result

ENDS = ("complete", "converged", "success")
"""Why a training ends that is not to go on."""

OUT_OF_TIME = "out of time"

WAIT = 2.0
"""Seconds between two looks at what other processes have done."""

READING = "attention.json"
"""What reading the agents of a run leaves in its folder."""


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


def needed(runs: Mapping[str, Run], names: Sequence[str]) -> list[str]:
    """The runs of these names and those that they start from, each before what needs it."""
    found: dict[str, None] = {}
    for name in names:
        before = runs[name].before
        for one in ([] if before is None else needed(runs, [before])) + [name]:
            found[one] = None
    return list(found)


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
        own = [field.name for field in fields(wanted) if field.name not in ("pretrained", "run")]  # these name folders
        if any(getattr(config, name) != getattr(wanted, name) for name in own):
            raise UserError(f"{folder} holds a run of other settings or seeds; move it away, or take another --folder")
    evaluated = not run.evaluated or {
        (entry["settings"]["checkpoint"], entry["settings"]["episode_length"]) for entry in evaluations.stored(files)
    } >= set(itertools.product(("final", "best"), _limits(run, scale)))
    return trained and evaluated and ((folder / READING).is_file() or not run.read)


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

    A run that another process works on is left to it. One that fails is told of, and the others go on.

    Args:
        runs: all runs by name.
        names: those to do.
        scale: how much is done.
        base: where they lie, each in a folder of its name.
        deadline: when to stop.
        stop: whether to, on the user's wish.
        say: told what is begun and what it took.
    """
    base.mkdir(parents=True, exist_ok=True)
    failed: list[str] = []
    open_runs = [name for name in needed(runs, names) if not is_done(runs[name], scale, base / name)]
    total = len(open_runs)

    def ended_for_now() -> bool:
        return deadline.passed or stop.requested

    while open_runs and not ended_for_now():
        number, elsewhere = len(open_runs), False
        for name in list(open_runs):
            before = runs[name].before
            if ended_for_now() or (before is not None and not is_done(runs[before], scale, base / before)):
                continue
            with _claimed(base / f"{name}.lock") as mine:
                if not mine:
                    elsewhere = True
                    continue
                open_runs.remove(name)
                if is_done(runs[name], scale, base / name):
                    continue
                began = time.monotonic()
                say(f"[{total - len(open_runs)}/{total}] {name}")
                try:
                    source = None if before is None else base / before
                    ended = do(runs[name], scale, base / name, source, deadline, stop)
                except Exception as error:  # hours of other runs should not end with this one
                    failed.append(name)
                    ended = f"failed: {type(error).__name__}: {error}"
                    say(traceback.format_exc())
                say(f"    {ended} after {time.monotonic() - began:.0f} s")
        if len(open_runs) == number:
            if not elsewhere:
                break
            time.sleep(WAIT)  # for what another process is doing
    return failed


def do(run: Run, scale: Scale, folder: Path, before: Path | None, deadline: Deadline, stop: Stoppable) -> str:
    """Train a run, or go on with it, then evaluate and read it; returns why the training ended."""
    if run.measure is not None:
        run.measure(folder)
        return ENDS[0]
    config = scale.apply(run)
    try:
        if (folder / "config.json").is_file():
            result = train.resume(folder, callbacks=[deadline], stop=stop)
        else:
            result = train.train(config, pretrained=before, folder=folder, callbacks=[deadline], stop=stop)
        if result.ended in ENDS and run.evaluated:
            stop.call(lambda: _evaluate(result, _limits(run, scale)), "while evaluating")
    except Interrupted as when:
        return f"stopped {when}"
    if result.ended in ENDS and run.read:
        episodes = str(config.run.evaluation_episodes)
        if code := attention.main([str(folder), "--all-seeds", "True", "--episodes", episodes]):
            raise UserError(f"reading {folder} failed with exit code {code}")
    return result.ended


def _limits(run: Run, scale: Scale) -> list[int]:
    """Time limits within which a run is evaluated."""
    return sorted({scale.apply(run).episode_length, *(run.limits if scale.name == "full" else ())})


def _evaluate(result: Result, limits: Sequence[int]) -> None:
    """Play the final and the best parameters within every time limit, and store what came of it."""
    assert result.folder is not None
    files, config = RunFolder(result.folder), result.config
    for limit in limits:
        experiment = result.experiment.with_config(replace(config, episode_length=limit))
        reports = evaluations.evaluate_policies(experiment, result.params, config.run.evaluation_episodes, limit)
        for which, report in reports.items():
            what = evaluations.settings(files, experiment, which, result.iteration, config.run.evaluation_episodes)
            evaluations.store(files, what, report)


@contextmanager
def _claimed(path: Path) -> Iterator[bool]:
    """Whether this process is the one that works on something, for as long as the block lasts."""
    with path.open("a") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            yield False
            return
        yield True
