"""Reward machines from files: a run keeps a copy, so that it stays the same when the file is changed or moved."""

from dataclasses import replace
from pathlib import Path

from t2tl_jax.errors import UserError
from t2tl_jax.ltl.tasks import is_machine_file
from t2tl_jax.runs.config import Config


def read(config: Config) -> dict[str, bytes]:
    """The file that the task of a configuration names, by its name without folders; nothing for other tasks.

    Raises:
        UserError: if it cannot be read.
    """
    if not is_machine_file(config.task):
        return {}
    path = Path(config.task.strip())
    try:
        return {path.name: path.read_bytes()}
    except OSError as error:
        raise UserError(f"cannot read the reward machine {path}: {error.strerror or error}") from error


def with_copy(config: Config, folder: Path) -> Config:
    """The configuration with the copy in this folder of a run as its task, if there is one; earlier runs have none."""
    copy = _copy(config, folder)
    return config if copy is None else replace(config, task=str(copy))


def as_stored(config: Config, folder: Path) -> Config:
    """The same with the name of the copy only, which holds wherever the folder is moved."""
    copy = _copy(config, folder)
    return config if copy is None else replace(config, task=copy.name)


def name_of(task: str, folder: Path) -> str:
    """The task, or only the name of the file if it is the copy in this folder of a run."""
    path = Path(task.strip())
    return path.name if is_machine_file(task) and path.parent == folder.resolve() else task


def same_task(one: str, other: str) -> bool:
    """Whether two tasks are the same; files of reward machines are if they have the same name and content."""
    if one == other or not (is_machine_file(one) and is_machine_file(other)):
        return one == other
    first, second = Path(one.strip()), Path(other.strip())
    try:
        return first.name == second.name and first.read_bytes() == second.read_bytes()
    except OSError:
        return False


def _copy(config: Config, folder: Path) -> Path | None:
    if not is_machine_file(config.task):
        return None
    copy = folder.resolve() / Path(config.task.strip()).name
    return copy if copy.is_file() else None
