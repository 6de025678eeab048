"""Finished runs as the tables read them, and keeping them in the repository."""

import shutil
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from t2tl_jax.errors import UserError
from t2tl_jax.evaluation.statistics import Estimate, rate
from t2tl_jax.runs import config_files
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.folder import RunFolder, read_json
from t2tl_jax.runs.metrics_file import area, ending, history, read_columns

LAST = 0.05
"""Share of a training, at its end, over which final figures are averaged."""

FILES = (
    "config.json",
    "metrics.csv",
    "status.json",
    "versions.json",
    "evaluation.json",
    "attention.json",
    "table.json",
)
"""What is kept of a run; its checkpoints and pictures are not."""


@dataclass(frozen=True)
class Stored:
    """One finished run."""

    path: Path
    """Where its files lie."""

    @cached_property
    def config(self) -> Config:
        """What was trained."""
        return config_files.load(RunFolder(self.path).config)

    @cached_property
    def columns(self) -> dict[str, np.ndarray]:
        """The metrics file, by column."""
        return dict(read_columns(RunFolder(self.path).metrics))

    @cached_property
    def metrics(self) -> dict[str, np.ndarray]:
        """By name, float[seeds, iterations]."""
        return dict(history(RunFolder(self.path).metrics))

    @cached_property
    def status(self) -> dict[str, Any]:
        """What the run said of itself at its end."""
        return read_json(RunFolder(self.path).status)

    @cached_property
    def versions(self) -> dict[str, Any]:
        """The software, the hardware and the commit that it began with."""
        return read_json(RunFolder(self.path).versions)["started"]

    @property
    def seeds(self) -> list[int]:
        """Numbers of its seeds, in the order of the metrics."""
        return [int(seed) for seed in self.status["seeds"]]

    @property
    def frames(self) -> int:
        """Environment steps of each seed."""
        return int(self.status["frames_per_seed"])

    @property
    def train_seconds(self) -> float:
        """Of training, in all sessions, all seeds together."""
        return float(self.status["all_sessions"]["training_seconds"])

    @property
    def compile_seconds(self) -> float:
        """Of compiling, in all sessions."""
        return float(self.status["all_sessions"]["compile_seconds"])

    def end(self, name: str) -> dict[int, float]:
        """Mean of a metric over the last part of training, by seed; of episodes where it is one of episodes."""
        known = ending(self.metrics, LAST)
        if name not in known:
            values = self.metrics[name]
            known = {name: np.nanmean(values[:, -max(1, round(LAST * values.shape[1])) :], axis=1)}
        return dict(zip(self.seeds, known[name].tolist(), strict=True))

    def area(self, name: str) -> dict[int, float]:
        """Mean of a metric over the whole training, by seed: the area under its curve over the frames."""
        return dict(zip(self.seeds, area(self.metrics[name]).tolist(), strict=True))

    def played(self, which: str = "final", policy: str = "sampled", limit: int | None = None) -> dict[str, Any] | None:
        """A stored evaluation, within the run's own time limit by default; None where there is none."""
        file = RunFolder(self.path).evaluation
        for entry in read_json(file).get("evaluations", []) if file.is_file() else []:
            what = entry["settings"]
            if what["checkpoint"] == which and what["episode_length"] == (limit or self.config.episode_length):
                return entry["policies"][policy]
        return None

    def by_seed(self, name: str, **evaluation: Any) -> dict[int, float]:
        """One figure of an evaluation by seed; empty where it is not stored or unknown."""
        report = self.played(**evaluation)
        values = {} if report is None else {entry["seed"]: entry[name]["value"] for entry in report["seeds"]}
        return {seed: value for seed, value in values.items() if value is not None}

    def solved(self, limit: int | None = None) -> Estimate:
        """Share of seeds whose final parameters succeed in over 95 % of the sampled episodes."""
        rates = self.by_seed("success_rate", limit=limit)
        return rate(sum(value > 0.95 for value in rates.values()), len(rates))


def load(root: Path) -> dict[str, Stored]:
    """The finished runs in a folder, by name."""
    return {path.parent.name: Stored(path.parent) for path in sorted(root.glob("*/status.json"))}


def keep(name: str, source: Path, target: Path) -> None:
    """Copy what the tables need of a finished run into the repository.

    Raises:
        UserError: if it was not made from a commit as it stands.
    """
    versions = read_json(RunFolder(source).versions)
    for session in (versions["started"], *versions.get("resumed", [])):
        if not session.get("git_revision") or session.get("git_modified"):
            raise UserError(
                f"{name} was not made from a clean commit (revision {session.get('git_revision')}, modified: "
                f"{session.get('git_modified')}); results that are kept need one"
            )
    shutil.rmtree(target, ignore_errors=True)
    target.mkdir(parents=True)
    for file in FILES:
        if (source / file).is_file():
            shutil.copyfile(source / file, target / file)
