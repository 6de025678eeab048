"""A file that holds a traced function as `jax.export` writes it, behind a line of JSON about it and a hash of both.

Files are programs, like those of JAX's own cache: they are only ever read from a folder of the user's.
"""

import hashlib
import json
import os
import re
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Any

from jax import export

SUFFIX = ".t2tl_trace"
"""Of the files."""
MOST_FILES = 200
"""So many files are kept in a folder; the ones that were not used for longest go first."""
MADE_BY_XLA = ("mhlo.", "stablehlo.", "xla.sdy.", "Sharding", "SPMD", "annotate_device_placement", "ApproxTopK")
"""How the names of calls begin that XLA itself knows what to do with."""
READY = ("cu_threefry2x32_ffi", "hip_threefry2x32_ffi")
"""Calls of functions that are there as soon as JAX has found its GPU."""
NOT_WHOLE = (OSError, ImportError, ValueError, KeyError, TypeError, AttributeError)
"""What reading a file raises that is not there or not whole."""


def write(file: Path, exported: export.Exported, about: dict[str, Any]) -> None:
    """Write the file, whole or not at all; a disk that does not take it is no reason to stop.

    Nothing is written of a function that calls others of this process, such as LAPACK's: JAX makes them ready when it
    traces, and a process that only reads the file would crash at the call.
    """
    new = None
    if not all(name.startswith(MADE_BY_XLA) or name in READY for name in _calls(exported)):
        return
    try:
        body = bytes(exported.serialize())
        line = json.dumps(about | {"sha256": _hash(about, body)}).encode()
        file.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=file.parent, suffix=".tmp", delete=False) as new:
            new.write(line + b"\n" + body)
        os.replace(new.name, file)
        for old in sorted(file.parent.glob(f"*{SUFFIX}"), key=lambda one: one.stat().st_mtime)[:-MOST_FILES]:
            old.unlink(missing_ok=True)
    except (OSError, ImportError):  # the second without flatbuffers
        if new is not None:
            Path(new.name).unlink(missing_ok=True)


def read(file: Path) -> tuple[export.Exported, dict[str, Any]]:
    """What the file holds, the function and what is said about it; raises one of `NOT_WHOLE`."""
    line, _, body = file.read_bytes().partition(b"\n")
    about = json.loads(line)
    if about.pop("sha256") != _hash(about, body):
        raise ValueError("the file is not whole")
    found = export.deserialize(bytearray(body))
    with suppress(OSError):  # a folder that is only read
        os.utime(file)
    return found, about


def _calls(exported: export.Exported) -> list[str]:
    """Names of the functions that it calls outside of the program."""
    return re.findall(r'custom_call @"?([\w.$]+)', exported.mlir_module())


def _hash(about: dict[str, Any], body: bytes) -> str:
    return hashlib.sha256(json.dumps(about, sort_keys=True).encode() + body).hexdigest()
