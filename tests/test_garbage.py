"""Where no garbage is looked for, and that it is again afterwards."""

import gc
from threading import Barrier, Thread

import pytest

from t2tl_jax.garbage import garbage_kept
from t2tl_jax.quiet import quiet_imports
from t2tl_jax.training import program


@pytest.fixture(autouse=True)
def looked_for():
    """Garbage is looked for before and after each test."""
    assert gc.isenabled()
    yield
    gc.enable()


@pytest.mark.parametrize("block", [garbage_kept, quiet_imports])
def test_none_is_looked_for_inside_and_it_is_again_after_the_outermost_block(block):
    with block():
        with block():
            assert not gc.isenabled()
        assert not gc.isenabled()
    assert gc.isenabled()


def test_it_is_again_after_an_error():
    with pytest.raises(ValueError, match="inside"), garbage_kept():
        raise ValueError("inside")
    assert gc.isenabled()


def test_who_looks_for_none_at_all_goes_on_so():
    gc.disable()
    with garbage_kept():
        pass
    assert not gc.isenabled()


def test_it_is_again_after_blocks_in_two_threads_of_which_the_first_one_ends_first():
    first_is_in, both_are_in, first_is_out = (Barrier(2, timeout=10) for _ in range(3))

    def second():
        first_is_in.wait()
        with garbage_kept():
            both_are_in.wait()
            first_is_out.wait()

    other = Thread(target=second)
    other.start()
    with garbage_kept():
        first_is_in.wait()
        both_are_in.wait()
    first_is_out.wait()
    other.join()
    assert gc.isenabled()


def test_none_is_looked_for_while_a_training_is_traced(monkeypatch):
    def keys(*_):
        assert not gc.isenabled()
        raise ValueError("traced")

    monkeypatch.setattr(program, "stream_keys", keys)
    with pytest.raises(ValueError, match="traced"):
        program.trace(None, (0,), None)
    assert gc.isenabled()
