"""The face of the library: what it offers, and what importing it does (nothing that a user would notice)."""

import subprocess
import sys

import pytest

import t2tl_jax

PROMISED = {
    *("parse", "compile_tasks", "TaskTable", "TaskEnv", "LabelledEnv", "PPOConfig", "DQNConfig", "NetworkConfig"),
    *("train", "load", "evaluate"),
    *("register_env", "register_task_encoder", "register_agent", "register_config", "register_family"),
}


def in_a_fresh_process(code: str) -> str:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120).stdout


def test_every_name_is_there():
    assert PROMISED <= set(t2tl_jax.__all__) <= set(dir(t2tl_jax))
    for name in t2tl_jax.__all__:
        assert callable(getattr(t2tl_jax, name))
    with pytest.raises(AttributeError, match="has no attribute 'trian'"):
        t2tl_jax.trian  # noqa: B018


def test_importing_it_loads_nothing_heavy():
    heavy = "{'jax', 'flax', 'brax', 'mujoco', 'numpy', 'orbax', 'matplotlib'}"
    code = f"import sys, t2tl_jax; print({heavy} & {{name.split('.')[0] for name in sys.modules}})"
    assert in_a_fresh_process(code) == "set()\n"


@pytest.mark.slow
def test_using_it_prints_nothing():
    """Neither does loading the environments, of which some bring MuJoCo."""
    assert in_a_fresh_process("import t2tl_jax; t2tl_jax.train, t2tl_jax.make_env('Zones-25-v1')") == ""


def test_formulas_need_no_jax():
    code = "import sys, t2tl_jax; print(t2tl_jax.progress(t2tl_jax.parse('F(a & F b)'), ['a']), 'jax' in sys.modules)"
    assert in_a_fresh_process(code) == "F b False\n"
