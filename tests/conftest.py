"""Programs that several tests compile are compiled once: all processes of one session share a temporary cache on disk.

Most programs here take longer to compile than to run, so XLA is told to work less on them: LLVM does not optimise, and
fused operations are written by XLA's older and simpler generator, all of a program as one module. What is compiled
stays the same; the machine code is slower, and may round otherwise. Tracing makes many small objects that live as long
as the session; Python looks for garbage among them less often. The commands that tests start keep the bytecode of what
they import, for those that come after.
"""

import gc
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

import jax
import pytest
from hypothesis import settings

FOLDER = "JAX_COMPILATION_CACHE_DIR"  # inherited by the workers of pytest-xdist, and by the commands that tests start
LITTLE_WORK = (
    "--xla_backend_optimization_level=0",
    # An extra option because XLA ignores those that it does not know: newer versions have one generator only.
    "--xla_backend_extra_options=xla_cpu_disable_new_fusion_emitters",
    "--xla_cpu_parallel_codegen_split_count=1",
)


# Everybody tests the same examples, however slow the machine is.
settings.register_profile("repeatable", derandomize=True, database=None, deadline=None)
settings.load_profile("repeatable")


def pytest_configure(config: pytest.Config) -> None:
    # Read by XLA when the first program compiles. Who asks for other flags gets them.
    os.environ["XLA_FLAGS"] = " ".join((*LITTLE_WORK, os.environ.get("XLA_FLAGS", "")))
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0"
    os.environ["JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES"] = "-1"
    if FOLDER not in os.environ:
        cache = tempfile.TemporaryDirectory(prefix="t2tl_jax_tests_", ignore_cleanup_errors=True)
        os.environ[FOLDER] = cache.name
        config.add_cleanup(cache.cleanup)
        config.add_cleanup(lambda: os.environ.pop(FOLDER))
    jax.config.update("jax_compilation_cache_dir", os.environ[FOLDER])
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)


def pytest_collection_finish() -> None:
    gc.freeze()  # what is imported by now stays
    gc.set_threshold(100_000, 20, 20)


@pytest.fixture
def drawn() -> None:
    """For tests that look at a learning curve: it is drawn."""


@pytest.fixture(autouse=True)
def undrawn(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Elsewhere it is an empty file: to draw it takes about as long as all else that a run of the fake learner does."""

    def touch(metrics: object, seeds: object, target: Path, title: str = "", published: object = None) -> None:
        target.write_bytes(b"")

    if "drawn" not in request.fixturenames:
        monkeypatch.setattr("t2tl_jax.evaluation.curves.plot_learning_curves", touch)


@pytest.fixture
def as_many_devices(monkeypatch: pytest.MonkeyPatch) -> None:
    """For tests that compare numbers with those of commands that they start, which get as many devices as this process.

    Here the first test that computes settles how many there are, and a program for another number may round otherwise.
    """
    monkeypatch.setenv("JAX_NUM_CPU_DEVICES", str(jax.device_count()))


@pytest.fixture
def keeps_traces() -> Iterator[None]:
    """For tests of traced programs on disk: commands in this process keep them, until the test is over."""
    from t2tl_jax.runs import kept_traces

    yield
    kept_traces.use(None)


@pytest.fixture(autouse=True)
def traces_anew(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Elsewhere they do not: tests change the code that is traced. Commands in other processes keep them as ever."""
    if "keeps_traces" not in request.fixturenames:
        monkeypatch.setattr("t2tl_jax.runs.kept_traces.use", lambda folder: None)


@pytest.fixture
def begins_quickly(monkeypatch: pytest.MonkeyPatch) -> None:
    """For runs that ask nothing about where learning starts: no initialiser is compiled, see `tests/parameters.py`."""
    from tests.parameters import begin_quickly  # loads networks, which not every session needs

    begin_quickly(monkeypatch)
