"""Compare runs by their training: ``python -m experiments.compare RUN RUN ...``; interrupted runs are welcome."""

import itertools
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro

from experiments.cli.errors import guarded
from experiments.cli.flags import check_picture, parse
from experiments.cli.plugins import import_modules
from t2tl_jax.errors import UserError
from t2tl_jax.quiet import quiet_imports


@dataclass(frozen=True)
class Arguments:
    """One line per run: what differs from the first run's configuration, and how the last part of training went."""

    runs: tyro.conf.Positional[tuple[Path, ...]]
    """Folders of the runs; the first one is what the others are compared with."""
    last: float = 0.05
    """Share of the iterations, at the end, over which success, violation and return are averaged."""
    pairs: bool = False
    """Also test every two runs for a difference of their discounted returns."""
    figure: Path | None = None
    """Draw the mean curves of all runs into this PNG, beside the paper's where the task is its phi_zone."""


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
        raise UserError("--pairs tests two runs or more against each other; name another run")
    with quiet_imports():
        import experiments.configs  # noqa: F401, registers what runs are made of
        from t2tl_jax.runs import folder as run_folder
        from t2tl_jax.runs.differences import differences
        from t2tl_jax.runs.metrics_file import MetricsFileError, ending, history

    base = None
    curves: dict[str, Mapping[str, np.ndarray]] = {}
    returns_of: dict[str, np.ndarray] = {}
    notes = []
    print(f"{'frames/s':>11}  {'solved':>7}  {'discounted return':21}  {'violation':20}  configuration")
    for path in runs:
        folder, config = run_folder.open_existing(path)
        base = base or config
        try:
            curves[str(path)] = history(folder.metrics)
        except MetricsFileError as error:
            raise UserError(str(error)) from error
        end = ending(curves[str(path)], arguments.last)
        session = run_folder.read_json(folder.status).get("last_session", {})
        what = " ".join(differences(base, config)) or str(path)
        print(_line(session.get("frames_per_second_all_seeds"), end, what))
        known = np.isfinite(end["discounted_return"])
        returns_of[str(path)] = end["discounted_return"][known]
        if not known.all():
            notes.append(
                f"{path}: left out {(~known).sum()} of {known.size} seeds, of which no episode ended in that part"
            )
    print(
        f"Averages over the last {arguments.last:.0%} of training, sampled policy; brackets: 95 % intervals over seeds."
    )
    for note in notes:
        print(f"note: {note}")
    if arguments.pairs:
        _test_pairs(returns_of)
    if arguments.figure is not None:
        _draw(curves, arguments.figure, base)
    return 0


def _each_once(paths: Sequence[Path]) -> list[Path]:
    """The runs in their order; a test of a run against itself would mean nothing."""
    kept: dict[Path, Path] = {}
    for path in paths:
        if path.resolve() in kept:
            print(f"note: {path} is given more than once and counts once")
        else:
            kept[path.resolve()] = path
    return list(kept.values())


def _line(speed: float | None, end: Mapping[str, np.ndarray], what: str) -> str:
    """The line of one run, with dashes for what is not known."""
    from t2tl_jax.evaluation import statistics
    from t2tl_jax.evaluation.report import SOLVED

    known = np.isfinite(end["discounted_return"])
    solving = int((end["success_rate"][known] > SOLVED).sum())
    solved = f"{solving}/{known.sum()}" if known.any() else "-"
    returns = statistics.mean(end["discounted_return"][known]).text()
    violations = statistics.mean(end["violation_rate"][known], 0.0, 1.0).text()
    return f"{'-' if not speed else f'{speed:,.0f}':>11}  {solved:>7}  {returns:21}  {violations:20}  {what}"


def _test_pairs(returns_of: dict[str, np.ndarray]) -> None:
    from t2tl_jax.evaluation import statistics

    print("\ndifference of mean returns, 95 % bootstrap interval, p of a permutation test (two-sided, uncorrected)")
    for (first, a), (second, b) in itertools.combinations(returns_of.items(), 2):
        try:
            gap, p = statistics.difference(a, b)
            print(f"{gap.text():26}  p={p:.4f}  {first} - {second}")
        except ValueError as error:  # too few seeds; other pairs may have enough
            print(f"{'-':26}  p=-       {first} - {second}: {error}")


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
