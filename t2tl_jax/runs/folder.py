"""The folder of a run: what it is called, what lies in it, and who may write to it."""

import fcntl
import itertools
import json
import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import Any

from t2tl_jax.errors import UserError
from t2tl_jax.runs import config_files, machine_files
from t2tl_jax.runs.config import Config


class RunFolder:
    """Names of the files of a run."""

    def __init__(self, path: Path) -> None:
        self.path = Path(path)
        self.config = self.path / "config.json"
        self.versions = self.path / "versions.json"
        self.status = self.path / "status.json"
        self.metrics = self.path / "metrics.csv"
        self.checkpoints = self.path / "checkpoints"
        self.params = self.path / "params.npz"
        self.curves = self.path / "learning_curve.png"
        self.gif = self.path / "episode.gif"
        self.evaluation = self.path / "evaluation.json"
        self.certificates = self.path / "certificates.json"


_STAMP = r"\d{4}-\d\d-\d\d_\d\d-\d\d-\d\d(_\d+)?"
"""The time in the names that `new_path` makes."""


def new_path(base: Path, name: str) -> Path:
    """A folder ``base/name/<time>`` that does not exist yet."""
    stamp = datetime.now().strftime("%Y-%m-%d_%H-%M-%S")
    parent = Path(base).expanduser() / name
    return next(
        path
        for path in (parent / (stamp if attempt == 1 else f"{stamp}_{attempt}") for attempt in itertools.count(1))
        if not path.exists()
    )


def name_of(file: Path) -> str:
    """What runs of a configuration in a file are called: as the file is, or as the run that a ``config.json`` is of,
    which lies in ``NAME/<time>`` or in a folder NAME."""
    if file.name != RunFolder(file.parent).config.name:
        return file.stem
    folder = file.parent.resolve()
    return (folder.parent.name if re.fullmatch(_STAMP, folder.name) else folder.name) or file.stem


def check_new(path: Path) -> Path:
    """The folder of a run that is to be made; UserError if something is in it already."""
    path = Path(path).expanduser()
    if path.is_dir() and any(path.iterdir()):
        hint = " (resume continues a run)" if (path / "config.json").exists() else ""
        raise UserError(f"{path} is not empty{hint}; a new run needs a folder of its own")
    return path


def create(path: Path, config: Config, versions: dict[str, Any]) -> RunFolder:
    """Make the folder of a new run, with the resolved configuration and the versions.

    A task from a file is copied; see ``machine_files.with_copy`` for the configuration that means the copy.

    Raises:
        UserError: if it cannot be written, or is there already with something in it.
    """
    path = check_new(path)
    config_files.to_json(config)  # refuses what cannot be stored, before anything is written
    machine = machine_files.read(config)
    # Under another name until it is whole: a process that is killed here leaves nothing that is half a run, and of two
    # that choose the same name one is told.
    place = path if path.exists() else path.with_name(f".{path.name}.{os.getpid()}")
    try:
        place.mkdir(parents=True, exist_ok=True)
        folder = RunFolder(place)
        for name, copied in machine.items():
            (place / name).write_bytes(copied)
        write_json(folder.versions, {"started": versions})
        write_config(folder, config)
        if place != path:
            place.rename(path)
        return RunFolder(path)
    except OSError as error:
        if place != path:
            shutil.rmtree(place, ignore_errors=True)
            check_new(path)
        raise UserError(f"cannot create a run in {path}: {error.strerror or error}; give another folder") from error


def write_config(folder: RunFolder, config: Config) -> None:
    """Store the configuration of a run."""
    write_text(folder.config, config_files.to_json(machine_files.as_stored(config, folder.path)))


def open_existing(path: Path) -> tuple[RunFolder, Config]:
    """The folder and the configuration of an earlier run; its task is the run's own copy if it comes from a file.

    Raises:
        UserError: if it is not a run, with the runs that lie nearby, if it holds a link, if its configuration does not
            fit this version, or if its task comes from a file of which it has no copy.
    """
    folder = RunFolder(path)
    if not folder.path.is_dir():
        raise UserError(f"there is no folder {path}{_runs_near(folder.path)}")
    if not folder.config.is_file():
        raise UserError(f"{path} is not a run: it has no {folder.config.name}{_runs_near(folder.path)}")
    _check_files(folder.path)
    return folder, machine_files.with_copy(config_files.load(folder.config), folder.path)


def _check_files(path: Path) -> None:
    """Refuse a run in which something is a symbolic link: one from a stranger could lead anywhere, to be read or
    written. The folder itself may be reached by one. What is no file at all is refused too: who reads a pipe may wait
    forever."""
    for parent, folders, files in os.walk(path.resolve()):
        for name in (*folders, *files):
            if (found := Path(parent, name)).is_symlink():
                raise UserError(
                    f"{found} is a link to {os.readlink(found)}; a run holds none, since it would be read and written "
                    "elsewhere. If it is yours, put in its place what it leads to"
                )
        for name in files:
            if not (found := Path(parent, name)).is_file():
                raise UserError(f"{found} is neither a file nor a folder; a run holds nothing else")


@contextmanager
def locked(folder: RunFolder) -> Iterator[None]:
    """Keep other processes from training in the same folder. The lock ends with the process, however it ends.

    Raises:
        UserError: if another process holds it, or the folder cannot be written.
    """
    try:
        file = open(folder.path / ".lock", "w", encoding="utf-8")  # noqa: SIM115, closed below
    except OSError as error:
        raise UserError(f"cannot write to {folder.path}: {error.strerror}") from error
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise UserError(f"another process is training in {folder.path}") from error
        yield


@contextmanager
def writing(what: Path) -> Iterator[None]:
    """Around what a training writes: a full or broken disk becomes a `UserError` that says how the run goes on."""
    try:
        yield
    except OSError as error:
        raise UserError(
            f"cannot write {what}: {error.strerror or error}\n"
            "What the last checkpoint holds is safe: make room or mend the disk, and resume the run."
        ) from error


def write_text(path: Path, text: str) -> None:
    """Write a file whole or not at all, also if the machine loses its power."""
    temporary = path.with_name(path.name + ".tmp")
    with open(temporary, "w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
    os.replace(temporary, path)


def write_json(path: Path, content: Any) -> None:
    """Write indented JSON, whole or not at all."""
    write_text(path, json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n")


def read_json(path: Path) -> dict[str, Any]:
    """Read a JSON object of a run; an empty one if the file does not exist.

    Raises:
        UserError: if it holds something else.
    """
    try:
        content = json.loads(config_files.read_text(path))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as error:
        raise UserError(f"cannot read {path}: {error}") from error
    except RecursionError as error:
        raise UserError(f"cannot read {path}: it is nested too deeply") from error
    if not isinstance(content, dict):
        raise UserError(f"{path} should hold a JSON object")
    return content


def _runs_near(path: Path) -> str:
    """Up to five newest runs below the given path or its nearest existing parent."""
    start = path
    while not start.is_dir() and start != start.parent:
        start = start.parent
    found = sorted(
        (run.parent for pattern in ("config.json", "*/config.json", "*/*/config.json") for run in start.glob(pattern)),
        key=lambda run: run.name,
    )
    if not found:
        return "; a run is a folder such as runs/zone_ppo/2026-01-31_12-00-00"
    return "\nRuns nearby:\n  " + "\n  ".join(map(str, found[-5:]))
