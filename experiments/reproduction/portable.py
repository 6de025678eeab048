"""JSON of a run without the folders of the machine that made it, as it is kept in the repository."""

from pathlib import Path
from typing import Any


def portable(content: Any, run: Path, repository: Path) -> Any:
    """The same content, its absolute paths rewritten.

    What lies beside the run becomes ``../NAME``, what lies in the repository relative to it, and of anything else only
    the name is left. Paths are whole texts, or what a flag is set to (``--folder=/tmp/runs``).

    Args:
        content: what JSON can hold.
        run: the folder of the run, absolute.
        repository: the root of the checkout that made it, absolute.
    """
    if isinstance(content, dict):
        return {name: portable(value, run, repository) for name, value in content.items()}
    if isinstance(content, list):
        return [portable(value, run, repository) for value in content]
    if not isinstance(content, str):
        return content
    words = content.split(" ") if content.startswith("-") else [content]
    return " ".join(_word(word, run, repository) for word in words)


def _word(word: str, run: Path, repository: Path) -> str:
    flag, equals, text = word.rpartition("=") if word.startswith("-") else ("", "", word)
    path = Path(text)
    if not path.is_absolute():
        return word
    if path.parent == run.parent:
        return f"{flag}{equals}../{path.name}"
    inside = path.is_relative_to(repository)
    return f"{flag}{equals}{path.relative_to(repository).as_posix() if inside else path.name}"
