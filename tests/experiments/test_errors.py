"""How commands end that have not enough memory: in words, with the exit code of what cannot be used."""

import subprocess
import sys

import jax
import numpy as np
import pytest

from experiments.cli.errors import guarded


def raises(error):
    def command():
        raise error

    return command


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (lambda: np.zeros(2**55), "(Unable to allocate 256. PiB"),
        (raises(MemoryError()), "not enough memory: some number"),
        (
            raises(jax.errors.JaxRuntimeError("RESOURCE_EXHAUSTED: Out of memory\nmore")),
            "(RESOURCE_EXHAUSTED: Out of m",
        ),
        (
            raises(jax.errors.JaxRuntimeError("INTERNAL: Error dispatching: Out of memory allocating 4 bytes.")),
            "(INTERNAL",
        ),
    ],
)
def test_too_little_memory_is_told(command, said, capsys):
    assert guarded(command) == 2
    shown = capsys.readouterr().err
    assert shown.startswith("error: there is not enough memory") and said in shown and shown.count("\n") == 1


def test_other_errors_are_no_lack_of_memory():
    with pytest.raises(RuntimeError, match="a mistake of ours"):
        guarded(raises(RuntimeError("a mistake of ours")))


def test_a_process_that_ends_looks_for_garbage_no_more():
    """What is registered first is called last, when everything has been set aside."""
    command = """
import atexit, gc
atexit.register(lambda: print(gc.get_freeze_count() > 0))
from experiments.cli.errors import guarded
print(gc.get_freeze_count() > 0, guarded(lambda: 3))
"""
    done = subprocess.run([sys.executable, "-c", command], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "3", "True"]
