"""Train a grid of settings, or search for one: ``python -m experiments.sweep --config NAME --grid FIELD=VALUE,VALUE``.

Settings that differ only in numbers train side by side in one program; see `t2tl_jax/runs/group.py`.
"""

import sys
import time
from collections.abc import Sequence
from typing import Any

from experiments.cli.errors import guarded
from experiments.sweeps.plan import PROG, Plan, read, split
from t2tl_jax.flags import HELP
from t2tl_jax.quiet import quiet_imports

STARTED = time.monotonic()
"""When the program began, but for the start of the interpreter."""

DESCRIPTION = f"""Train every point of a grid of settings, each with the same seeds, and compare them; or search.

  --grid FIELD=VALUE,VALUE  a field of the configuration and its values; of several, here or by more such flags, the
                            product is trained. 'method' counts as a field. Separate the sizes of a tuple by spaces:
                            'FIELD=64 64,128 128'
  --search TRIALS           instead of a grid, try this many settings proposed by Optuna (the extra 'search')
  --space FIELD=RANGE       what a search varies: 0.9..0.99, log:1e-5..1e-3, or values such as gelu,relu
  --batch TRIALS            how many settings are proposed and trained at a time; 8 by default
  --search-seed NUMBER      the seed of the proposals; 0 by default
  --workers NUMBER          train in this many processes at a time, as jobs of submitit (the extra 'cluster')
  --cluster local|slurm     run these jobs on this machine (the default) or on a SLURM cluster
  --cluster-option X=VALUE  a parameter of submitit, such as timeout-min=600, gpus-per-node=1, slurm-partition=gpu
  --only NUMBER,NUMBER      train only these points, counted from 0, as a job does, and print no table
  --folder FOLDER           where the runs are kept; by default NAME_sweep or NAME_search in the run.folder of the
                            configuration
  --config, --method, --import and every other option of experiments.run (see its --help) apply to all points

Values of numbers that only enter arithmetic (rates, discounts, coefficients, noise) train side by side in one program.
Each value of any other field needs a program of its own, and these train one after another. After an interruption the
same command continues; with more values or trials it adds their runs. Every point becomes an ordinary run.

A search trains on seeds from 100 on (--seeds 4 means 100 to 103), and ends by printing the command that reports the
best setting on other seeds.

Examples:
  {PROG} --config zone_ppo --grid learner.learning-rate=1e-4,3e-4 --grid method=t1tl,gnn --seeds 12
  {PROG} --config waterworld_dqn --grid learner.discount=0.95,0.98 --grid learner.batch-size=256,512
  {PROG} --config zone_ppo --search 64 --space learner.learning-rate=log:1e-5..1e-3 --seeds 4"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command (``arguments`` of the command line by default) and return its exit code: 0 done, 2 bad input."""
    return guarded(lambda: _main(sys.argv[1:] if arguments is None else list(arguments)))


def _main(texts: list[str]) -> int:
    if HELP & set(texts):
        print(DESCRIPTION)
        return 0
    given = split(texts)
    with quiet_imports():
        from experiments.cli import early_gpu

        wait_for_gpu = early_gpu.begin_for(texts)
    plan = read(given)
    with quiet_imports():
        from experiments.cli import compilation_cache, cpu_devices
        from experiments.sweeps import searching
        from experiments.sweeps.work import Work
        from t2tl_jax.runs.interrupts import Interrupted, StopRequest

    compilation_cache.use(plan.config.run.compilation_cache)
    cpu_devices.use()

    wait_for_gpu()
    with StopRequest() as stop:
        work = Work(plan.base, stop, plan.words, STARTED, plan.only, plan.cluster)
        try:
            if plan.trials:
                searching.run(plan, work)
            else:
                _grid(plan, work)
        except Interrupted as when:
            print(f"stopped {when}; give the same command again to continue")
    return stop.leave(0)


def _grid(plan: Plan, work: Any) -> None:
    """Train the points of a grid, and print their table.

    Raises:
        Interrupted: saying when the user stopped it.
    """
    for axis in plan.axes:
        print(_in_words(axis, plan.points))
    runs = {plan.base / point.folder: point for point in plan.points}
    work.train(runs, range(len(runs)))
    if plan.only is not None:
        return
    from experiments.sweeps import report

    curves = report.read_curves(runs)
    print(f"\n{report.HEAD}")
    for path, point in runs.items():
        print(report.line(path, point, curves[path]))
    print(report.LEGEND)
    report.draw({point.label: curves[path] for path, point in runs.items()}, plan.base)
    print(f"done: {plan.base}")


def _in_words(axis: Any, points: Sequence[Any]) -> str:
    """What the values of a field cost."""
    from experiments.cli import grid

    numbers = [grid.is_number(point.config, axis.field) for point in points]
    if any(numbers):
        apart = "" if all(numbers) else "; where there is none (None, or no random starts), it needs another program"
        return f"{axis.flag}: a number that only enters arithmetic; its values train side by side{apart}"
    return f"{axis.flag}: more than a number in the arithmetic; every value needs a program of its own"


if __name__ == "__main__":
    sys.exit(main())
