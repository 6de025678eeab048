"""Configurations that differ only in numbers, trained side by side in one program.

While it trains, the group has a folder with checkpoints of its own. Its metrics call each training by the number of its
lane: those of the first configuration's seeds, then those of the second one's, and so on. When it has ended, every
configuration becomes an ordinary run, see `group_split.py`.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

from t2tl_jax.env import LabelledEnv
from t2tl_jax.errors import UserError, explained
from t2tl_jax.runs import config_files, group_split, machine_files, pretraining, sessions
from t2tl_jax.runs import folder as run_folder
from t2tl_jax.runs.callbacks import Callback
from t2tl_jax.runs.checkpoints import Checkpoints
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.differences import without_numbers
from t2tl_jax.runs.experiment import Experiment, build
from t2tl_jax.runs.folder import RunFolder
from t2tl_jax.runs.interrupts import NeverStop, Stoppable
from t2tl_jax.runs.training import ENDS
from t2tl_jax.training.numbers import numbers_of
from t2tl_jax.training.seeds import parse_seeds

CONTENT = "group.json"
"""File in the folder of a group that says what is trained there."""


@dataclass(frozen=True)
class Group(Experiment):
    """What several configurations of one program stand for; `config` is the first of them."""

    variants: tuple[Config, ...] = ()
    """The configurations."""

    @property
    def seeds(self) -> tuple[int, ...]:
        """The seed of every lane."""
        return self.seeds_of_one * len(self.variants)

    @property
    def seeds_of_one(self) -> tuple[int, ...]:
        """The seeds of a configuration, which all of them have."""
        return parse_seeds(self.config.seeds)

    @property
    def lanes(self) -> tuple[int, ...]:
        """Numbers of the lanes, since seeds repeat."""
        return tuple(range(len(self.seeds)))

    @property
    def numbers(self) -> list[dict[str, float]]:
        """The numbers of each lane."""
        own = [numbers_of(variant.learner, variant.random_starts) for variant in self.variants]
        return [numbers for numbers in own for _ in self.seeds_of_one]


def same_program(one: Config, other: Config) -> bool:
    """Whether two configurations differ at most in numbers that only enter arithmetic, and in `run`."""
    return without_numbers(one) == without_numbers(replace(other, run=one.run))


def make_group(variants: Sequence[Config], env: LabelledEnv | None = None) -> Group:
    """The experiment of configurations that share a program; `env` is the environment, where it is given.

    Raises:
        UserError: if they do not, or cannot be trained.
    """
    first = variants[0]
    if not all(same_program(first, other) for other in variants):
        raise UserError("these configurations differ in more than numbers that only enter arithmetic; train them apart")
    experiment = build(first, env)
    return Group(**{field.name: getattr(experiment, field.name) for field in fields(experiment)}, variants=(*variants,))


def train_group(
    runs: Mapping[Path, Config],
    base: Path,
    *,
    env: LabelledEnv | None = None,
    callbacks: Sequence[Callback] = (),
    pretraining_callbacks: Sequence[Callback] = (),
    stop: Stoppable | None = None,
    command: Sequence[str] | None = None,
) -> str:
    """Train configurations of one program, or go on with it, and leave an ordinary run of each when they are done.

    The group ends early (`until_solved`, `convergence`) when every seed of every configuration is to end.

    Args:
        runs: by the folder that each run is to have, which is not there yet.
        base: where the group has its folder meanwhile.
        env: the environment itself, where it is given instead of named.
        callbacks, pretraining_callbacks, stop, command: as for `train`.

    Returns:
        Why the training ended; the runs are there if it is one of `ENDS`.

    Raises:
        UserError: for anything that cannot be used, before any work is done.
        Interrupted: if `stop` asked for it before the first iteration was complete.
    """
    session = sessions.Session(callbacks, pretraining_callbacks, stop or NeverStop(), command)
    with explained():
        located = {path: pretraining.located(config) for path, config in runs.items()}
        group = RunFolder(group_folder(runs, base))
        with Checkpoints(group.checkpoints) as checkpoints:
            begun = checkpoints.latest_iteration() is not None
        experiment, before = session.stop.call(
            lambda: sessions.checked(make_group(tuple(located.values()), env), None, begun), "while preparing"
        )
        assert isinstance(experiment, Group)
        group.path.mkdir(parents=True, exist_ok=True)
        with run_folder.locked(group):
            if group.versions.is_file():
                sessions.note_resumed(group, session)
            else:
                run_folder.write_text(group.path / CONTENT, _content(runs))
                run_folder.write_json(group.versions, {"started": session.versions})
            ended = sessions.trained(experiment, group, session, before).ended
            if ended in ENDS:
                group_split.split(experiment, group, located)
        return ended


def group_folder(runs: Mapping[Path, Config], base: Path) -> Path:
    """Where a group trains: another folder for other configurations, so that the same ones find theirs again."""
    return base / f"group-{hashlib.sha256(_content(runs).encode()).hexdigest()[:12]}"


def _content(runs: Mapping[Path, Config]) -> str:
    """What a group trains, as JSON: names and configurations, without what happens around the training."""
    content = [
        {
            "name": path.name,
            "config": {k: v for k, v in json.loads(config_files.to_json(config)).items() if k != "run"},
            "files": {name: hashlib.sha256(data).hexdigest() for name, data in machine_files.read(config).items()},
        }
        for path, config in runs.items()
    ]
    return json.dumps(content, indent=2, ensure_ascii=False) + "\n"
