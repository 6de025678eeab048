"""The points of a sweep trained, one program after another; what is there already is left as it is."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from experiments.cli.grid import Point
from experiments.cli.words import Words
from experiments.sweeps.cluster import Cluster
from experiments.sweeps.plan import PROG
from t2tl_jax.errors import UserError
from t2tl_jax.runs import folder as run_folder
from t2tl_jax.runs import pretraining
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.group import CONTENT, ENDS, group_folder, same_program, train_group
from t2tl_jax.runs.interrupts import Interrupted, Stoppable
from t2tl_jax.runs.progress_bar import ProgressBar


@dataclass(frozen=True)
class Work:
    """Who trains the points of a sweep."""

    base: Path
    """The folder of the sweep."""
    stop: Stoppable
    """Who may ask to stop."""
    command: Sequence[str]
    """The words of the command line, but for those that hand it to other processes."""
    started: float
    """When the program began, by ``time.monotonic``."""
    only: Sequence[int] | None = None
    """The numbers of the points that this process trains, for another one that has the table; None for all."""
    cluster: Cluster | None = None
    """Who trains instead of this process."""

    def train(self, runs: Mapping[Path, Point], numbers: Sequence[int]) -> None:
        """Train what is not there yet.

        Args:
            runs: points by the folders of their runs.
            numbers: those of the points, in the order of the runs.

        Raises:
            Interrupted: saying when the user stopped it.
            UserError: for a folder that holds something else, and for jobs that did not come to their end.
        """
        number_of = dict(zip(runs, numbers, strict=True))
        if self.only is not None:
            runs = {path: point for path, point in runs.items() if number_of[path] in self.only}
        begun, groups = self._groups(runs)
        if self.cluster is not None:
            self._hand_over([*begun, *parts(groups, self.cluster.workers)], number_of)
            return
        groups = [*begun, *groups]
        for number, group in enumerate(groups, start=1):
            print(f"program {number} of {len(groups)}, {len(group)} points side by side with their seeds:")
            print(*(f"  {runs[path].label}" for path in group), sep="\n", flush=True)
            if self._train_group(group) not in ENDS:
                raise Interrupted(f"in program {number} of {len(groups)}")

    def _groups(self, runs: Mapping[Path, Point]) -> tuple[list[dict[Path, Config]], list[dict[Path, Config]]]:
        """The groups that were begun and are gone on with, and new ones of the other points.

        A group that was stopped while its runs were written has some of them already. It is still the group of all of
        its points, which leaves what is there as it is.
        """
        begun = []
        left = missing(runs)
        for folder in sorted(self.base.glob("group-*")):
            paths = [self.base / name for name in names(folder)]
            group = {path: runs[path].config for path in paths if path in runs}
            same = bool(group) and len(group) == len(paths) and group_folder(group, self.base) == folder
            if same and any(path in left for path in group):
                begun.append(group)
                left = {path: config for path, config in left.items() if path not in group}
            elif self.only is None:
                what = "left of a group whose runs are all there" if same else "an unfinished group of other points"
                print(f"note: {folder} is {what}, which this sweep does not use")
        return begun, programs(left)

    def _hand_over(self, groups: Sequence[Mapping[Path, Config]], numbers: Mapping[Path, int]) -> None:
        """Let jobs train groups of points, each of which is one program."""
        assert self.cluster is not None
        if not groups:
            return
        self.base.mkdir(parents=True, exist_ok=True)
        for number, group in enumerate(groups, start=1):
            print(f"job {number} of {len(groups)}: {', '.join(path.name for path in group)}", flush=True)
        words = [[*self.command, "--only", ",".join(str(numbers[path]) for path in group)] for group in groups]
        failed = self.cluster.run(
            words, self.base, self.stop, lambda number: all(path.exists() for path in groups[number])
        )
        if failed and self.stop.requested:
            raise Interrupted(f"with {len(groups) - len(failed)} of {len(groups)} jobs done")
        if failed:
            raise UserError(
                f"{len(failed)} of {len(groups)} jobs did not finish; give the same command again to continue"
            )

    def _train_group(self, group: Mapping[Path, Config]) -> str:
        """Train one program; why it ended."""
        bar = [ProgressBar()] if next(iter(group.values())).run.progress else []
        return train_group(
            group,
            self.base,
            callbacks=[Words(self.started, "group"), *bar],
            pretraining_callbacks=[Words(self.started, "first"), *bar],
            stop=self.stop,
            command=[*PROG.split(), *self.command],
        )


def missing(runs: Mapping[Path, Point]) -> dict[Path, Config]:
    """The configurations that are no ordinary runs yet; UserError if a folder holds something else."""
    return {path: point.config for path, point in runs.items() if not _is_done(path, point.config)}


def programs(configs: Mapping[Path, Config]) -> list[dict[Path, Config]]:
    """Configurations by program, in their order."""
    groups: list[dict[Path, Config]] = []
    for path, config in configs.items():
        for group in groups:
            if same_program(next(iter(group.values())), config):
                group[path] = config
                break
        else:
            groups.append({path: config})
    return groups


def parts(groups: Sequence[Mapping[Path, Config]], workers: int) -> list[dict[Path, Config]]:
    """Programs taken apart, so that there is work for so many processes where there are as many points."""
    pieces = -(-workers // max(1, len(groups)))
    return [
        {path: group[path] for path in list(group)[piece::pieces]}
        for group in groups
        for piece in range(min(pieces, len(group)))
    ]


def names(folder: Path) -> list[str]:
    """The names of the points that a group trains; none if its folder does not say."""
    try:
        content = json.loads((folder / CONTENT).read_text(encoding="utf-8"))
        return [str(point["name"]) for point in content]
    except (OSError, ValueError, TypeError, KeyError, RecursionError):
        return []


def _is_done(path: Path, config: Config) -> bool:
    """Whether a point is an ordinary run by now; UserError if its folder holds something else."""
    if not path.exists():
        return False
    stored = run_folder.open_existing(path)[1]
    if not pretraining.same_run(stored, pretraining.located(config)):
        raise UserError(f"{path} holds a run of other settings or seeds; move it away, or take another --folder")
    return True
