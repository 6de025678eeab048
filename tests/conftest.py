"""Programs that several tests compile are compiled once: all processes of one session share a temporary cache on disk.

Most programs here take longer to compile than to run, and half of that is LLVM optimising them, so it does not. What is
compiled stays the same, only the machine code is slower.
"""

import os
import tempfile

import jax
import pytest

FOLDER = "JAX_COMPILATION_CACHE_DIR"  # inherited by the workers of pytest-xdist, and by the commands that tests start


def pytest_configure(config: pytest.Config) -> None:
    # Read by XLA when the first program compiles. Who asks for another level gets it.
    os.environ["XLA_FLAGS"] = f"--xla_backend_optimization_level=0 {os.environ.get('XLA_FLAGS', '')}"
    os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0.1"
    os.environ["JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES"] = "-1"
    if FOLDER not in os.environ:
        cache = tempfile.TemporaryDirectory(prefix="t2tl_jax_tests_", ignore_cleanup_errors=True)
        os.environ[FOLDER] = cache.name
        config.add_cleanup(cache.cleanup)
        config.add_cleanup(lambda: os.environ.pop(FOLDER))
    jax.config.update("jax_compilation_cache_dir", os.environ[FOLDER])
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.1)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
