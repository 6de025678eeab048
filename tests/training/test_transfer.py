"""Transfer moves the task encoder and nothing else; work done ahead comes in order."""

import threading

import chex
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from flax import struct

from t2tl_jax.runs.prefetch import Prefetch
from t2tl_jax.training.transfer import adopt, seed_index, task_encoder
from t2tl_jax.training.types import Agent, map_params


@struct.dataclass
class State:
    params: dict
    target_params: dict
    opt_state: dict
    key: jax.Array


WITH_TARGET = Agent(
    *[None] * 5,
    map_params=lambda state, function: map_params(state.replace(target_params=function(state.target_params)), function),
)
"""A learner that holds one set of parameters more than all have, as DQN does."""


def parameters(value, seeds):
    def array(*shape):
        return jnp.full((seeds, *shape), value) + jnp.arange(seeds).reshape(-1, *[1] * len(shape))

    return {"params": {"task_encoder": {"w": array(3, 2)}, "actor": {"w": array(2)}, "critic": {"w": array(2)}}}


def test_only_the_task_encoder_is_copied_for_the_seeds_that_are_wanted():
    start = State(*(parameters(float(k), 2) for k in range(3)), key=jnp.zeros(2))
    source = parameters(100.0, 3)
    after = adopt(WITH_TARGET, start, task_encoder(source, seed_index((5, 6, 7), (7, 5))))
    for name in ("params", "target_params"):
        old, new = getattr(start, name)["params"], getattr(after, name)["params"]
        np.testing.assert_array_equal(new["task_encoder"]["w"][:, 0, 0], [102.0, 100.0])
        chex.assert_trees_all_equal({**old, "task_encoder": None}, {**new, "task_encoder": None})
    chex.assert_trees_all_equal((start.opt_state, start.key), (after.opt_state, after.key))
    first, second = (getattr(after, name)["params"]["task_encoder"]["w"] for name in ("params", "target_params"))
    assert first.unsafe_buffer_pointer() != second.unsafe_buffer_pointer()  # or donating the state would fail


def test_a_single_seed_serves_all():
    np.testing.assert_array_equal(seed_index((4,), (0, 1, 2)), [0, 0, 0])
    np.testing.assert_array_equal(seed_index((0, 1, 2), (2,)), [2])
    with pytest.raises(ValueError, match=r"holds seeds 0, 1 and not 2: pre-train these too"):
        seed_index((0, 1), (1, 2))


def test_other_sizes_are_refused():
    start = State(*(parameters(float(k), 1) for k in range(3)), key=jnp.zeros(1))
    with pytest.raises(ValueError, match=r"has arrays \['w'\] \(4, 2\)"):
        adopt(WITH_TARGET, start, {"w": np.zeros((1, 4, 2))})


def test_the_next_value_is_made_while_the_last_one_is_used():
    made, second = [], threading.Event()

    def make(number):
        made.append(number)
        if number == 1:
            second.set()
        if number == 3:
            raise ValueError("no third")
        return number * number

    with Prefetch(make) as values:
        assert values.get(0) == 0
        assert second.wait(timeout=10)
        assert [values.get(1), values.get(2)] == [1, 4]
        with pytest.raises(ValueError, match="no third"):
            values.get(3)
    assert made[:4] == [0, 1, 2, 3]
