"""Seeds that do not fit into memory together train in groups, and nothing else changes."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import tests.fake_learner  # noqa: F401
from t2tl_jax import resume, train
from t2tl_jax.errors import Note
from t2tl_jax.registry import named_config
from t2tl_jax.runs import chunks
from tests.fake_runs import StopAfter
from tests.runs.test_stored_runs import restored


def five_seeds(at_once=0):
    config = named_config("fake")
    return replace(config, seeds="0,3,4,7,9", frames=400, run=replace(config.run, seeds_at_once=at_once))


def test_groups_are_even_and_as_large_as_fits():
    assert [chunks.even(5, most) for most in (5, 4, 3, 2, 1)] == [5, 3, 3, 2, 1]
    compiled = jax.jit(lambda x: x * 2).lower(jnp.ones((10, 100_000))).compile()  # 4 MB in, 4 MB out
    assert chunks.fitting(compiled, 10, memory=10**8) == 10
    assert 3 <= chunks.fitting(compiled, 10, memory=4 * 10**6) <= 5
    assert chunks.fitting(compiled, 10, memory=1) == 1
    assert chunks.device_memory() is None or chunks.device_memory() > 10**6


@pytest.mark.slow
def test_groups_train_what_all_seeds_together_do(tmp_path, monkeypatch):
    """As asked for, as memory demands, and after an interruption, bit for bit in the last case."""
    together = train(five_seeds(), folder=tmp_path / "together")
    asked = train(five_seeds(at_once=2), folder=tmp_path / "asked")  # the last group is filled up
    train(five_seeds(at_once=2), folder=tmp_path / "stopped", callbacks=[StopAfter(2)])
    resume(tmp_path / "stopped")
    for name in ("metrics.csv", "checkpoints/4/info/metadata"):
        assert (tmp_path / "stopped" / name).read_bytes() == (tmp_path / "asked" / name).read_bytes()
    monkeypatch.setattr(chunks, "fitting", lambda compiled, width: min(width, 3))
    with pytest.warns(Note, match="5 seeds do not fit into the memory of the devices together: 3 train side by side"):
        forced = train(five_seeds(), folder=tmp_path / "forced")
    for other, folder in ((asked, "asked"), (forced, "forced")):
        for name, values in together.metrics.items():
            np.testing.assert_allclose(other.metrics[name], values, rtol=1e-4, atol=1e-5, err_msg=name)
        (_, one), (_, many) = restored(tmp_path / "together"), restored(tmp_path / folder)
        jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-4, atol=1e-5), one, many)
