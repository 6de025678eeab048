"""The file that ``--json`` names: looked at before anything is measured, and written at the end.

Until then what is measured so far may stand in a file beside it, so that what is stopped neither loses it nor leaves a
whole file of an earlier time in pieces.
"""

import sys
from collections.abc import Sequence
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

from t2tl_jax.errors import UserError
from t2tl_jax.runs import source_tree


def check(file: Path | None) -> None:
    """Refuse a file that cannot be written, if one is named. What it will say of the source tree is looked up now, and
    that the tree differs from its commit is printed: the project keeps no results of such a tree.

    Raises:
        UserError: if its folder is not there.
    """
    if file is not None and not file.absolute().parent.is_dir():
        raise UserError(f"--json {file}: there is no folder {file.parent}; make it first")
    difference = source_tree.difference(_tree())
    if file is not None and difference:
        print(f"note: the source tree {difference}: its results are not kept", file=sys.stderr)


def where(command: Sequence[str]) -> dict[str, Any]:
    """Where and by which command something was measured, with the source tree as `check` found it."""
    from t2tl_jax.runs import provenance  # which loads JAX, for which mistakes need not wait

    return provenance.describe(command) | _tree()


@cache
def _tree() -> dict[str, Any]:
    """The source tree at the beginning: other commands may change it while this one measures."""
    return source_tree.describe()


def unfinished(file: Path) -> Path:
    """The file beside it for what is measured so far."""
    return file.with_name(f"{file.name}.part")


def write(file: Path, content: Any) -> None:
    """Write what JSON can hold, whole or not at all.

    Raises:
        UserError: if that fails.
    """
    from t2tl_jax.runs.folder import write_json  # which loads JAX, for which mistakes need not wait

    try:
        write_json(file, content)
    except OSError as error:
        raise UserError(f"cannot write {file}: {error.strerror or error}") from error


def store(arguments: Any, command: str, texts: Sequence[str], **found: Any) -> None:
    """Write what was found, where and with which settings, to the file that the arguments' ``json`` names, if any.

    Args:
        arguments: the dataclass of the command.
        command: its module, such as `experiments.benchmarks.tables`.
        texts: what was typed behind it.
        **found: what was measured, by name.

    Raises:
        UserError: if that fails.
    """
    if arguments.json is None:
        return
    write(arguments.json, _content(arguments, command, texts, found))
    unfinished(arguments.json).unlink(missing_ok=True)
    print(f"written: {arguments.json}")


def store_so_far(arguments: Any, command: str, texts: Sequence[str], **found: Any) -> None:
    """`store` of what is not all yet, in the file beside (`unfinished`), which `store` removes."""
    if arguments.json is not None:
        write(unfinished(arguments.json), _content(arguments, command, texts, found))


def _content(arguments: Any, command: str, texts: Sequence[str], found: dict[str, Any]) -> dict[str, Any]:
    settings = {name: value for name, value in asdict(arguments).items() if name != "json"}
    return {"where": where(["python", "-m", command, *texts]), "settings": settings, **found}
