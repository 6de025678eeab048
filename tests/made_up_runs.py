"""Finished runs that nobody trained, as the tables read them."""

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np

from experiments.reproduction.stored import Stored
from t2tl_jax.runs import config_files
from t2tl_jax.runs.config import Config

NEAR = np.array([0.0, 0.001, 0.002, 0.003])
"""Added to a value: what four seeds come to that nearly agree."""

NOTHING = {
    "episodes": 10.0,
    "success_rate": 0.0,
    "violation_rate": 0.0,
    "timeout_rate": 1.0,
    "env_termination_rate": 0.0,
    "discounted_return": 0.0,
    "total_reward": 0.0,
    "length": 100.0,
    "success_length": np.nan,
}


def write(
    folder: Path,
    config: Config,
    seeds: tuple[int, ...] = (0, 1, 2, 3),
    iterations: int = 10,
    frames: int = 1000,
    evaluated: dict[int, dict[str, Any]] | None = None,
    status: dict[str, Any] | None = None,
    **curves: Any,
) -> Stored:
    """Write a run's files.

    Args:
        folder: of the run, made here.
        config: what is said to have been trained.
        seeds: their numbers.
        iterations: how many.
        frames: of one iteration.
        evaluated: by time limit, the figures of both policies: one value for all seeds, or one each.
        status: more of status.json.
        curves: columns of the metrics, each float or float[seeds] or float[seeds, iterations].
    """
    folder.mkdir(parents=True)
    (folder / "config.json").write_text(config_files.to_json(config))
    columns = {name: spread(values, len(seeds), iterations) for name, values in (NOTHING | curves).items()}
    with (folder / "metrics.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["iteration", "frames", "seed", *columns])
        for i in range(iterations):
            for k, seed in enumerate(seeds):
                cells = ["" if np.isnan(of[k, i]) else repr(float(of[k, i])) for of in columns.values()]
                writer.writerow([i + 1, (i + 1) * frames, seed, *cells])
    entries = [
        {
            "settings": {"checkpoint": which, "episode_length": limit},
            "policies": {policy: {"seeds": _of_seeds(seeds, figures)} for policy in ("sampled", "deterministic")},
        }
        for limit, figures in (evaluated or {}).items()
        for which in ("final", "best")
    ]
    (folder / "evaluation.json").write_text(json.dumps({"evaluations": entries}))
    told = {
        "seeds": list(seeds),
        "frames_per_seed": iterations * frames,
        "all_sessions": {"training_seconds": 60.0, "compile_seconds": 30.0},
    }
    (folder / "status.json").write_text(json.dumps(told | (status or {})))
    (folder / "versions.json").write_text(json.dumps({"started": {"cpu": "an abacus", "devices": ["an abacus"]}}))
    return Stored(folder)


def spread(values: Any, seeds: int, iterations: int) -> np.ndarray:
    """As float[seeds, iterations]."""
    array = np.asarray(values, float)
    return np.broadcast_to(array[:, None] if array.ndim == 1 else array, (seeds, iterations))


def _of_seeds(seeds: tuple[int, ...], figures: dict[str, Any]) -> list[dict[str, Any]]:
    found = []
    for k, seed in enumerate(seeds):
        own = {name: value[k] if isinstance(value, list) else value for name, value in figures.items()}
        found.append({"seed": seed, **{name: {"value": value} for name, value in own.items()}})
    return found


def pretrained(frames: int) -> dict[str, Any]:
    """What the status of a run says of its pre-training."""
    return {"pretraining": {"folder": "somewhere", "frames_per_seed": frames, "training_seconds": 5.0}}


def reading(star: dict[str, dict[str, int]], agreement: float, black: float, seeds: int) -> dict[str, Any]:
    """What reading a run's agents leaves: token* by stage, and the rest alike at both.

    Args:
        star: by stage, of how many seeds which token receives most attention.
        agreement: share of seeds in which that is the needed token.
        black: share of episodes that enter Black first.
        seeds: how many there are.
    """
    tokens = ["until", "not", "Red", "and", "Black", "until", "not", "Yellow", "White"]

    def of(value: float) -> dict[str, Any]:
        return {"value": value, "low": None, "high": None, "count": seeds}

    over = {
        stage: {
            "tokens": tokens,
            "token_star": counts,
            "needed_token": {"4: Black": seeds},
            "agreement": of(agreement),
            "agreement_over_rows": of(agreement),
            "rank_correlation": of(0.5),
            "first": {"Black": of(black)},
            "attention_received": [of(8 / 9)] * len(tokens),
        }
        for stage, counts in star.items()
    }
    return {"over_seeds": over, "out_projection_change": {"by_layer": [[0.1, 0.3]] * seeds}}


def played(success: Any, length: Any) -> dict[str, Any]:
    """What an evaluation found, for `write`."""
    return {"success_rate": success, "success_length": length, "violation_rate": 0.0, "discounted_return": 0.5}


def rows(text: str) -> dict[str, list[str]]:
    """The cells of every row of every table, by its first one; of two alike the later one."""
    lines = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("| ")]
    return {line[0]: line[1:] for line in lines}


def outcome(text: str, claim: str) -> str:
    """The last cell of the row of a claim."""
    return rows(text)[claim][-1]
