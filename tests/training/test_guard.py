"""Parameters that are not finite are given up, the cause is named, and other seeds go on."""

import chex
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from flax import struct

from t2tl_jax.training.guard import CAUSES, Fault, guarded
from t2tl_jax.training.types import Agent, EpisodeTotals, Metrics
from tests.fake_agent import FakeConfig, make_agent

NOBODY = EpisodeTotals(*[jnp.int32(0)] * 5, *[jnp.float32(0)] * 3)


@struct.dataclass
class TwoSets:
    params: dict
    target: dict
    episodes: jax.Array


def spoiled(params=1.0, target=1.0, episodes=0.0, **scalars):
    """One iteration of a learner that multiplies its parameters, and reports and holds what is said."""

    def iterate(state, env_params):
        new = TwoSets(
            jax.tree.map(lambda x: x * params, state.params),
            jax.tree.map(lambda x: x * target, state.target),
            state.episodes + episodes,
        )
        return new, Metrics(NOBODY, {"loss": jnp.float32(0), "gradient_norm": jnp.float32(0), **scalars})

    def map_params(state, function):
        return state.replace(params=function(state.params), target=function(state.target))

    agent = Agent(None, iterate, None, None, 1, map_params=map_params)
    state = TwoSets({"w": jnp.arange(3.0) + 1}, {"w": jnp.arange(3.0) + 5}, jnp.zeros(2))
    return state, *jax.jit(guarded(agent).iterate)(state, None)


NAN = float("nan")


@pytest.mark.parametrize(
    ("what", "fault"),
    [
        ({"params": 2.0}, Fault.NONE),
        ({"params": 2.0, "entropy": jnp.float32(NAN)}, Fault.NONE),
        ({"params": NAN}, Fault.PARAMETERS),
        ({"params": float("inf")}, Fault.PARAMETERS),
        ({"target": NAN}, Fault.PARAMETERS),
        ({"params": NAN, "gradient_norm": jnp.float32(float("inf"))}, Fault.GRADIENT),
        ({"params": NAN, "gradient_norm": jnp.float32(NAN), "value_loss": jnp.float32(NAN)}, Fault.LOSS),
        ({"params": NAN, "value_loss": jnp.float32(NAN), "episodes": NAN}, Fault.ENVIRONMENT),
        ({"params": NAN, "episodes": float("inf")}, Fault.PARAMETERS),
    ],
)
def test_the_first_cause_is_named_and_all_parameters_stay(what, fault):
    before, after, metrics = spoiled(**what)
    assert Fault(int(metrics.fault)) is fault and (fault in CAUSES) == (fault is not Fault.NONE)
    if fault is Fault.NONE:
        chex.assert_trees_all_equal(after.params, {"w": before.params["w"] * 2.0})
    else:
        chex.assert_trees_all_equal((after.params, after.target), (before.params, before.target))


def test_a_seed_that_breaks_learns_no_more_and_the_one_beside_it_does_not_notice():
    plain = make_agent(config=FakeConfig())

    def breaking(state, env_params):  # in its third iteration, where it is to
        breaks = env_params & (state.iteration == 2)
        params = jax.tree.map(lambda x: jnp.where(breaks, NAN, x), state.params)
        return plain.iterate(state.replace(params=params), None)

    iterate = jax.jit(jax.vmap(guarded(plain._replace(iterate=breaking)).iterate))
    alone = jax.jit(jax.vmap(plain.iterate, in_axes=(0, None)))
    state = other = jax.vmap(plain.init, in_axes=(0, None))(jax.random.split(jax.random.key(0), 2), None)
    faults, kept = [], None
    for _ in range(5):
        state, metrics = iterate(state, jnp.array([True, False]))
        other, _ = alone(other, None)
        faults.append(metrics.fault.tolist())
        kept = state.params if len(faults) == 2 else kept
    later = [Fault.PARAMETERS, 0]  # since the optimiser holds NaN by then
    assert faults == [[0, 0], [0, 0], [Fault.LOSS, 0], later, later]
    first, second = (jax.tree.map(lambda x, i=i: np.asarray(x)[i], state.params) for i in range(2))
    chex.assert_trees_all_equal(first, jax.tree.map(lambda x: np.asarray(x)[0], kept))
    chex.assert_trees_all_equal(second, jax.tree.map(lambda x: np.asarray(x)[1], other.params))
