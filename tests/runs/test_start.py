"""What a training began with: drawn again from its seeds, with its pre-trained encoder if that can be read."""

from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.errors import UserError
from t2tl_jax.runs import start
from t2tl_jax.task_env import TaskParams
from t2tl_jax.training.seeds import TRAINING, stream_keys


def init(key, env_params):
    params = {"task_encoder": {"w": jax.random.normal(key, (2,))}, "actor": {"w": env_params.env + 1.0}}
    return SimpleNamespace(params={"params": params})


@pytest.fixture
def result(tmp_path):
    """Of seeds 3 and 5, pre-trained or not."""

    def make(pretrained):
        experiment = SimpleNamespace(
            agent=SimpleNamespace(init=init),
            seeds=(3, 5),
            env_params=lambda training: TaskParams(env=jnp.array([10.0, 20.0]), table=()),
        )
        config = SimpleNamespace(pretrained=pretrained)
        return SimpleNamespace(experiment=experiment, config=config, seeds=(3, 5), folder=tmp_path)

    return make


def test_a_new_network_is_drawn_from_the_seeds(result):
    begun = start.start_params(result(""))
    assert (begun.origin, begun.problem) == ("new network", "")
    expected = [jax.random.normal(key, (2,)) for key in stream_keys((3, 5), TRAINING)]
    np.testing.assert_allclose(begun.params["params"]["task_encoder"]["w"], expected, rtol=1e-6)
    np.testing.assert_array_equal(begun.params["params"]["actor"]["w"], [11.0, 21.0])


@pytest.mark.parametrize("pretrained", ["auto:own", "elsewhere"])
def test_a_pretrained_encoder_is_put_in(result, pretrained, monkeypatch, tmp_path):
    """Of the same seeds, from the run's own folder or the named one; nothing else of it."""

    def load(folder):
        assert str(folder) == ("elsewhere" if pretrained == "elsewhere" else str(tmp_path / "pretraining"))
        encoders = jnp.array([[5.0, 5.0], [3.0, 3.0], [0.0, 0.0]])
        best = {"params": {"task_encoder": {"w": encoders}}}
        return SimpleNamespace(params_of={"best": best}.__getitem__, seeds=(5, 3, 0))

    monkeypatch.setattr(start, "load", load)
    begun = start.start_params(result(pretrained))
    assert (begun.origin, begun.problem) == ("pre-trained encoder", "")
    np.testing.assert_array_equal(begun.params["params"]["task_encoder"]["w"], [[3.0, 3.0], [5.0, 5.0]])
    np.testing.assert_array_equal(begun.params["params"]["actor"]["w"], [11.0, 21.0])


def test_a_pretraining_that_is_gone_is_told(result, monkeypatch):
    def load(folder):
        raise UserError(f"there is no folder {folder}")

    monkeypatch.setattr(start, "load", load)
    begun = start.start_params(result("elsewhere"))
    assert begun.origin == "new network, before the pre-trained encoder"
    assert begun.problem == "there is no folder elsewhere"
