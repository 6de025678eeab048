"""Who does which run on which device: file locks in the folder of a reproduction, none of which is ever waited for.

A process claims a run by a lock of its own on the run's name. It also locks its devices: with all others who use them,
or, for a run that is timed, for itself alone. Locks end with their process, however it ends. They bind the processes
that work on the same folder; nobody else on the machine knows of them.
"""

import fcntl
import os
import platform
import re
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import jax


@contextmanager
def claimed(base: Path, name: str, devices: Sequence[str], alone: bool) -> Iterator[bool]:
    """Whether this process is the one that does a run, for as long as the block lasts.

    Args:
        base: the folder of the reproduction.
        name: of the run.
        devices: of this process, see `device_names`.
        alone: whether no other run may be on them meanwhile.
    """
    on_devices = fcntl.LOCK_EX if alone else fcntl.LOCK_SH
    wanted = [(f"{name}.lock", fcntl.LOCK_EX), *((f"device-{device}.lock", on_devices) for device in devices)]
    with ExitStack() as held:
        yield all(held.enter_context(_locked(base / file, kind)) for file, kind in wanted)


@contextmanager
def _locked(path: Path, kind: int) -> Iterator[bool]:
    """Whether the lock was to be had, for as long as the block lasts."""
    with path.open("a") as file:
        try:
            fcntl.flock(file, kind | fcntl.LOCK_NB)
        except OSError:
            yield False
            return
        yield True


def device_names() -> list[str]:
    """Names of this process's devices that are the same in every process and can stand in a file name, sorted.

    A GPU has its UUID where ``nvidia-smi`` knows it. The cores of a processor are one device.
    """
    devices = jax.local_devices()
    if devices[0].platform == "cpu":
        return [_in_file_name(platform.node() or "cpu")]
    visible = os.environ.get("CUDA_VISIBLE_DEVICES", "").split(",")
    uuids = gpu_uuids() if devices[0].platform == "gpu" else {}
    places = [device.id if device.local_hardware_id is None else device.local_hardware_id for device in devices]
    return sorted(_in_file_name(_device_name(place, visible, uuids)) for place in places)


def _device_name(place: int, visible: Sequence[str], uuids: dict[str, str]) -> str:
    """The name of one accelerator.

    Args:
        place: among those that this process sees, from 0.
        visible: how the user named these, by number or UUID; [''] for all.
        uuids: of those that there are, by number.
    """
    given = visible[place].strip() if place < len(visible) else ""
    if given.startswith(("GPU-", "MIG-")):
        return given
    return uuids.get(given or str(place)) or f"{platform.node()}-{given or place}"


def gpu_uuids() -> dict[str, str]:
    """UUIDs of the GPUs by number, as ``nvidia-smi`` tells them; none without it."""
    command = shutil.which("nvidia-smi")
    if command is None:
        return {}
    try:
        answer = subprocess.run(
            [command, "--query-gpu=index,uuid", "--format=csv,noheader"],
            capture_output=True,
            text=True,
            timeout=60,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return {}
    parts = (line.partition(",") for line in answer.stdout.splitlines())
    return {index.strip(): uuid.strip() for index, _, uuid in parts if uuid}


def _in_file_name(text: str) -> str:
    return re.sub(r"[^\w.-]", "_", text)
