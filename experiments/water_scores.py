"""The reward-machine benchmark's metric for one or more runs: ``python -m experiments.water_scores RUN [RUN ...]``.

Prints the normalised score of every run beside the published curves. Seeds are map numbers (``--env.layout by_seed``).
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro

from experiments.errors import UserError, guarded


@dataclass(frozen=True)
class Arguments:
    """Normalised scores of runs on the ten tasks of the reward-machine benchmark, beside the published ones."""

    runs: tyro.conf.Positional[tuple[Path, ...]]
    """Folders of runs; the best episode of any of them counts for the normalisation of all."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0 done, 2 for input that cannot be used."""
    return guarded(lambda: _main(sys.argv[1:] if arguments is None else list(arguments)))


def _main(texts: list[str]) -> int:
    import numpy as np

    from experiments import published_water, run_folder
    from experiments.command_line import parse
    from t2tl_jax.evaluation.scores import best_scores, normalised_scores
    from t2tl_jax.training.metrics_file import MetricsFileError, read_columns

    arguments = parse(Arguments, texts, prog="python -m experiments.water_scores", description=Arguments.__doc__)
    if not arguments.runs:
        raise UserError("name at least one run folder")
    best = {number: 1.0 / np.array(steps) for number, steps in published_water.BEST_STEPS.items()}
    tables = {}
    for path in arguments.runs:
        folder, _ = run_folder.open_existing(path)
        try:
            tables[path] = columns = read_columns(folder.metrics)
        except MetricsFileError as error:
            raise UserError(str(error)) from error
        if "best_score_10" not in columns:
            raise UserError(f"{path} did not train on the ten tasks (--task rm_water_published)")
        for number, own in best_scores(columns, 10).items():
            if number not in best:
                raise UserError(f"{path} has seed {number}, but only the maps 1 to 10 have published scores")
            best[number] = np.maximum(best[number], own)

    print(f"{'run':44} " + " ".join(f"{steps // 1000:>9}k" for steps in published_water.STEPS))
    for path, columns in tables.items():
        curves = [normalised_scores(columns, number, best[number]) for number in np.unique(columns["seed"]).astype(int)]
        cells = []
        for steps in published_water.STEPS:
            at = np.array([score[np.searchsorted(x, steps, side="right") - 1] for x, score in curves if x[-1] >= steps])
            spread = f"±{at.std(ddof=1):.3f}" if len(at) > 1 else ""
            cells.append(f"{at.mean():.3f}{spread}" if len(at) else "")
        print(f"{str(path)[-44:]:44} " + " ".join(f"{cell:>10}" for cell in cells) + f"   ({len(curves)} maps)")
    for name, (means, deviations) in published_water.SCORES.items():
        cells = [f"{m:.3f}±{s:.3f}" for m, s in zip(means, deviations, strict=True)]
        print(f"{'published ' + name:44} " + " ".join(f"{cell:>10}" for cell in cells) + "   (10 maps x 2)")
    return 0


if __name__ == "__main__":
    sys.exit(main())
