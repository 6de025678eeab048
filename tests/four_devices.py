"""A program in a process of its own, which sees this processor as four devices."""

import os
import subprocess
import sys
from pathlib import Path


def run_on_four_devices(program: str, *arguments: str) -> None:
    """Run the text of a program to its end; AssertionError, with what it said, if it fails."""
    flags = f"{os.environ['XLA_FLAGS']} --xla_force_host_platform_device_count=4"
    answer = subprocess.run(
        [sys.executable, "-c", program, *arguments],
        cwd=Path(__file__).parents[1],
        env={**os.environ, "XLA_FLAGS": flags},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert answer.returncode == 0, answer.stderr
