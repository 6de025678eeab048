"""Which software and hardware a run used."""

import os
import platform
import subprocess
import sys
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import jax

PACKAGES = (
    "t2tl_jax",
    "jax",
    "jaxlib",
    "flax",
    "optax",
    "orbax-checkpoint",
    "brax",
    "mujoco",
    "mujoco-mjx",
    "numpy",
    "scipy",
)


MOST_CHANGES = 100
"""So many changed files are named."""

OUTPUTS = ("certificates.json",)
"""Files that commands add to beside a stored run. Nothing that trains, plays or is timed reads them."""


def describe(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Versions, revision, devices and command line as an object for JSON.

    Args:
        arguments: of the command line; by default those of this process.
    """
    changed = _git("status", "--porcelain", "--no-renames", "--untracked-files=no")
    return {
        "time": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": list(sys.argv if arguments is None else arguments),
        "python": platform.python_version(),
        "platform": "-".join((platform.system(), platform.machine(), "".join(platform.libc_ver()))),
        "cpu": _cpu_model(),
        "cpu_count": os.cpu_count(),
        "packages": {name: _version(name) for name in PACKAGES},
        "git_revision": _git("rev-parse", "HEAD"),
        "git_modified": None if changed is None else bool(changed),
        "git_changed": [line[2:].strip() for line in (changed or "").splitlines()[:MOST_CHANGES]],
        "backend": jax.default_backend(),
        "devices": [device.device_kind for device in jax.devices()],
        "matmul_precision": jax.config.jax_default_matmul_precision,  # type: ignore[attr-defined]  # jax 0.9
        "xla_flags": os.environ.get("XLA_FLAGS", ""),
    }


def modified(where: Mapping[str, Any]) -> bool | None:
    """Whether a tree differed from its commit in anything but `OUTPUTS`, by what `describe` said; None if unknown."""
    changed = where.get("git_changed", [])
    if not where.get("git_modified") or not changed or len(changed) >= MOST_CHANGES:
        return where.get("git_modified")
    return any(Path(name).name not in OUTPUTS for name in changed)


@cache
def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


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


def _cpu_model() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), platform.machine())
