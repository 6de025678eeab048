"""What a run prints of itself: its plan before the training, what happens, its curves after it."""

import time
from collections.abc import Sequence

import jax
import numpy as np

from t2tl_jax.evaluation.sparkline import sparkline
from t2tl_jax.runs import pretraining
from t2tl_jax.runs.callbacks import Callback, Row, TrainingProgress
from t2tl_jax.runs.differences import in_short
from t2tl_jax.runs.result import Result
from t2tl_jax.runs.success import window


class Words(Callback):
    """Prints the plan, what compiling took, and since when the seeds succeed, by the clock of this process."""

    def __init__(self, started: float, what: str = "run") -> None:
        """`started` is when the process began, by ``time.monotonic``; `what` heads the plan."""
        self._started, self._what = started, what
        self._times: list[float] = []
        self._played = False

    def on_plan(self, progress: TrainingProgress) -> None:
        """What will be trained, on what, for how long."""
        if progress.done:
            print(f"resuming after iteration {progress.done:,}")
        if progress.done >= progress.iterations:
            print(f"all iterations ({progress.iterations:,}) are done; a larger --frames continues")
        print(_plan(progress, self._what), flush=True)

    def on_start(self, progress: TrainingProgress) -> None:
        """What compiling took."""
        if "pretraining" in progress.notes and not progress.done:
            print(f"pre-trained: {pretraining.in_words(progress.notes['pretraining'])}")
        waited = f"(waited {progress.compile_wait_seconds:.1f} s for it)"
        print(f"compiled in {progress.compile_seconds:.1f} s {waited}", flush=True)

    def on_iteration(self, progress: TrainingProgress, rows: Sequence[Row]) -> None:
        """Remember when that was."""
        self._played |= any(row["episodes"] for row in rows)
        self._times.append(time.monotonic() - self._started)

    def on_end(self, progress: TrainingProgress) -> None:
        """Since when it succeeds; nothing where no episode is played."""
        if progress.done > progress.started_from and self._played:
            print(self._success(progress), flush=True)

    def _success(self, progress: TrainingProgress) -> str:
        since = np.array(progress.success_since)
        of_seeds = f" of {(since > 0).sum()} of {since.size} seeds" if since.size > 1 else ""
        above = f"success in training{of_seeds} rose above 95 % and stayed there"
        if not (since > 0).any():
            return f"success in training did not stay above 95 % for {window(progress.config)} iterations in a row"
        last = int(since.max())
        frames = f"{last * progress.frames_per_iteration:,} frames"
        if last <= progress.started_from:
            return f"{above}, in an earlier session, after {frames}"
        seconds = self._times[last - progress.started_from - 1]
        return f"{above} after {frames} and {seconds:.0f} s since the start of the program"


def _plan(progress: TrainingProgress, what: str) -> str:
    config, iterations, per_iteration = progress.config, progress.iterations, progress.frames_per_iteration
    actual = iterations * per_iteration
    frames = f"{actual:,} frames per seed = {counted(iterations, 'iteration')} x {per_iteration:,}"
    if actual != config.frames:
        more = actual - config.frames
        frames += f" (asked for {config.frames:,}: {more:+,}, since iterations are whole)"
    devices = jax.devices()
    seeds = f"seed {progress.seeds[0]}" if len(progress.seeds) == 1 else f"{len(progress.seeds)} seeds"
    return "\n".join(
        (
            f"{what:6} {progress.folder}",
            f"task   {in_short(config.task)}",
            f"plan   {frames}; {seeds}",
            f"device {devices[0].device_kind}, {progress.devices} of {len(devices)} used",
            *_more_plan(progress),
        )
    )


def counted(count: int, thing: str) -> str:
    """How many things there are: ``1 iteration``, ``2,000 iterations``."""
    return f"{count:,} {thing}{'' if count == 1 else 's'}"


def _more_plan(progress: TrainingProgress) -> list[str]:
    """Lines about what not every run has."""
    config, lines = progress.config, []
    if progress.has_pools:
        pool = config.pool
        lines.append(
            f"pools  {counted(pool.size, 'random formula')} for {counted(pool.period, 'iteration')}, then others, "
            "the same for all seeds"
        )
    if config.until_solved:
        lines.append(
            f"stop   earlier if success stays above 95 % for {window(config)} iterations in a row, in every seed"
        )
    if config.convergence.window:
        end = config.convergence
        lines.append(
            f"stop   earlier if the return gains at most {end.delta:g} from {end.window} iterations to the next"
        )
    if "pretraining" in progress.notes:
        lines.append(f"before {pretraining.in_words(progress.notes['pretraining'])}")
    elif pretraining.is_auto(config):
        lines.append("before pre-training of the task encoder, which is counted separately")
    elif config.pretrained:
        lines.append(f"before the task encoder of {config.pretrained}")
    return lines


def curves_table(result: Result) -> str:
    """Success rate of every seed over the training, and its last value."""
    lines = ["success rate during training (sampled policy), last value, last discounted return"]
    curves = zip(result.seeds, result.metrics["success_rate"], result.metrics["discounted_return"], strict=True)
    for seed, curve, gained in curves:
        lines.append(f"seed {seed:<5} {sparkline(curve)}  {_last(curve)}  {_last(gained)}")
    return "\n".join(lines)


def ending(result: Result) -> str:
    """Why a training ended before its last iteration; '' for one that did not."""
    at = f"after iteration {result.iteration:,} of at most {result.config.iterations:,}"
    if result.ended == "success":
        return f"success in training stays above 95 %: ended {at}"
    if result.ended == "converged":
        return f"converged {at}"
    return "" if result.ended in ("complete", "interrupted") else f"ended {at}: {result.ended}"


def _last(values: np.ndarray) -> str:
    known = values[np.isfinite(values)]
    return f"{known[-1]:.3f}" if known.size else "no episode ended"
