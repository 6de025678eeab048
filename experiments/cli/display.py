"""What a run prints of itself: its plan before the training, its curves after it."""

import jax
import numpy as np

from t2tl_jax.evaluation.curves import sparkline
from t2tl_jax.runs import pretraining
from t2tl_jax.runs.current_run import Run
from t2tl_jax.runs.folder import RunFolder
from t2tl_jax.runs.metrics_file import by_seed, read_columns


def plan(run: Run) -> str:
    """What will be trained, on what, for how long."""
    asked, per_iteration = run.config.frames, run.experiment.agent.frames_per_iteration
    actual = run.experiment.iterations * per_iteration
    frames = f"{actual:,} frames per seed = {run.experiment.iterations:,} iterations x {per_iteration:,}"
    if actual != asked:
        frames += f" (asked for {asked:,}: {actual - asked:+,}, since iterations are whole)"
    devices = jax.devices()
    used = len(run.program.sharding.device_set) if run.program.sharding else 1
    seeds = f"seed {run.seeds[0]}" if len(run.seeds) == 1 else f"{len(run.seeds)} seeds"
    return "\n".join(
        (
            f"run    {run.folder.path}",
            f"task   {run.config.task}",
            f"plan   {frames}; {seeds}",
            f"device {devices[0].device_kind}, {used} of {len(devices)} used",
            *_more_plan(run),
        )
    )


def _more_plan(run: Run) -> list[str]:
    """Lines about what not every run has."""
    config, lines = run.config, []
    if run.experiment.pools is not None:
        pool = config.pool
        lines.append(
            f"pools  {pool.size} random formulas for {pool.period} iterations, then others, the same for all seeds"
        )
    if config.convergence.window:
        end = config.convergence
        lines.append(
            f"stop   sooner if the return gains at most {end.delta:g} from {end.window} iterations to the next as many"
        )
    if run.pretraining is not None:
        lines.append(f"before {pretraining.in_words(run.pretraining)}")
    elif pretraining.is_auto(config):
        first = pretraining.matching(config)
        lines.append(f"before pre-training on {first.task}, at most {first.frames:,} frames per seed, counted apart")
    elif config.pretrained:
        lines.append(f"before the task encoder of {config.pretrained}")
    return lines


def curves_table(folder: RunFolder) -> str:
    """Success rate of every seed over the training, and its last value."""
    columns = read_columns(folder.metrics)
    seeds, _, success = by_seed(columns, "success_rate")
    _, _, returns = by_seed(columns, "discounted_return")
    lines = ["success rate during training (sampled policy), last value, last discounted return"]
    for seed, curve, gained in zip(seeds, success, returns, strict=True):
        lines.append(f"seed {seed:<5} {sparkline(curve)}  {_last(curve)}  {_last(gained)}")
    return "\n".join(lines)


def _last(values: np.ndarray) -> str:
    known = values[np.isfinite(values)]
    return f"{known[-1]:.3f}" if known.size else "no episode ended"
