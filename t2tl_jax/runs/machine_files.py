"""Reward machines from files: a run keeps a copy, so that it stays the same when the file is changed or moved.

What is read of a stored run is the copy alone, never another file of the machine that its configuration names.
"""

from dataclasses import replace
from pathlib import Path

from t2tl_jax.errors import UserError
from t2tl_jax.ltl import TaskFamily
from t2tl_jax.ltl.tasks import is_machine_file
from t2tl_jax.runs.config import Config


def read(config: Config) -> dict[str, bytes]:
    """The file that the task of a configuration names, by its name without folders; nothing for other tasks.

    Raises:
        UserError: if it cannot be read.
    """
    path = _file(config.task)
    if path is None:
        return {}
    try:
        return {path.name: path.read_bytes()}
    except OSError as error:
        raise UserError(f"cannot read the reward machine {path}: {error.strerror or error}") from error


def with_copy(config: Config, folder: Path) -> Config:
    """The configuration with the copy in this folder of a run as its task, where its task comes from a file.

    Raises:
        UserError: if there is no copy.
    """
    path, copy = _file(config.task), _copy(config, folder)
    if path is not None and copy is None:
        raise UserError(
            f"the task is the reward machine {path}, and {folder} holds no copy of it; what a stored configuration "
            f"names elsewhere is not read. If you know that file, copy it there: cp {path} {folder / path.name}"
        )
    return config if copy is None else replace(config, task=str(copy))


def as_stored(config: Config, folder: Path) -> Config:
    """The same with the name of the copy only, which holds wherever the folder is moved."""
    copy = _copy(config, folder)
    return config if copy is None else replace(config, task=copy.name)


def name_of(task: str | TaskFamily, folder: Path) -> str:
    """The task, or only the name of the file if it is the copy in this folder of a run."""
    path = _file(task)
    return str(task) if path is None or path.parent != folder.resolve() else path.name


def same_task(one: str | TaskFamily, other: str | TaskFamily) -> bool:
    """Whether two tasks are the same; files of reward machines are if they have the same name and content."""
    first, second = _file(one), _file(other)
    if one == other or first is None or second is None:
        return one == other
    try:
        return first.name == second.name and first.read_bytes() == second.read_bytes()
    except OSError:
        return False


def _copy(config: Config, folder: Path) -> Path | None:
    path = _file(config.task)
    copy = None if path is None else folder.resolve() / path.name
    return copy if copy is not None and copy.is_file() and not copy.is_symlink() else None


def _file(task: str | TaskFamily) -> Path | None:
    return Path(task.strip()) if isinstance(task, str) and is_machine_file(task) else None
