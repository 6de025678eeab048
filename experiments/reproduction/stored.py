"""Finished runs as the tables read them, and keeping them in the repository."""

import shutil
import subprocess
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import jax
import numpy as np

from experiments import tuning
from experiments.fairness import Sizes, sizes
from experiments.reproduction.portable import portable
from t2tl_jax.errors import UserError
from t2tl_jax.evaluation.statistics import Estimate, rate
from t2tl_jax.runs import config_files, params_file, source_tree, train
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.folder import RunFolder, read_json, write_json
from t2tl_jax.runs.metrics_file import area, as_curves, ending, read_columns, write_compressed
from t2tl_jax.runs.result import Result
from t2tl_jax.training.seeds import FIRST_TUNING_SEED, parse_seeds

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
    "tested.json",
)
"""What is kept of a run; its checkpoints and pictures are not."""

ALREADY_SMALL = ("tested.json",)
"""Of these, what names no folder and is written in few lines."""

REPOSITORY = Path(__file__).parents[2]

MOST_ITERATIONS = 60
"""Iterations of a curve that are kept of the runs of agents for any task, which are many; and so many of its end."""

MOST_OF_SEARCH = 32
"""The same of the runs of a search, of which only the end is compared; that is shorter, so that all of it is kept."""

MOST_MEBIBYTES = 2
"""Size up to which a file of parameters is kept; WaterWorld's are larger, but for the final ones in half precision."""


SIZES = "sizes.json"
"""What a run's networks come to, counted when it is kept."""


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
        return as_curves(self.columns)[1]

    @cached_property
    def evaluations(self) -> list[dict[str, Any]]:
        """Its stored evaluations."""
        file = RunFolder(self.path).evaluation
        return read_json(file).get("evaluations", []) if file.is_file() else []

    @cached_property
    def status(self) -> dict[str, Any]:
        """What the run said of itself at its end."""
        return read_json(RunFolder(self.path).status)

    @cached_property
    def versions(self) -> dict[str, Any]:
        """The software, the hardware and the commit that it began with."""
        return read_json(RunFolder(self.path).versions)["started"]

    @property
    def sizes(self) -> Sizes | None:
        """Of its networks; None for a run that was kept without them."""
        file = self.path / SIZES
        return Sizes(**read_json(file)) if file.is_file() else None

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
        iterations = np.unique(self.columns["iteration"])
        kept = max(1, int((iterations > iterations[-1] - last_ones(int(iterations[-1]))).sum()))
        known = ending(self.metrics, kept / len(iterations))
        if name not in known:
            known = {name: np.nanmean(self.metrics[name][:, -kept:], axis=1)}
        return dict(zip(self.seeds, known[name].tolist(), strict=True))

    def area(self, name: str) -> dict[int, float]:
        """Mean of a metric over the whole training, by seed: the area under its curve over the frames.

        Where only some iterations are kept, each stands for those since the one before.
        """
        iterations = np.unique(self.columns["iteration"])
        values = area(self.metrics[name], np.diff(iterations, prepend=0))
        return dict(zip(self.seeds, values.tolist(), strict=True))

    def played(self, which: str = "final", policy: str = "sampled", limit: int | None = None) -> dict[str, Any] | None:
        """A stored evaluation, within the run's own time limit by default; None where there is none."""
        for entry in self.evaluations:
            what = entry["settings"]
            if what["checkpoint"] == which and what["episode_length"] == (limit or self.config.episode_length):
                return entry["policies"][policy]
        return None

    def by_seed(self, name: str, **evaluation: Any) -> dict[int, float]:
        """One figure of an evaluation by seed; empty where it is not stored or unknown."""
        report = self.played(**evaluation)
        values = {} if report is None else {entry["seed"]: entry[name]["value"] for entry in report["seeds"]}
        return {seed: value for seed, value in values.items() if value is not None}

    def solved(self, limit: int | None = None, policy: str = "sampled") -> Estimate:
        """Share of seeds whose final parameters succeed in over 95 % of the episodes; *solved* means sampled ones."""
        rates = self.by_seed("success_rate", policy=policy, limit=limit)
        return rate(sum(value > 0.95 for value in rates.values()), len(rates))


def last_ones(iterations: int) -> int:
    """How many iterations of a training are its last part."""
    return max(1, round(LAST * iterations))


def unclean(session: Mapping[str, Any]) -> str:
    """Why nobody can make again what a session made, by what it stored of its versions; '' if they can."""
    if not session.get("git_revision"):
        return "its commit is not known"
    if session.get("git_modified") is None:
        return "whether its tree differed from its commit is not known"
    difference = source_tree.difference(session)
    return f"its source tree {difference}" if difference else ""


def load(root: Path) -> dict[str, Stored]:
    """The finished runs in a folder, by name."""
    return {path.parent.name: Stored(path.parent) for path in sorted(root.glob("*/status.json"))}


def keep(
    name: str,
    source: Path,
    target: Path,
    agent: bool = False,
    say: Callable[[str], None] = print,
    repository: Path = REPOSITORY,
    most: int | None = None,
    every_world: bool = False,
    search: bool = False,
) -> None:
    """Copy what the tables need of a finished run into the repository.

    Args:
        name: of the run.
        source: its folder.
        target: where to.
        agent: whether to keep the final and the best parameters of its first seed too, if they are small.
        say: told of parameters that are too large.
        repository: the checkout whose history must hold the commit that made the run.
        most: so many iterations of its metrics are kept at most, evenly spaced and as they are, and as many of the last
            part; None for all.
        every_world: whether its seeds are all the worlds that there are, so that those of a search are among them; the
            page then says which these are.
        search: whether it is a run of a search itself, which must be on seeds that are kept for tuning.

    Raises:
        UserError: if it was not made from a commit of this history as it stands, or on seeds that settings were chosen
            on, or that are kept for that; or a run of a search if it is on others.
    """
    _check_seeds(name, source, every_world, search)
    versions = read_json(RunFolder(source).versions)
    for session in (versions["started"], *versions.get("resumed", [])):
        if why := unclean(session):
            raise UserError(
                f"{name} was not made from a clean commit: {why}; results that are kept need one. Commit what was kept "
                "before, if that is all, and make the run again"
            )
        _check_history(name, session["git_revision"], repository)
    result = train.load(source) if agent else None
    shutil.rmtree(target, ignore_errors=True)
    target.mkdir(parents=True)
    for file in FILES:
        if file == RunFolder(source).metrics.name and (source / file).is_file():
            _copy_metrics(source / file, target / file, most)
        elif file in ALREADY_SMALL and (source / file).is_file():
            shutil.copyfile(source / file, target / file)
        elif (source / file).suffix == ".json" and (source / file).is_file():
            content = portable(read_json(source / file), source.resolve(), repository.resolve())
            if file == "config.json":
                content["run"]["compilation_cache"] = ""  # a folder of that machine, too
            write_json(target / file, content)
        elif (source / file).is_file():
            shutil.copyfile(source / file, target / file)
    if result is not None:
        _keep_parameters(name, result, RunFolder(target).params, say)


def keep_sizes(folder: Path) -> None:
    """Count what the networks of a kept run come to, which takes seconds, and write it beside its other files."""
    if (config := RunFolder(folder).config).is_file():
        write_json(folder / SIZES, asdict(sizes(config_files.load(config))))


def _copy_metrics(source: Path, target: Path, most: int | None) -> None:
    """Compress a file of metrics: every n-th iteration if there are more than `most`, and of the last part, by which
    `end` measures, every m-th if there are more than `most` there; n and m are powers of two or 1."""
    header, *rows = source.read_text(encoding="utf-8").splitlines()
    at = header.split(",").index("iteration")
    iterations = [int(float(row.split(",")[at])) for row in rows]
    count = max(iterations, default=0)
    last = last_ones(count)
    step, closer = _step(count, most), _step(last, most)
    kept = [
        row
        for row, iteration in zip(rows, iterations, strict=True)
        if iteration % (closer if iteration > count - last else step) == 0
    ]
    write_compressed(target, "\n".join([header, *kept]) + "\n")


def _step(count: int, most: int | None) -> int:
    """The least power of two such that every so many-th of `count` iterations are `most` at most; 1 for None."""
    step = 1
    while most is not None and count > most * step:
        step *= 2
    return step


def _check_seeds(name: str, source: Path, every_world: bool, search: bool) -> None:
    if every_world or not RunFolder(source).config.is_file():
        return
    config = config_files.load(RunFolder(source).config)
    if search:
        if reported := [seed for seed in parse_seeds(config.seeds) if seed < FIRST_TUNING_SEED]:
            raise UserError(
                f"{name} is a search and was made with seeds {tuning.in_words(reported)}, on which results are "
                f"reported; a search has those from {FIRST_TUNING_SEED} on"
            )
        return
    if used := tuning.tuning_seeds(config, parse_seeds(config.seeds)):
        raise UserError(
            f"{name} was made with seeds {tuning.in_words(used)}, on which settings were chosen or which are kept for "
            f"that (from {FIRST_TUNING_SEED} on); results are kept of others, such as --seeds "
            f"{tuning.for_report(config)}"
        )


def _check_history(name: str, revision: str, repository: Path) -> None:
    """Refuse a result whose commit cannot be looked up later: one that no commit at hand follows."""
    command = ["git", "-C", str(repository), "merge-base", "--is-ancestor", revision, "HEAD"]
    try:
        answer = subprocess.run(command, capture_output=True, text=True, timeout=60)
    except (OSError, subprocess.SubprocessError) as error:
        raise UserError(f"git cannot be asked for the commit that {name} was made from: {error}") from error
    if answer.returncode == 1:
        raise UserError(
            f"{name} was made from commit {revision}, which is not in the history of what is checked out; results "
            "that are kept need one that is: check out a branch that holds it, or make the run again"
        )
    if answer.returncode:
        raise UserError(f"git does not know commit {revision}, which {name} was made from: {answer.stderr.strip()}")


def _keep_parameters(name: str, result: Result, file: Path, say: Callable[[str], None]) -> None:
    """Store the parameters of a run's first seed, unless the file would be too large for the repository: all of them,
    or the final ones alone in half precision."""
    first = {which: jax.tree.map(lambda leaf: leaf[:1], params) for which, params in result.params.items()}
    params_file.write(file, first, result.seeds[:1], result.iteration)
    if _mebibytes(file) <= MOST_MEBIBYTES:
        return
    params_file.write(file, {"final": first["final"]}, result.seeds[:1], result.iteration, half=True)
    if (size := _mebibytes(file)) <= MOST_MEBIBYTES:
        say(f"{name}: the final parameters alone are kept, in half precision, {size:.1f} MiB for one seed")
        return
    file.unlink()
    say(f"{name}: parameters are not kept, {size:.1f} MiB for one seed where {MOST_MEBIBYTES} are the most")


def _mebibytes(file: Path) -> float:
    return file.stat().st_size / 2**20
