"""What the libraries print while they are imported does not reach the user of a command."""

import os
import subprocess
import sys

import pytest

from t2tl_jax.quiet import NOISE, quiet_imports

TOOLS = ("pretrain", "attention", "reproduce", "benchmarks.env", "benchmarks.ltl", "paper.water_scores")


def test_only_the_known_lines_are_dropped(capsys):
    with pytest.raises(ImportError), quiet_imports():
        print("Failed to import warp: No module named 'warp'")
        print("Failed to import mujoco_warp: No module named 'warp'")
        print("something else")
        raise ImportError("no mujoco")
    print("afterwards")
    assert capsys.readouterr().out == "something else\nafterwards\n"


@pytest.mark.slow
@pytest.mark.parametrize("module", ["t2tl_jax.env", "t2tl_jax.training.unroll", "envs.zones"])
def test_a_module_is_imported_in_silence(module):
    done = subprocess.run([sys.executable, "-c", f"import {module}"], capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


HELP = """
import os, runpy, sys
import cattrs, flax, jax, mujoco, numpy, optax, scipy.spatial, scipy.stats, trimesh, tyro  # silent
assert not {"brax", "mujoco.mjx"} & set(sys.modules)  # what is not
folder, *modules = sys.argv[1:]
for module in modules:
    sys.stdout.flush()
    if os.fork() == 0:
        file = os.open(os.path.join(folder, module), os.O_CREAT | os.O_WRONLY)
        os.dup2(file, 1)
        os.dup2(file, 2)
        sys.argv = [module, "--help"]
        runpy.run_module(module, run_name="__main__", alter_sys=True)
        sys.exit()
    assert os.wait()[1] == 0, module
"""
"""Every command in a child that begins with nothing of ours and nothing that prints; what else there is, loads once."""


@pytest.mark.slow
def test_help_starts_with_the_usage(tmp_path):
    commands = (*(f"experiments.{name}" for name in ("run", "evaluate", "plot", "compare", *TOOLS)), "t2tl_jax.ltl")
    done = subprocess.run(
        [sys.executable, "-c", HELP, str(tmp_path), *commands], capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0, done.stderr
    for name in commands:
        shown = (tmp_path / name).read_text()
        assert shown.startswith(f"usage: python -m {name}"), shown
        assert not any(noise in shown for noise in NOISE)


FROM_CACHE = """
import os, sys
from t2tl_jax.quiet import quiet_imports
with quiet_imports():
    import jax
jax.config.update("jax_compilation_cache_dir", sys.argv[1])
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
for _ in range(2):
    if os.fork() == 0:
        print(jax.jit(lambda x: (x @ x.T).sum())(jax.numpy.ones((8, 8))), flush=True)
        os._exit(0)
    assert os.wait()[1] == 0
    print(len(os.listdir(sys.argv[1])), flush=True)
"""
"""Two processes, of which the second has nothing to compile: JAX is loaded before, and computes in them alone."""


@pytest.mark.slow
def test_a_program_from_the_cache_is_loaded_in_silence(tmp_path):
    environment = {name: value for name, value in os.environ.items() if name != "TF_CPP_MIN_LOG_LEVEL"}
    command = [sys.executable, "-c", FROM_CACHE, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=120)
    first, kept, second, then = done.stdout.split()
    assert first == second == "512.0" and kept == then != "0" and done.stderr == ""
