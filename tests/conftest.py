"""Programs that several tests compile are compiled once: workers of one session share a temporary cache on disk."""

import os
import tempfile

import jax
import pytest

FOLDER = "T2TL_JAX_TEST_CACHE"  # environment variable, inherited by the workers of pytest-xdist


def pytest_configure(config: pytest.Config) -> None:
    if FOLDER not in os.environ:
        cache = tempfile.TemporaryDirectory(prefix="t2tl_jax_tests_", ignore_cleanup_errors=True)
        os.environ[FOLDER] = cache.name
        config.add_cleanup(cache.cleanup)
        config.add_cleanup(lambda: os.environ.pop(FOLDER))
    jax.config.update("jax_compilation_cache_dir", os.environ[FOLDER])
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.1)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
