"""Compare runs by their training: ``python -m experiments.compare RUN RUN ...``; interrupted runs are welcome."""

import itertools
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import tyro

from experiments.cli.errors import guarded
from experiments.cli.plugins import import_modules
from t2tl_jax.errors import UserError
from t2tl_jax.flags import check_picture, parse
from t2tl_jax.quiet import quiet_imports

MOST_CHANGES = 6
"""Fields that a line names, where a run differs from the first one in more."""

Measure = Literal["discounted_return", "success_rate", "area"]


@dataclass(frozen=True)
class Arguments:
    """Print one line per run: how it learned, how training ended, and how its configuration differs from the first."""

    runs: tyro.conf.Positional[tuple[Path, ...]]
    """Folders of the runs; the others are compared with the first. With --pairs, their order is the claim to test: each
    run is claimed to be better than those after it."""
    last: float = 0.05
    """Share of the iterations, at the end of training, over which rates and returns are averaged."""
    pairs: bool = False
    """Also test each pair of runs for a difference, and say whether the claimed order is reproduced."""
    measure: Measure = "discounted_return"
    """With --pairs, what is tested: averages over the last part, or the discounted return over all training (area)."""
    margin: float = 0.0
    """With --pairs, the largest difference that counts as none; by default no two runs count as equal."""
    fairness: bool = False
    """Also print what else differs: sizes of codes and networks, pre-training, and the seeds that settings were chosen
    on."""
    figure: Path | None = None
    """Draw the mean curves of all runs in this PNG, beside the paper's own where the task is phi_zone."""


@dataclass(frozen=True)
class Run:
    """What is read of one run."""

    folder: Any  # RunFolder
    config: Any  # Config
    seeds: tuple[int, ...]
    curves: Mapping[str, np.ndarray]
    end: Mapping[str, np.ndarray]
    status: Mapping[str, Any]

    @property
    def known(self) -> np.ndarray:
        """Of which seeds an episode ended in the last part: bool[seeds]."""
        return np.isfinite(self.end["discounted_return"])

    def of(self, measure: Measure) -> dict[int, float]:
        """By seed, what it reached, as far as it is known."""
        from t2tl_jax.runs.metrics_file import area

        values = area(self.curves["discounted_return"]) if measure == "area" else self.end[measure]
        return {seed: float(value) for seed, value, known in zip(self.seeds, values, self.known, strict=True) if known}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command (``arguments`` of the command line by default) and return its exit code: 0 done, 2 bad input."""
    return guarded(lambda: _main(sys.argv[1:] if arguments is None else list(arguments)))


def _main(texts: list[str]) -> int:
    arguments = parse(
        Arguments, import_modules(texts), prog="python -m experiments.compare", description=Arguments.__doc__
    )
    if not arguments.runs:
        raise UserError("name one run or more, such as runs/zone_ppo/2026-01-31_12-00-00")
    if not 0 < arguments.last <= 1:
        raise UserError(f"--last is a share of the iterations above 0 and at most 1, got {arguments.last}")
    check_picture("--figure", arguments.figure)
    runs = _each_once(arguments.runs)
    if arguments.pairs and len(runs) < 2:
        raise UserError("--pairs tests two or more runs against each other; name another run")
    if not arguments.margin >= 0:
        raise UserError(f"--margin is a difference, 0 or more, got {arguments.margin}")
    with quiet_imports():
        import experiments.configs  # noqa: F401, registers what runs are made of
        from experiments import fairness, tuning

    read = {str(path): _read(path, arguments.last) for path in runs}
    base = next(iter(read.values())).config
    mixed = tuning.mixture({path: (run.config, run.seeds) for path, run in read.items()})
    if mixed and arguments.pairs:
        raise UserError(f"no test: {mixed}")
    for line in _table(read, base):
        print(line)
    print(
        f"Solved: seeds over 95 % in evaluation episodes of the final parameters, sampled policy (a dash: not "
        f"evaluated).\nAll else is of training episodes, sampled policy: seeds over 95 % over the last "
        f"{arguments.last:.0%} of training; since how many\nframes without falling below (median / last seed); "
        f"discounted return over all of training (area) and over that last part.\nBrackets: 95 % intervals "
        f"over seeds, of t, for the interquartile mean by bootstrap."
    )
    for path, run in read.items():
        if not run.known.all():
            print(f"note: {path}: left out {(~run.known).sum()} of {run.known.size} seeds, in which no episode ended")
        if tuned := tuning.tuning_seeds(run.config, run.seeds):
            print(f"note: {path}: settings were chosen on seeds {tuning.in_words(tuned)}, or these are kept for that")
    if mixed:
        print(f"note: {mixed}")
    if arguments.fairness:
        print("\n" + fairness.table({path: (run.config, run.seeds, run.status) for path, run in read.items()}))
    if arguments.pairs:
        _test_pairs(read, arguments.measure, arguments.margin)
    if arguments.figure is not None:
        _draw({path: run.curves for path, run in read.items()}, arguments.figure, base)
    return 0


def _read(path: Path, last: float) -> Run:
    from t2tl_jax.runs import folder as run_folder
    from t2tl_jax.runs import status_form
    from t2tl_jax.runs.metrics_file import MetricsFileError, by_seed, ending, history, read_columns

    folder, config = run_folder.open_existing(path)
    try:
        curves = history(folder.metrics)
        seeds = tuple(by_seed(read_columns(folder.metrics), "frames")[0].tolist())
    except MetricsFileError as error:
        raise UserError(str(error)) from error
    return Run(folder, config, seeds, curves, ending(curves, last), status_form.read(folder))


def _each_once(paths: Sequence[Path]) -> list[Path]:
    """The runs in their order; a test of a run against itself would mean nothing."""
    kept: dict[Path, Path] = {}
    for path in paths:
        if path.resolve() in kept:
            print(f"note: {path} is given more than once, and counts once")
        else:
            kept[path.resolve()] = path
    return list(kept.values())


def _table(runs: Mapping[str, Run], base: Any) -> Iterator[str]:
    """A line for each run, with dashes for what is not known."""
    from t2tl_jax.evaluation import statistics
    from t2tl_jax.runs.differences import differences
    from t2tl_jax.runs.success import success_since, window

    yield (
        f"{'frames/s':>11}  {'solved':>6}  {'over 95 %':>9}  {'since frames':17}  {'area':20}  "
        f"{'discounted return':20}  {'interquartile mean':20}  {'violation':20}  {'ended by env':20}  configuration"
    )
    for path, run in runs.items():
        speed = run.status.get("last_session", {}).get("frames_per_second_all_seeds")
        since = success_since(run.curves["success_rate"], window(run.config))
        first = np.nanmin(run.curves["frames"])  # one iteration's
        reached = np.where(since > 0, since * first, np.inf)
        areas, returns = (statistics.mean(list(run.of(name).values())) for name in ("area", "discounted_return"))
        violations, ended = (
            statistics.mean_rate(run.end[name][run.known]).text() if name in run.end else "-"
            for name in ("violation_rate", "env_termination_rate")
        )
        middle = statistics.interquartile_mean(list(run.of("discounted_return").values()))
        above = int((run.end["success_rate"][run.known] > statistics.SOLVED).sum())
        over = f"{above}/{run.known.sum()}" if run.known.any() else "-"
        yield (
            f"{'-' if not speed else f'{speed:,.0f}':>11}  {_solved(run):>6}  "
            f"{over:>9}  {_frames(np.median(reached))} / {_frames(reached.max())}  "
            f"{areas.text():20}  {returns.text():20}  "
            f"{middle.text():20}  {violations:20}  {ended:20}  "
            f"{_in_short(list(differences(base, run.config))) or path}"
        )


def _in_short(changes: Sequence[str]) -> str:
    """The first few of the fields that differ, and how many more there are."""
    more = len(changes) - MOST_CHANGES
    return " ".join(changes[:MOST_CHANGES]) + (f" and {more} more" if more > 0 else "")


def _solved(run: Run) -> str:
    from t2tl_jax.registry import make_env
    from t2tl_jax.runs import evaluations

    if not any(
        entry.get("settings", {}).get("checkpoint") in evaluations.FINAL for entry in evaluations.stored(run.folder)
    ):
        return "-"  # and the environment need not be built
    found = evaluations.solved(run.folder, run.config, make_env(run.config.env).backend)
    return "-" if found is None or found.value is None else f"{round(found.value * found.count)}/{found.count}"


def _frames(count: float) -> str:
    return f"{count:>7,.0f}" if np.isfinite(count) else f"{'-':>7}"


def _test_pairs(runs: Mapping[str, Run], measure: Measure, margin: float) -> None:
    from experiments.worlds import worlds
    from t2tl_jax.evaluation.comparisons import compare, outcome

    values = {path: run.of(measure) for path, run in runs.items()}
    found = compare(values, {path: worlds(run.config, tuple(run.seeds)) for path, run in runs.items()})
    print(
        f"\nFirst run - second run, means of {measure}: t interval (Welch's, or of pairs where seeds share maps), "
        f"corrected for {len(found)} comparisons\n(Bonferroni); p of a two-sided permutation test, corrected (Holm); "
        f"probability that a seed of the first is above one of the second."
    )
    for first, second in itertools.combinations(values, 2):
        if (first, second) in found:
            each = found[first, second]
            kind = "paired" if each.paired else "unpaired"
            print(
                f"{each.gap.text():24}  p={each.pvalue:.4f}  {each.improvement.text(2):17}  {kind:8}  "
                f"{outcome(each.gap, margin):14}  {first} > {second}"
            )
        else:
            counts = f"{len(values[first])} and {len(values[second])}"
            print(f"{'-':24}  p=-  {first} > {second}: a test needs two seeds of each run or more, got {counts}")


def _draw(curves: Mapping[str, Mapping[str, np.ndarray]], figure: Path, base: Any) -> None:
    from experiments.paper.published_curves import ZONE_CURVES
    from t2tl_jax.evaluation.curves import plot_runs

    try:
        plot_runs(curves, figure, ZONE_CURVES if base.task == "phi_zone" else None)
    except OSError as error:
        raise UserError(f"cannot write {figure}: {error.strerror or error}") from error
    print(f"drawn: {figure}")


if __name__ == "__main__":
    sys.exit(main())
