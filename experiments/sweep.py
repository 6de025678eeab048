"""Train a grid of settings: ``python -m experiments.sweep --config zone_ppo --grid learner.learning-rate=1e-4,3e-4``.

Settings that differ only in numbers train side by side in one program; see `t2tl_jax/runs/group.py`.
"""

import argparse
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from experiments.cli.errors import guarded
from t2tl_jax.errors import UserError
from t2tl_jax.flags import HELP
from t2tl_jax.quiet import quiet_imports

STARTED = time.monotonic()
"""When the program began, but for the start of the interpreter."""

PROG = "python -m experiments.sweep"

DESCRIPTION = f"""Train every point of a grid of settings, each with the same seeds, and compare them.

  --grid FIELD=VALUE,VALUE  a field of the configuration and its values; several options make a product of them.
                            'method' is one, too. The sizes of a tuple are parted by spaces: 'FIELD=64 64,128 128'
  --folder FOLDER           where the runs lie; by default the run.folder of the configuration, in NAME_sweep
  --config, --method, --import and every other option of experiments.run (whose --help lists them) for all points

Numbers that only enter arithmetic (rates, discounts, coefficients, noise) train side by side in one program; another
value of any other field is another program, and these are trained one after another. The same command goes on after an
interruption, and with more values adds their runs. Every point becomes an ordinary run.

Examples:
  {PROG} --config zone_ppo --grid learner.learning-rate=1e-4,3e-4 --grid method=t1tl,gnn --seeds 12
  {PROG} --config waterworld_dqn --grid learner.discount=0.95,0.98 --grid learner.batch-size=256,512"""

LAST = 0.05
"""Share of the iterations, at the end, over which the final return is averaged."""

CURVES = "curves.png"
"""The picture of all points."""


@dataclass(frozen=True)
class Plan:
    """What a command line asks for."""

    base: Path
    """Where the runs lie."""
    axes: Sequence[Any]
    """Of the grid (`grid.Axis`)."""
    points: Sequence[Any]
    """Those of the grid (`grid.Point`), in order."""
    compilation_cache: str
    """Folder of compiled programs."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command (``arguments`` of the command line by default) and return its exit code: 0 done, 2 bad input."""
    return guarded(lambda: _main(sys.argv[1:] if arguments is None else list(arguments)))


def _main(texts: list[str]) -> int:
    if HELP & set(texts):
        print(DESCRIPTION)
        return 0
    plan = read(texts)
    with quiet_imports():
        from experiments.cli import compilation_cache, cpu_devices
    compilation_cache.use(plan.compilation_cache)
    cpu_devices.use()
    from t2tl_jax.runs.interrupts import Interrupted, StopRequest

    for axis in plan.axes:
        print(_in_words(axis, plan.points))
    runs = {plan.base / point.folder: point for point in plan.points}
    with StopRequest() as stop:
        try:
            _train(runs, plan.base, stop, [*PROG.split(), *texts])
        except Interrupted as when:
            print(f"stopped {when}; the same command goes on")
            return stop.leave(0)
    _conclude(runs, plan.base)
    return stop.leave(0)


def read(texts: Sequence[str]) -> Plan:
    """What the command line asks for.

    Raises:
        UserError: for anything that cannot be used.
    """
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False, exit_on_error=False)
    parser.add_argument("--grid", action="append", default=[])
    parser.add_argument("--folder", type=Path)
    try:
        own, rest = parser.parse_known_args(texts)
    except argparse.ArgumentError as error:
        raise UserError(f"{error}; see --help") from error
    with quiet_imports():
        from experiments.cli import grid, request

    asked = request.read(rest)
    if asked.resume is not None or asked.show_list or not own.grid:
        raise UserError(f"a sweep takes --config NAME and at least one --grid FIELD=VALUE,VALUE; see {PROG} --help")
    axes = grid.read_axes(own.grid)
    config, name = request.configuration(asked, "", PROG)
    base = own.folder or Path(config.run.folder) / f"{name}_sweep"
    return Plan(base.expanduser(), axes, grid.points(axes, asked, PROG), config.run.compilation_cache)


def _in_words(axis: Any, points: Sequence[Any]) -> str:
    """What the values of a field cost."""
    from experiments.cli import grid

    numbers = [grid.is_number(point.config, axis.field) for point in points]
    if any(numbers):
        apart = "" if all(numbers) else "; where there is none (None, or no random starts) it is another program"
        return f"{axis.flag}: a number that only enters arithmetic; its values train side by side{apart}"
    return f"{axis.flag}: more than a number in the arithmetic; every value is a program of its own"


def _train(runs: Mapping[Path, Any], base: Path, stop: Any, words: list[str]) -> None:
    """Train what is not there yet, one program after another.

    Raises:
        Interrupted: saying when the user stopped it.
    """
    from experiments.cli.words import Words
    from t2tl_jax.runs.group import ENDS, group_folder, train_group
    from t2tl_jax.runs.interrupts import Interrupted
    from t2tl_jax.runs.progress_bar import ProgressBar

    groups = _groups({path: point.config for path, point in runs.items() if not _is_done(path, point.config)})
    ours = [group_folder(group, base) for group in groups]
    for other in sorted(base.glob("group-*")):
        if other not in ours:
            print(f"note: {other} is an unfinished group of other points, which nothing here goes on with")
    for number, group in enumerate(groups, start=1):
        config = next(iter(group.values()))
        bar = [ProgressBar()] if config.run.progress else []
        print(f"program {number} of {len(groups)}, {len(group)} points side by side with their seeds:")
        print(*(f"  {runs[path].label}" for path in group), sep="\n", flush=True)
        ended = train_group(
            group,
            base,
            callbacks=[Words(STARTED, "group"), *bar],
            pretraining_callbacks=[Words(STARTED, "first"), *bar],
            stop=stop,
            command=words,
        )
        if ended not in ENDS:
            raise Interrupted(f"in program {number} of {len(groups)}")


def _is_done(path: Path, config: Any) -> bool:
    """Whether a point is an ordinary run by now; UserError if its folder holds something else."""
    from t2tl_jax.runs import folder as run_folder
    from t2tl_jax.runs import pretraining

    if not path.exists():
        return False
    stored = run_folder.open_existing(path)[1]
    if not pretraining.same_run(stored, pretraining.located(config)):
        raise UserError(f"{path} holds a run of other settings or seeds; move it away, or take another --folder")
    return True


def _groups(configs: Mapping[Path, Any]) -> list[dict[Path, Any]]:
    """The points by program, in their order."""
    from t2tl_jax.runs.group import same_program

    groups: list[dict[Path, Any]] = []
    for path, config in configs.items():
        for group in groups:
            if same_program(next(iter(group.values())), config):
                group[path] = config
                break
        else:
            groups.append({path: config})
    return groups


def _conclude(runs: Mapping[Path, Any], base: Path) -> None:
    """A table and a picture of all points."""
    from t2tl_jax.evaluation.curves import plot_runs
    from t2tl_jax.runs.folder import RunFolder, read_json
    from t2tl_jax.runs.metrics_file import MetricsFileError, history

    try:
        curves = {path: history(RunFolder(path).metrics) for path in runs}
    except MetricsFileError as error:
        raise UserError(str(error)) from error
    print(f"\n{'over 95 %':>9}  {'since frames':>12}  {'discounted return':20}  {'seconds':>7}  {'beside':>6}  point")
    for path, point in runs.items():
        print(_line(point, curves[path], read_json(RunFolder(path).status)))
    print(
        "Over 95 %: seeds whose success in training stays there; since how many frames, the median of all seeds;\n"
        f"discounted return over the last {LAST:.0%} of training, with its 95 % interval over seeds; seconds of\n"
        "training side by side with so many other points. For tests: python -m experiments.compare RUN RUN --pairs True"
    )
    try:
        plot_runs({point.label: curves[path] for path, point in runs.items()}, base / CURVES)
        print(f"drawn: {base / CURVES}")
    except OSError as error:
        print(f"note: no picture: {error}")
    print(f"done: {base}")


def _line(point: Any, curves: Mapping[str, Any], status: Mapping[str, Any]) -> str:
    """One line of the table."""
    import numpy as np

    from t2tl_jax.evaluation import statistics
    from t2tl_jax.runs.metrics_file import ending
    from t2tl_jax.runs.success import success_since, window

    since = success_since(curves["success_rate"], window(point.config))
    frames = np.median(np.where(since > 0, since * np.nanmin(curves["frames"]), np.inf))
    final = ending(curves, LAST)["discounted_return"]
    gained = statistics.mean(final[np.isfinite(final)])
    seconds = status.get("all_sessions", {}).get("training_seconds")
    beside = status.get("group", {}).get("runs", 1) - 1
    return (
        f"{f'{(since > 0).sum()}/{since.size}':>9}  {f'{frames:,.0f}' if np.isfinite(frames) else '-':>12}  "
        f"{gained.text():20}  {'-' if seconds is None else f'{seconds:,.0f}':>7}  {beside:>6}  {point.label}"
    )


if __name__ == "__main__":
    sys.exit(main())
