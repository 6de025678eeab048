"""The structure of a tree in JSON: what is made from it is the same, and what cannot be said is not."""

import collections
import json
from typing import Any, NamedTuple

import chex
import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest
from flax import struct

from t2tl_jax.training.tree_names import described, like


@struct.dataclass
class Held:
    b: Any
    a: Any


@struct.dataclass
class Marked:
    a: Any
    mark: Any = struct.field(pytree_node=False, default="")


@struct.dataclass
class Checked:
    a: Any

    def __post_init__(self):
        assert_positive(self.a.size)


def assert_positive(size):
    if size < 1:
        raise ValueError(size)


@chex.dataclass(frozen=True)
class Buffer:
    b: Any
    a: Any


class Pair(NamedTuple):
    b: Any
    a: Any


class Nothing(NamedTuple):
    pass


ADAM = optax.chain(optax.clip(1.0), optax.adam(1e-3)).init({"kernel": jnp.ones(3), "bias": jnp.zeros(3)})


@pytest.mark.parametrize(
    "tree",
    [
        jnp.ones(2),
        np.float32(0),
        None,
        {},
        (),
        [],
        {"b": jnp.ones(2), "a": [jnp.zeros(()), (None, jnp.ones(1))]},
        Held(b={"x": jnp.ones(2)}, a=Pair(b=None, a=Nothing())),
        Buffer(b=jnp.ones(2), a=Held(jnp.ones(1), ())),
        ADAM,
    ],
)
def test_what_is_made_from_a_description_has_the_same_structure(tree):
    description = json.loads(json.dumps(described(tree)))
    assert jax.tree.structure(like(description, lambda said: 0)) == jax.tree.structure(tree)


def test_what_is_said_of_a_leaf_is_found_at_its_place():
    tree = {"b": jnp.ones(2), "a": Buffer(b=jnp.ones(3), a=jnp.ones(4))}
    found = like(described(tree, lambda x: str(x.size)), int)
    assert jax.tree.map(lambda x: x.size, tree) == found


@pytest.mark.parametrize(
    "tree",
    [
        {1: jnp.ones(2)},
        [Marked(jnp.ones(2), "x")],
        Marked(jnp.ones(2), 0),
        Pair(collections.OrderedDict(b=0), 0),
        Checked(jnp.ones(2)),
    ],
)
def test_what_cannot_be_said_is_not(tree):
    assert described(tree) is None


@pytest.mark.parametrize(
    "wrong", [["no_such_module:A", []], ["os:system", [["command", "*"]]], ["builtins:dict", []], 3, ["dict", 3], ["x"]]
)
def test_what_is_no_description_is_refused(wrong):
    with pytest.raises((KeyError, TypeError, ValueError, AttributeError)):
        like(wrong, str)
