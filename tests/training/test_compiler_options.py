"""Options of XLA for NVIDIA GPUs: whoever trains or evaluates there has them, and nobody elsewhere."""

from types import SimpleNamespace

import jax
import pytest

from t2tl_jax.training import compiler_options as options


@pytest.fixture
def on(monkeypatch):
    """Has JAX say that it computes on a kind of device."""
    monkeypatch.delenv("CUDA_MPS_PIPE_DIRECTORY", raising=False)

    def on(platform: str, version: str) -> None:
        monkeypatch.setattr(jax, "default_backend", lambda: platform)
        monkeypatch.setattr(options.backend, "get_backend", lambda: SimpleNamespace(platform_version=version))

    return on


def test_they_are_for_nvidia_gpus(on):
    assert options.compiler_options() == {}
    on("gpu", "PJRT C API\nrocm 60300")
    assert options.compiler_options() == {}
    on("gpu", "PJRT C API\ncuda 12090")
    assert options.compiler_options() == options.GRAPHS


def test_clients_of_the_multi_process_service_go_without(on, monkeypatch):
    on("gpu", "cuda 12090")
    monkeypatch.setenv("CUDA_MPS_PIPE_DIRECTORY", "/somewhere")
    assert options.compiler_options() == {}


def test_flags_of_the_user_go_before(on, monkeypatch):
    on("gpu", "cuda 12090")
    monkeypatch.setenv("XLA_FLAGS", "--xla_gpu_command_buffer_scheduling_mode=SERIALIZE --xla_gpu_autotune_level=4")
    assert set(options.compiler_options()) == set(options.GRAPHS) - {"xla_gpu_command_buffer_scheduling_mode"}


def test_what_a_version_does_not_know_is_left_out(on, monkeypatch):
    on("gpu", "cuda 12090")
    monkeypatch.setattr(options, "GRAPHS", options.GRAPHS | {"xla_gpu_no_such_option": 1})
    assert "xla_gpu_no_such_option" not in options.compiler_options() and len(options.compiler_options()) == 3
    assert not options.knows("xla_gpu_command_buffer_scheduling_mode", "SIDEWAYS")
