"""The points of a sweep trained, one program after another; what is there already is left as it is."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from experiments.cli.grid import Point
from experiments.cli.words import Words
from t2tl_jax.errors import UserError
from t2tl_jax.runs import folder as run_folder
from t2tl_jax.runs import pretraining
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.group import ENDS, group_folder, same_program, train_group
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
    """For the record of the runs."""
    started: float
    """When the program began, by ``time.monotonic``."""

    def train(self, runs: Mapping[Path, Point]) -> None:
        """Train what is not there yet, of points by the folders of their runs.

        Raises:
            Interrupted: saying when the user stopped it.
            UserError: for a folder that holds something else.
        """
        groups = programs(missing(runs))
        ours = [group_folder(group, self.base) for group in groups]
        for other in sorted(self.base.glob("group-*")):
            if other not in ours:
                print(f"note: {other} is an unfinished group of other points, which nothing here goes on with")
        for number, group in enumerate(groups, start=1):
            print(f"program {number} of {len(groups)}, {len(group)} points side by side with their seeds:")
            print(*(f"  {runs[path].label}" for path in group), sep="\n", flush=True)
            if self._train_group(group) not in ENDS:
                raise Interrupted(f"in program {number} of {len(groups)}")

    def _train_group(self, group: Mapping[Path, Config]) -> str:
        """Train one program; why it ended."""
        bar = [ProgressBar()] if next(iter(group.values())).run.progress else []
        return train_group(
            group,
            self.base,
            callbacks=[Words(self.started, "group"), *bar],
            pretraining_callbacks=[Words(self.started, "first"), *bar],
            stop=self.stop,
            command=self.command,
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


def _is_done(path: Path, config: Config) -> bool:
    """Whether a point is an ordinary run by now; UserError if its folder holds something else."""
    if not path.exists():
        return False
    stored = run_folder.open_existing(path)[1]
    if not pretraining.same_run(stored, pretraining.located(config)):
        raise UserError(f"{path} holds a run of other settings or seeds; move it away, or take another --folder")
    return True
