"""Runs in WaterWorld beside the published curves: ``python -m experiments.paper.water_scores RUN [RUN ...]``.

For the ten tasks of the reward-machine benchmark, whose seeds are map numbers (``--env.layout by_seed``), that is the
normalised score by environment step; for other tasks the return by episode, beside T2TL's `phi_water`.
"""

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro

from experiments.cli.errors import guarded
from experiments.paper import published_water
from t2tl_jax.errors import UserError
from t2tl_jax.evaluation.comparisons import compare, outcome
from t2tl_jax.evaluation.scores import best_scores, normalised_scores, return_by_episode
from t2tl_jax.flags import parse
from t2tl_jax.quiet import quiet_imports


@dataclass(frozen=True)
class Arguments:
    """Learning curves of WaterWorld runs as tables, beside the published ones."""

    runs: tyro.conf.Positional[tuple[Path, ...]]
    """Folders of runs, all of the ten tasks or none; their best episodes count for the normalisation of all."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0 done, 2 for input that cannot be used."""
    return guarded(lambda: _main(sys.argv[1:] if arguments is None else list(arguments)))


def _main(texts: list[str]) -> int:
    arguments = parse(Arguments, texts, prog="python -m experiments.paper.water_scores", description=Arguments.__doc__)
    if not arguments.runs:
        raise UserError("name at least one run folder")
    with quiet_imports():
        from envs.waterworld import WaterWorldConfig
        from experiments.worlds import worlds
        from t2tl_jax.runs import folder as run_folder
        from t2tl_jax.runs.metrics_file import MetricsFileError, read_columns

    tables, maps = {}, {}
    for path in arguments.runs:
        folder, config = run_folder.open_existing(path)
        if not isinstance(config.env, WaterWorldConfig):
            raise UserError(
                f"{path} was not trained in WaterWorld, whose published curves these are; "
                "python -m experiments.compare reads runs in any environment"
            )
        try:
            columns = tables[str(path)] = read_columns(folder.metrics)
        except MetricsFileError as error:
            raise UserError(str(error)) from error
        maps[str(path)] = worlds(config, tuple(map(int, np.unique(columns["seed"]))))
        if _is_of_ten_tasks(columns) and config.env.layout != "by_seed":
            raise UserError(
                f"{path} was trained with env.layout={config.env.layout}; the published scores are normalised by map, "
                "and only env.layout=by_seed trains seed n on map n"
            )
    ten_tasks = [path for path, columns in tables.items() if _is_of_ten_tasks(columns)]
    if ten_tasks and len(ten_tasks) < len(tables):
        raise UserError(f"only {', '.join(ten_tasks)} trained on the ten tasks; give runs of one kind")
    for line in _normalised(tables) if ten_tasks else _by_episode(tables, maps):
        print(line)
    return 0


def _is_of_ten_tasks(columns: Mapping[str, np.ndarray]) -> bool:
    return "best_score_10" in columns


def _normalised(tables: Mapping[str, Mapping[str, np.ndarray]]) -> Iterator[str]:
    """Normalised score of each run at the published numbers of steps, mean and standard deviation over maps."""
    best = {number: 1.0 / np.array(steps) for number, steps in published_water.BEST_STEPS.items()}
    for path, columns in tables.items():
        for number, own in best_scores(columns, 10).items():
            if number not in best:
                raise UserError(f"{path} has seed {number}, but only the maps 1 to 10 have published scores")
            best[number] = np.maximum(best[number], own)
    yield _line("normalised score after steps", [f"{steps // 1000}k" for steps in published_water.STEPS])
    for path, columns in tables.items():
        curves = [normalised_scores(columns, number, best[number]) for number in np.unique(columns["seed"]).astype(int)]
        cells = []
        for steps in published_water.STEPS:
            at = [_at(steps, x, score) for x, score in curves]
            cells.append("-" if None in at else _mean_and_deviation(np.array(at)))
        yield _line(path, cells) + f"   ({len(curves)} maps)"
    for name, (means, deviations) in published_water.SCORES.items():
        cells = [f"{mean:.3f}±{deviation:.3f}" for mean, deviation in zip(means, deviations, strict=True)]
        yield _line(f"published {name}", cells) + "   (10 maps x 2)"


def _by_episode(tables: Mapping[str, Mapping[str, np.ndarray]], maps: Mapping[str, Any]) -> Iterator[str]:
    """Return of the last 500 episodes of each run at the published episodes, mean and standard deviation over seeds.

    Then every two runs in the order given, by each seed's mean over these episodes; seeds that did not play them all
    are left out.

    Args:
        tables: of metrics, by run.
        maps: by run, what says which map each seed has; None where a seed is nothing but a random number.
    """
    means = {}
    yield _line("return of the last 500 episodes at", list(map(str, published_water.EPISODES)))
    for path, columns in tables.items():
        seeds = np.unique(columns["seed"]).astype(int)
        curves = np.array([return_by_episode(columns, seed, published_water.EPISODES) for seed in seeds])
        yield _line(path, [_mean_and_deviation(at[np.isfinite(at)]) for at in curves.T]) + f"   ({len(seeds)} seeds)"
        means[path] = {int(seed): float(np.mean(own)) for seed, own in zip(seeds, curves, strict=True)}
    for name, values in published_water.PHI_WATER.items():
        yield _line(f"published {name} (phi_water)", [f"{value:.2f}" for value in values])
    played = {path: {seed: own for seed, own in by_seed.items() if np.isfinite(own)} for path, by_seed in means.items()}
    found = compare(played, maps)
    if found:
        yield f"difference of the means over these episodes, corrected for {len(found)} comparisons"
    for (first, second), each in found.items():
        yield (
            f"{each.gap.text():24}  p={each.pvalue:.4f}  {'paired' if each.paired else 'unpaired':8}  "
            f"{outcome(each.gap):14}  {first} > {second}"
        )


def _at(steps: int, x: np.ndarray, score: np.ndarray) -> float | None:
    """The newest score after so many steps; None before the first iteration ended and after the last one did."""
    if not x[0] <= steps <= x[-1]:
        return None
    return float(score[np.searchsorted(x, steps, side="right") - 1])


def _mean_and_deviation(values: np.ndarray) -> str:
    if not len(values):
        return "-"
    return f"{values.mean():.3f}" + (f"±{values.std(ddof=1):.3f}" if len(values) > 1 else "")


def _line(name: str, cells: Sequence[str]) -> str:
    return f"{name[-44:]:44} " + " ".join(f"{cell:>12}" for cell in cells)


if __name__ == "__main__":
    sys.exit(main())
