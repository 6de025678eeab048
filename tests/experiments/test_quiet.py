"""What the libraries print while they are imported does not reach the user of a command."""

import subprocess
import sys

import pytest

from t2tl_jax.quiet import NOISE, quiet_imports

TOOLS = ("pretrain", "attention", "benchmarks.env", "benchmarks.ltl", "paper.water_scores")


def test_only_the_known_lines_are_dropped(capsys):
    with pytest.raises(ImportError), quiet_imports():
        print("Failed to import warp: No module named 'warp'")
        print("Failed to import mujoco_warp: No module named 'warp'")
        print("something else")
        raise ImportError("no mujoco")
    print("afterwards")
    assert capsys.readouterr().out == "something else\nafterwards\n"


@pytest.mark.slow
@pytest.mark.parametrize(
    "module",
    [*(f"experiments.{name}" for name in ("run", "evaluate", "plot", "compare", *TOOLS)), "t2tl_jax.ltl"],
)
def test_help_starts_with_the_usage(module):
    done = subprocess.run([sys.executable, "-m", module, "--help"], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0 and done.stdout.startswith(f"usage: python -m {module}"), done.stdout + done.stderr
    assert not any(noise in done.stdout for noise in NOISE)
