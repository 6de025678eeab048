"""Out-projection weights: which parameters they are, and how their change is measured and drawn."""

from functools import partial

import jax
import numpy as np

from t2tl_jax.evaluation.projections import Projections, out_projections, plot_projections
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.networks.task_encoders import TransformerTaskEncoder
from t2tl_jax.networks.transformer import TransformerConfig


def test_they_are_what_heads_give_to_the_output():
    """Of every layer, in the layers' order: weights from [heads, size] to the width."""
    encoder = TransformerTaskEncoder(TransformerConfig(layers=11, width=8, heads=2, feed_forward=4, output=2))
    shapes = jax.eval_shape(partial(encoder.init, jax.random.key(0)), compile_tasks("F a", ("a",), "at_most_one"))
    params = jax.tree.map(lambda x: np.zeros(x.shape, x.dtype), shapes["params"])
    for layer in range(11):
        params["transformer"]["encoder"][f"layer_{layer}"]["attention"]["out"]["kernel"] += layer
    weights = out_projections(params)
    assert weights.shape == (11, 2, 4, 8)
    np.testing.assert_array_equal(weights[:, 0, 0, 0], range(11))


def test_change_is_relative_to_the_start_by_head(tmp_path):
    start = np.random.default_rng(0).normal(size=(2, 4, 3, 12))
    end = start.copy()
    end[1, 2] *= 1.25
    projections = Projections(start, end)
    expected = np.zeros((2, 4))
    expected[1, 2] = 0.25
    np.testing.assert_allclose(projections.relative_change, expected, atol=1e-12)
    plot_projections(tmp_path / "figure.png", "weights", ("start", "end"), projections)
    assert (tmp_path / "figure.png").stat().st_size > 10_000


def test_weights_that_stand_still_can_be_drawn(tmp_path):
    still = np.zeros((1, 1, 2, 2))
    assert not Projections(still, still).relative_change.any()
    plot_projections(tmp_path / "figure.png", "weights", ("start", "end"), Projections(still, still))
