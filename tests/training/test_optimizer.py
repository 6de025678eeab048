"""The optimiser: a step size of the task encoder's own changes its steps and no others."""

import re
from dataclasses import replace

import chex
import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest
from flax import struct

from t2tl_jax.agents import dp, dqn, ppo
from t2tl_jax.agents.dp_config import DPConfig
from t2tl_jax.agents.dqn_config import DQNConfig
from t2tl_jax.agents.ppo_config import PPOConfig
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.runs.checkpoints import Checkpoints
from t2tl_jax.single_state import SingleState, SingleStateConfig
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.training import few_kernels
from t2tl_jax.training.optimizer import clipped_adam
from tests.probe import DiscreteProbeEnv

PARAMS = {"params": {"task_encoder": {"w": np.ones(3, np.float32)}, "actor": {"w": np.ones(2, np.float32)}}}
GRADIENTS = jax.tree.map(lambda x: 0.1 * np.arange(1, 1 + x.size, dtype=np.float32), PARAMS)

LEARNERS = {
    "dqn": (dqn, dqn.make_dqn, DQNConfig(), DiscreteProbeEnv()),
    "ppo": (ppo, ppo.make_ppo, PPOConfig(), DiscreteProbeEnv()),
    "dp": (dp, dp.make_dp, DPConfig(), SingleState(SingleStateConfig(("Up", "Down")))),
}


def moved(own, anneal=False, steps=2):
    """Parameters after some steps on the same gradients, by part, less what they were."""
    optimizer = clipped_adam(1e-2, 0.2, gradient_steps=10, anneal=anneal, task_encoder_learning_rate=own)
    params, state = PARAMS, optimizer.init(PARAMS)
    for _ in range(steps):
        updates, state = optimizer.update(GRADIENTS, state, params)
        params = optax.apply_updates(params, updates)
    return {name: part["w"] - 1 for name, part in params["params"].items()}, state


def test_the_same_rate_changes_nothing_and_another_one_only_the_encoder():
    for anneal in (False, True):
        without, same, tenth = (moved(own, anneal)[0] for own in (None, 1e-2, 1e-3))
        for part in without:
            np.testing.assert_allclose(same[part], without[part], rtol=1e-6)
        np.testing.assert_allclose(tenth["actor"], without["actor"], rtol=1e-6)
        np.testing.assert_allclose(tenth["task_encoder"], without["task_encoder"] / 10, rtol=1e-4)


def test_a_frozen_encoder_stays_and_the_rest_moves_as_with_gradients_of_zero():
    gradients = {"params": {**GRADIENTS["params"], "task_encoder": {"w": np.zeros(3, np.float32)}}}
    params, held = {}, {}
    for frozen in (False, True):
        optimizer = clipped_adam(1e-2, 0.2, gradient_steps=10, anneal=True, freeze_task_encoder=frozen)
        params[frozen], state = PARAMS, optimizer.init(PARAMS)
        for _ in range(3):
            updates, state = optimizer.update(gradients, state, params[frozen])
            params[frozen] = optax.apply_updates(params[frozen], updates)
        held[frozen] = sum(leaf.shape == (3,) for leaf in jax.tree.leaves(state))
    chex.assert_trees_all_equal(params[True], params[False])
    assert held == {False: 2, True: 0}  # Adam's two moments of the encoder, which cost time to keep


@pytest.mark.parametrize("own", [None, 1e-3])
def test_a_run_with_more_steps_than_can_be_counted_is_annealed_by_its_share(own):
    """To the sizes of a run that is counted, with the same state, in which checkpoints are stored."""
    counted, shared = (clipped_adam(1e-2, 0.2, steps, True, task_encoder_learning_rate=own) for steps in (10, 10**10))
    params, state, expected = PARAMS, shared.init(PARAMS), counted.init(PARAMS)
    for step in range(12):
        updates, state = shared.update(GRADIENTS, state, params, share=jnp.float32(step / 10))
        wanted, expected = counted.update(GRADIENTS, expected, params, share=jnp.float32(0.5))  # which is not read
        chex.assert_trees_all_close(updates, wanted, rtol=1e-5, atol=1e-9)
        chex.assert_trees_all_equal(state, expected)


@pytest.mark.parametrize("size", [1.0, 1e3, 0.0, np.nan, np.inf, 1e30], ids=str)
def test_clipping_is_that_of_optax_and_what_is_not_finite_changes_no_parameter(size):
    """1e30: every number is finite, their norm is not."""
    optimizer = clipped_adam(1e-2, 0.2, gradient_steps=10, anneal=False)
    usual = optax.chain(optax.clip_by_global_norm(0.2), optax.adam(1e-2))
    finite = np.isfinite(size) and size < 1e30
    first, then = GRADIENTS, jax.tree.map(lambda x: np.float32(size) * x, GRADIENTS)
    (_, state), (_, expected) = (kind.update(first, kind.init(PARAMS), PARAMS) for kind in (optimizer, usual))
    chex.assert_trees_all_close(state, expected, rtol=1e-6)  # of the same structure, in which checkpoints are stored
    updates, state = optimizer.update(then, state, PARAMS)
    other, expected = usual.update(then if finite else jax.tree.map(np.zeros_like, then), expected, PARAMS)
    chex.assert_trees_all_close(state, expected, rtol=1e-6)
    chex.assert_trees_all_close(updates, other if finite else jax.tree.map(np.zeros_like, then), rtol=1e-6)


def test_the_norm_of_many_arrays_is_one_sum_and_one_number_decides_on_all():
    """What makes few kernels of them on a GPU. As in a run, there is an axis of seeds."""
    rng = np.random.default_rng(0)
    gradients = {"params": {str(i): rng.normal(size=(1, 3, 2 + i % 2)).astype(np.float32) for i in range(9)}}
    params = jax.tree.map(np.zeros_like, gradients)
    optimizer = clipped_adam(1e-2, 0.5, gradient_steps=10, anneal=False)
    state = jax.vmap(optimizer.init)(params)
    lines = str(jax.make_jaxpr(jax.vmap(optimizer.update))(gradients, state, params)).splitlines()
    assert sum(" reduce_sum[" in line for line in lines) == 1
    (barrier,) = (line for line in lines if "optimization_barrier" in line)
    assert re.search(r":bool\[(1,2|2,1)\]", barrier)  # versions of JAX differ in where they put the seeds
    norm = jax.jit(jax.vmap(few_kernels.global_norm))(gradients)
    np.testing.assert_allclose(norm, jax.vmap(optax.tree.norm)(gradients), rtol=1e-6)


def by_numpy(gradient, norm):
    """Each array shortened to a norm."""
    return jax.tree.map(lambda x: x * min(1.0, norm / np.sqrt((x.astype(float) ** 2).sum())), gradient)


def test_each_array_is_clipped_by_itself_side_by_side_and_what_is_not_finite_changes_nothing():
    """Of Adam's moments the first is a tenth of the first gradient. One number of the last seed is not finite."""
    rng = np.random.default_rng(0)
    sizes = {"task_encoder": {"w": 0.01}, "actor": {"w": 1.0, "b": 0.1}, "critic": {"w": 9.0}}
    gradients = {"params": jax.tree.map(lambda size: size * rng.normal(size=(3, 4, 2)).astype(np.float32), sizes)}
    gradients["params"]["actor"]["b"][2, 1, 1] = np.inf
    params = jax.tree.map(np.zeros_like, gradients)
    optimizer = clipped_adam(1e-2, 0.5, gradient_steps=10, anneal=False, each=True)
    begun = jax.vmap(optimizer.init)(params)
    updates, state = jax.jit(jax.vmap(optimizer.update))(gradients, begun, params)
    chex.assert_trees_all_equal_shapes_and_dtypes(state, begun)
    mu = optax.tree.get(state, "mu")
    for seed in range(3):
        given, moment, step = (jax.tree.map(lambda x, seed=seed: x[seed], of) for of in (gradients, mu, updates))
        clipped = by_numpy(given, 0.5) if seed < 2 else jax.tree.map(np.zeros_like, given)
        chex.assert_trees_all_close(moment, jax.tree.map(lambda x: 0.1 * x, clipped), rtol=1e-5)
        assert all(np.all((x != 0) == (seed < 2)) for x in jax.tree.leaves(step))
    shortened = [np.linalg.norm(x[0]) > 0.5 for x in jax.tree.leaves(gradients)]
    assert any(shortened) and not all(shortened)


@pytest.mark.parametrize("name", LEARNERS)
def test_every_learner_clips_as_its_configuration_says(monkeypatch, name):
    module, make, config, world = LEARNERS[name]
    told = []
    monkeypatch.setattr(module, "clipped_adam", lambda *_, **options: told.append(options["each"]))
    env = TaskEnv(world, compile_tasks("F Up", world.propositions, world.alphabet))
    for clipping in ("global", "each"):
        make(env, replace(config, gradient_clipping=clipping), 9, 2)
    assert told == [False, True]


@struct.dataclass
class State:
    params: dict
    opt_state: optax.OptState
    best_params: dict
    best_score: jax.Array


def test_a_checkpoint_holds_its_state(tmp_path):
    """Its structure has places without arrays, which stay what they are."""
    _, opt_state = moved(1e-3)
    state = jax.tree.map(lambda x: jnp.asarray(x)[None], State(PARAMS, opt_state, PARAMS, np.zeros(())))
    with Checkpoints(tmp_path) as checkpoints:
        checkpoints.save(1, state, {})
        _, restored = checkpoints.restore(state)
    chex.assert_trees_all_equal(restored, state)
