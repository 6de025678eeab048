"""Which software and hardware a run used."""

import os
import platform
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import jax

from t2tl_jax.runs import source_tree

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


def describe(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Versions, revision, devices and command line as an object for JSON.

    Args:
        arguments: of the command line; by default those of this process.
    """
    return {
        "time": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": list(sys.argv if arguments is None else arguments),
        "python": platform.python_version(),
        "platform": "-".join((platform.system(), platform.machine(), "".join(platform.libc_ver()))),
        "cpu": _cpu_model(),
        "cpu_count": os.cpu_count(),
        "packages": {name: _version(name) for name in PACKAGES},
        **source_tree.describe(),
        "backend": jax.default_backend(),
        "devices": [device.device_kind for device in jax.devices()],
        "matmul_precision": jax.config.jax_default_matmul_precision,  # type: ignore[attr-defined]  # jax 0.9
        "xla_flags": os.environ.get("XLA_FLAGS", ""),
    }


@cache
def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def _cpu_model() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), platform.machine())
