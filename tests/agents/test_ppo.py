"""PPO: replayed rollouts have ratio 1, tables give per-sample gradients, a probe is solved, seeds are independent."""

import dataclasses
import math
from functools import cache

import chex
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.agents.ppo import make_ppo, noise_correlation
from t2tl_jax.agents.ppo_learning import Batch, ppo_loss
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.networks.actor_critic import ActorCritic, NetworkConfig
from t2tl_jax.networks.task_encoders import OneHotConfig
from t2tl_jax.task_env import TaskEnv
from tests.agents.sizes import GRAPH, GRU, PPO, TRANSFORMER
from tests.parameters import begun_quickly, parameters
from tests.probe import ProbeEnv

NETWORK = NetworkConfig(
    task_encoder=TRANSFORMER,
    env_layers=(16,),
    actor_layers=(16,),
    critic_layers=(),
)
OTHERS = {"one_hot": OneHotConfig(), "rgcn": GRAPH, "gru": GRU}
ITERATIONS = 30  # enough for every encoder; most need 20
# These compile faster, where the layers do not matter: an encoder that learns, and one that does not.
SMALL = NetworkConfig(task_encoder=GRAPH, env_layers=(), actor_layers=(8,), critic_layers=())
ONE_HOT = dataclasses.replace(SMALL, task_encoder=OneHotConfig())


@pytest.fixture(scope="module")
def env():
    probe = ProbeEnv()
    return TaskEnv(probe, compile_tasks(["F(Up & F(Down & F Up))"], probe.propositions, probe.alphabet))


def make(env, iterations=ITERATIONS, network=NETWORK, **changes):
    return make_ppo(env, dataclasses.replace(PPO, network=network, **changes), episode_length=20, iterations=iterations)


@pytest.fixture(scope="module")
def learner(env):
    """The plain learner as (agent, init, iterate), compiled once for all tests; a second trace is an error."""
    agent, given = make(env), env.make_params(0)
    chex.clear_trace_counter()  # it counts by source: in a process that comes back to this module, the first one too
    init, iterate = jax.jit(agent.init), jax.jit(chex.assert_max_traces(agent.iterate, n=1))
    return agent, lambda key: init(key, given), lambda state: iterate(state, given)


@pytest.fixture(scope="module")
def small(env):
    """Small learners by the name of their encoder, each as (agent, init, iterate) and compiled once."""

    @cache
    def of(name):
        network = dataclasses.replace(SMALL, task_encoder=OTHERS[name])
        agent, given = begun_quickly(make(env, network=network)), env.make_params(0)
        init, iterate = jax.jit(agent.init), jax.jit(agent.iterate)
        return agent, lambda key: init(key, given), lambda state: iterate(state, given)

    return of


@pytest.fixture(scope="module")
def rollout(env):
    """State before and after one iteration of many environments with exploration noise, and its metrics.

    One epoch of one minibatch with a vanishing learning rate: the update sees what the rollout did.
    """
    sizes = {"num_envs": 512, "minibatch_size": 512 * PPO.unroll_length, "epochs": 1}
    agent, given = make(env, network=SMALL, noise_time=20.0, learning_rate=0.0, **sizes), env.make_params(0)
    state = jax.jit(begun_quickly(agent).init)(jax.random.key(0), given)
    return state, *jax.jit(agent.iterate)(state, given)


@pytest.mark.slow
def test_replaying_a_stored_rollout_gives_probability_ratio_one(rollout):
    """Without noise see `test_ppo_discrete.py` and `test_ppo_context.py`."""
    _, _, metrics = rollout
    assert metrics.episodes.episodes > 0  # the rollout crosses episode ends
    assert abs(metrics.scalars["kl"]) < 1e-6 and metrics.scalars["clip_fraction"] == 0


@pytest.mark.slow
def test_exploration_noise_keeps_its_variance_and_correlation(rollout):
    """An AR(1) process of the promised time scale, each value N(0, 1) by itself: the density that the loss assumes."""
    config = dataclasses.replace(PPO, noise_time=20.0, noise_decay=0.5)
    np.testing.assert_allclose(noise_correlation(config, jnp.float32(0)), np.exp(-1 / 20), atol=1e-6)
    np.testing.assert_allclose(noise_correlation(config, jnp.float32(0.25)), np.exp(-1 / 10), atol=1e-6)
    assert noise_correlation(config, jnp.float32(0.5)) == noise_correlation(config, jnp.float32(0.9)) == 0
    state, after, _ = rollout  # 16 steps at the start of the run
    before, after = np.asarray(state.noise).ravel(), np.asarray(after.noise).ravel()
    assert after.std() == pytest.approx(1.0, abs=0.12)
    assert np.corrcoef(before, after)[0, 1] == pytest.approx(np.exp(-16 / 20), abs=0.15)


@pytest.mark.slow
def test_encoding_each_formula_once_gives_the_per_sample_gradients(env):
    table, network = env.table, ActorCritic(NETWORK, env.action_size)
    rng, size = np.random.default_rng(0), 128
    normal = rng.normal(size=(size, 7)).astype(np.float32)
    batch = Batch(
        obs=jnp.array(normal[:, :3]),
        row=jnp.array(rng.integers(0, table.num_rows, size, np.int32)),
        action=jnp.array(normal[:, 3:4]),
        log_prob=jnp.array(normal[:, 4] - 1),
        value=jnp.array(normal[:, 5]),
        advantage=jnp.array(normal[:, 6]),
    )
    params = parameters(network, table, batch.obs, batch.row, method="initialise")

    def table_wise(params):
        task = network.apply(params, table, method="embed")[batch.row]
        return ppo_loss(PPO, network, params, task, batch)[0]

    def sample_wise(params):
        per_sample = table.replace(tokens=table.tokens[batch.row], mask=table.mask[batch.row])
        return ppo_loss(PPO, network, params, network.apply(params, per_sample, method="embed"), batch)[0]

    fast, slow = jax.jit(lambda params: [jax.grad(loss)(params) for loss in (table_wise, sample_wise)])(params)
    encoder = jax.tree.leaves(fast["params"]["task_encoder"])
    assert max(float(jnp.abs(leaf).max()) for leaf in encoder) > 1e-3  # the encoder does learn from this loss
    chex.assert_trees_all_close(fast, slow, atol=1e-5)


@pytest.mark.slow
def test_probe_is_solved_by_reading_the_formula(env, learner):
    agent, init, iterate = learner
    state = init(jax.random.key(0))
    for _ in range(ITERATIONS):
        state, metrics = iterate(state)
    totals = metrics.episodes
    assert totals.successes >= 0.95 * totals.episodes
    assert totals.length / totals.episodes < 4.5  # optimal 3; acting at random needs about 12
    assert totals.discounted_return / totals.episodes > 0.6

    # Up is wanted in row 2 and Down in row 3: the agent decides otherwise where the code of its row is exchanged.
    codes = jax.jit(agent.embed)(state.params, env.table)
    compare = jax.jit(lambda code: agent.compare(state.params, (), jnp.ones((5, 3)), codes[2], code))
    same, other = compare(codes[2]), compare(codes[3])
    np.testing.assert_allclose(same, 0.0, atol=1e-6)
    assert (other[0] > 1.0).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", OTHERS)
def test_other_task_encoders_solve_the_probe_too(small, name):
    _, init, iterate = small(name)
    state = init(jax.random.key(0))
    for _ in range(ITERATIONS):
        state, metrics = iterate(state)
    assert metrics.episodes.length / metrics.episodes.episodes < 4.5


@pytest.mark.slow
def test_vmapped_seeds_equal_single_seeds(env, small):
    """Same behaviour to 1e-3; not the same bits, since batched matrix products round differently."""
    agent, init_one, iterate_one = small("rgcn")
    keys = jax.random.split(jax.random.key(3), 3)
    given = env.make_params(0)
    together = jax.jit(jax.vmap(agent.init, (0, None)))(keys, given)
    alone = init_one(keys[1])
    iterate_all = jax.jit(jax.vmap(agent.iterate, (0, None)))
    for _ in range(2):
        together, metrics_all = iterate_all(together, given)
        alone, metrics_one = iterate_one(alone)
    chex.assert_trees_all_close(jax.tree.map(lambda x: x[1], metrics_all), metrics_one, atol=1e-3)

    @jax.jit
    def behaviour(params):
        rows = jnp.arange(env.table.num_rows)
        return agent.act(
            params, agent.embed(params, env.table), (), jnp.ones((len(rows), 3)), rows, jax.random.key(0), True
        )

    own = jax.tree.map(lambda x: x[1], together.params)
    np.testing.assert_allclose(behaviour(own), behaviour(alone.params), atol=1e-3)


@pytest.mark.slow
def test_iterations_compile_once(learner):
    _, init, iterate = learner  # a second trace is an error
    state = init(jax.random.key(0))
    for _ in range(3):
        state, _ = iterate(state)
    assert state.iteration == 3


@pytest.mark.slow
@pytest.mark.parametrize("terminal", [False, True])
def test_time_limit_is_bootstrapped_unless_told_otherwise(terminal):
    """With a value of exactly 1 everywhere, no reward and no discount, only a terminal time-out makes an error."""
    probe = ProbeEnv()
    env = TaskEnv(probe, compile_tasks(["F(Up & F(Down & F(Up & F(Down & F Up))))"], probe.propositions, "at_most_one"))
    config = dataclasses.replace(
        PPO,
        network=ONE_HOT,
        timeout_is_terminal=terminal,
        discount=1.0,
        gae_lambda=1.0,
        staggered_start=False,
        epochs=1,
        minibatch_size=256,
    )
    agent = make_ppo(env, config, episode_length=4, iterations=1)
    state = jax.jit(begun_quickly(agent).init)(jax.random.key(1), env.make_params(0))
    critic = state.params["params"]["critic"]["value"]
    critic["kernel"], critic["bias"] = jnp.zeros_like(critic["kernel"]), jnp.ones(1)
    _, metrics = jax.jit(agent.iterate)(state, env.make_params(0))
    assert metrics.episodes.timeouts == metrics.episodes.episodes == 64  # five goals cannot be met in four steps
    np.testing.assert_allclose(metrics.scalars["value_loss"], 1.0 if terminal else 0.0, atol=1e-5)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"minibatch_size": 60}, "must divide"),
        ({"minibatch_size": 0}, "minibatch_size must be at least 1"),
        ({"minibatch_size": -64}, "minibatch_size must be at least 1"),
        ({"num_envs": 0}, "num_envs must be at least 1"),
        ({"unroll_length": 0}, "unroll_length must be at least 1"),
        ({"num_envs": 2**20, "unroll_length": 2**11}, "batch_size must be at most"),
        ({"epochs": 0}, "epochs must be at least 1"),
        ({"gae_lambda": 1.5}, "between 0 and 1"),
        ({"learning_rate": math.nan}, "learning_rate must be a finite number, 0 or more, got nan"),
        ({"max_gradient_norm": 0.0}, "max_gradient_norm must be a finite number above 0, got 0"),
        ({"clip_eps": -0.2}, "clip_eps must be a finite number above 0"),
        ({"noise_time": math.inf}, "noise_time must be a finite number, 0 or more"),
    ],
)
def test_impossible_settings_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(PPO, **changes)
