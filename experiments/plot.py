"""Draw the learning curve of a run again: ``python -m experiments.plot RUN``; finished and interrupted runs alike."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro

from experiments.cli.errors import guarded
from experiments.cli.plugins import import_modules
from t2tl_jax.errors import UserError
from t2tl_jax.flags import check_picture, parse
from t2tl_jax.quiet import quiet_imports


@dataclass(frozen=True)
class Arguments:
    """Draw learning_curve.png from the metrics.csv of a run."""

    run: tyro.conf.Positional[Path]
    """Folder of the run."""
    published: bool = False
    """Also draw the curves of the paper's ZoneEnv figure (average discounted return on phi_zone)."""
    output: Path | None = None
    """File to write; learning_curve.png in the run by default."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command (``arguments`` of the command line by default) and return its exit code: 0 done, 2 bad input."""
    return guarded(lambda: _main(sys.argv[1:] if arguments is None else list(arguments)))


def _main(texts: list[str]) -> int:
    arguments = parse(
        Arguments, import_modules(texts), prog="python -m experiments.plot", description=Arguments.__doc__
    )
    check_picture("--output", arguments.output)
    with quiet_imports():
        import experiments.configs  # noqa: F401, registers what runs are made of
        from experiments.paper.published_curves import ZONE_CURVES
        from t2tl_jax.evaluation.curves import plot_learning_curves
        from t2tl_jax.runs import folder as run_folder
        from t2tl_jax.runs.metrics_file import MetricsFileError, history
        from t2tl_jax.training.seeds import parse_seeds

    folder, config = run_folder.open_existing(arguments.run)
    target = arguments.output or folder.curves
    published = ZONE_CURVES if arguments.published else None
    try:
        metrics, seeds = history(folder.metrics), parse_seeds(config.seeds)
        plot_learning_curves(metrics, seeds, target, f"{config.task} ({folder.path})", published)
    except MetricsFileError as error:
        raise UserError(str(error)) from error
    except OSError as error:
        raise UserError(f"cannot write {target}: {error.strerror or error}") from error
    print(f"drawn: {target}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
