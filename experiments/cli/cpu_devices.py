"""Every core of a processor as a device of its own, so that one seed uses them all. Only entry points do this."""

import os
from contextlib import suppress

import jax

MOST = 4
"""So many devices at most: their shares of a small batch become too small to be worth it."""


def use() -> None:
    """Ask JAX for as many CPU devices as there are cores; nothing happens where the user chose a number."""
    chosen = jax.config.values["jax_num_cpu_devices"] >= 0 or "xla_force_host_platform_device_count" in os.environ.get(
        "XLA_FLAGS", ""
    )
    affinity = getattr(os, "sched_getaffinity", None)  # not on every system
    cores = len(affinity(0)) if affinity else os.cpu_count() or 1
    if not chosen:
        with suppress(RuntimeError):  # this process computed something before: it goes on with the devices it has
            jax.config.update("jax_num_cpu_devices", min(MOST, cores))
