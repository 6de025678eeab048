"""Train a named configuration: ``python -m experiments.run --config zone_ppo``; ``--help`` lists every option."""

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from experiments.cli import hosts
from experiments.cli.errors import guarded
from t2tl_jax.errors import UserError
from t2tl_jax.quiet import quiet_imports

STARTED = time.monotonic()
"""When the program began, but for the start of the interpreter."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0 done or stopped by the user, 2 for input that cannot be used.

    Args:
        arguments: of the command line, without the program's name; by default those of this process.
    """
    return guarded(lambda: command(sys.argv[1:] if arguments is None else list(arguments)))


def command(arguments: list[str], prefix: str = "", module: str = "experiments.run") -> int:
    """What `main` runs, also under another name: of `module`, for the configurations whose names begin with `prefix`.

    Raises:
        UserError: for input that cannot be used.
    """
    rest, given = hosts.read(arguments)
    # Imported here, where Ctrl-C is caught: loading JAX and MuJoCo takes seconds.
    with quiet_imports():
        from experiments.cli import early_gpu

        wait_for_gpu = early_gpu.begin_for(rest, alone=given is None)
        from experiments.cli import request

    asked = request.read(rest, prefix)
    if asked.show_list:
        print(request.list_configs(prefix))
        return 0
    config, name = request.configuration(asked, prefix, f"python -m {module}")
    with hosts.joined(given):  # not before, since --help and mistakes need no other host
        return _run(config, name, asked, ["python", "-m", module, *arguments], wait_for_gpu)


def _run(config: Any, name: str, asked: Any, words: list[str], wait_for_gpu: Callable[[], Any]) -> int:
    from experiments.cli import compilation_cache, cpu_devices

    compilation_cache.use(config.run.compilation_cache)
    cpu_devices.use()
    # Only now: plots, statistics and checkpoints take seconds to load too, which --help and mistakes need not wait for.
    with quiet_imports():
        from t2tl_jax.runs import folder, train  # noqa: F401, loads all that training needs while the GPU gets ready
        from t2tl_jax.runs.interrupts import Interrupted, StopRequest
        from t2tl_jax.training import hosts as processes

    wait_for_gpu()
    path = asked.resume or Path(processes.of_first(str(folder.new_path(Path(config.run.folder), name))))
    with StopRequest() as stop:
        try:
            _train(config, path, asked, stop, words)
        except Interrupted as when:
            kept = (path / "config.json").is_file()
            print(f"stopped {when}; {f'continue with --resume {path}' if kept else 'nothing was written'}")
        return stop.leave(0)


def _train(config: Any, path: Path, asked: Any, stop: Any, words: list[str]) -> None:
    """Train or go on, then evaluate and draw.

    Raises:
        Interrupted: saying when the user stopped it.
    """
    from experiments.cli.words import Words
    from t2tl_jax.runs import folder, train
    from t2tl_jax.runs.interrupts import Interrupted
    from t2tl_jax.runs.progress_bar import ProgressBar
    from t2tl_jax.training import hosts as processes

    def watching(what: str) -> list[Any]:
        if not processes.is_first():
            return []
        return [Words(STARTED, what), *([ProgressBar()] if config.run.progress else [])]

    options = {
        "callbacks": watching("run"),
        "pretraining_callbacks": watching("first"),
        "stop": stop,
        "command": words,
    }
    if asked.resume:
        train.refuse_other_changes(folder.open_existing(path)[1], config, as_flags=True)
        result = train.resume(path, **options, **{name: getattr(config, name) for name in train.CHANGEABLE})
    else:
        result = train.train(config, folder=path, **options)
    if processes.is_first():
        _conclude(result, stop)
    processes.meet()
    if result.ended == "interrupted":
        raise Interrupted(f"after iteration {result.iteration:,} of {config.iterations:,}")


def _conclude(result: Any, stop: Any) -> None:
    """Pictures, evaluation, final words. The training is on disk by now, so a signal may end this anywhere."""
    from experiments.cli import words
    from t2tl_jax.evaluation.curves import plot_learning_curves
    from t2tl_jax.evaluation.report import table
    from t2tl_jax.runs import evaluations
    from t2tl_jax.runs.folder import RunFolder
    from t2tl_jax.runs.metrics_file import history

    run, config, experiment = RunFolder(result.folder), result.config, result.experiment
    with _noted("no learning curve"):
        metrics = result.metrics or history(run.metrics)  # which says why there are none
        print(words.curves_table(result))
        plot_learning_curves(metrics, result.seeds, run.curves, title=f"{config.task} ({run.path})")
    finished, episodes = result.ended != "interrupted", config.run.evaluation_episodes

    def evaluate() -> None:
        if not (finished and episodes):
            return
        many = words.counted(episodes, "episode")
        print(f"evaluating the final and the best parameters, {many} per seed and policy", flush=True)
        reports = evaluations.evaluate_policies(experiment, result.params, episodes, config.episode_length)
        print(table(evaluations.lines(reports)), flush=True)
        with _noted("the evaluation is not stored"):
            for which, report in reports.items():
                what = evaluations.settings(run, experiment, which, result.iteration, episodes)
                evaluations.store(run, what, report)

    def draw() -> None:
        if config.run.gif:
            with _noted("no animation"):
                evaluations.draw_episode(experiment, result.params["final"], run)

    def side_by_side() -> None:
        # Most of both is compilation, which leaves cores idle.
        with ThreadPoolExecutor(max_workers=2) as threads:
            for work in [threads.submit(evaluate), threads.submit(draw)]:
                work.result()

    cut = f"while drawing, with training cut after iteration {result.iteration:,} of {config.iterations:,}"
    stop.call(side_by_side, "while evaluating and drawing, with training complete" if finished else cut)
    if not finished:
        return
    if said := words.ending(result):
        print(said)
    print(f"done: {run.path}")


@contextmanager
def _noted(what: str) -> Iterator[None]:
    """Say what went wrong with a result, and go on: the training is on disk, and a picture less is no lost run."""
    from t2tl_jax.runs.metrics_file import MetricsFileError

    try:
        yield
    except (UserError, MetricsFileError, OSError) as error:
        print(f"note: {what}: {error}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
