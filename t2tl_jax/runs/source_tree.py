"""What git says about the source tree of this package. Does not load JAX, so that it can be asked at once."""

import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any

MOST_CHANGES = 100
"""So many changed files are listed."""

MOST_NAMED = 3
"""So many of them are named in a message."""


def describe() -> dict[str, Any]:
    """The commit, whether the tree differs from it, and in which files; None where git does not know."""
    changed = _git("status", "--porcelain", "--no-renames", "--untracked-files=no")
    return {
        "git_revision": _git("rev-parse", "HEAD"),
        "git_modified": None if changed is None else bool(changed),
        "git_changed": [line[2:].strip() for line in (changed or "").splitlines()[:MOST_CHANGES]],
    }


def difference(made: Mapping[str, Any]) -> str:
    """What `describe` says of a tree that differs from its commit, in words; '' for one that does not, as far as git
    knows."""
    if not made.get("git_modified"):
        return ""
    changed = made.get("git_changed", [])
    named = ", ".join(changed[:MOST_NAMED]) or "some files"
    others = " and others" if len(changed) > MOST_NAMED else ""
    return f"differs from commit {(made.get('git_revision') or 'unknown')[:7]} in {named}{others}"


def _git(*arguments: str) -> str | None:
    """Answer of git about the source tree of this package; None for an installed package or without git."""
    source = Path(__file__).resolve().parents[2]
    if not (source / ".git").exists():
        return None
    try:
        answer = subprocess.run(
            ["git", "-C", str(source), *arguments], capture_output=True, text=True, timeout=10, check=True
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return answer.stdout.strip()
