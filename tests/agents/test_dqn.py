"""Double DQN: schedules, replay, frozen encoders, a probe that a correct learner solves."""

import dataclasses
import math
from functools import partial

import chex
import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest

from t2tl_jax.agents.dqn import epsilon, make_dqn
from t2tl_jax.agents.dqn_config import DQNConfig
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.networks.q_network import QNetwork, QNetworkConfig
from t2tl_jax.networks.task_encoders import OneHotConfig
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.training.numbers import make_given, numbers_of
from tests.agents.sizes import GRAPH, TRANSFORMER
from tests.parameters import begun_quickly, parameters
from tests.probe import DiscreteProbeEnv

NETWORK = QNetworkConfig(
    task_encoder=TRANSFORMER,
    state_layers=(),
    task_layer=32,
)
ONE_HOT = dataclasses.replace(NETWORK, task_encoder=OneHotConfig())  # compiles faster where the encoder does not matter
SMALL = dataclasses.replace(ONE_HOT, head="bilinear", dueling=False)  # where the head does not, either
DQN = DQNConfig(
    num_envs=8,
    unroll_length=25,
    batch_size=64,
    buffer_size=2000,
    learning_starts=100,
    target_period=20,
    discount=0.9,
    learning_rate=3e-3,
    anneal_learning_rate=False,
    epsilon_fraction=0.5,
)
ITERATIONS = 15
TASK = "!Down U (Up & F(Down & F Up))"


@pytest.fixture(scope="module")
def env():
    probe = DiscreteProbeEnv()
    return TaskEnv(probe, compile_tasks([TASK], probe.propositions, probe.alphabet))


def make(env, network=NETWORK, iterations=ITERATIONS, **changes):
    return make_dqn(env, dataclasses.replace(DQN, network=network, **changes), episode_length=20, iterations=iterations)


@pytest.fixture(scope="module")
def learner(env):
    """A learner with a small buffer as (init, iterate), compiled once for all tests; a second trace is an error."""
    sizes = {"unroll_length": 10, "buffer_size": 64, "learning_starts": 8 * 20, "target_period": 15}
    agent, given = begun_quickly(make(env, SMALL, **sizes)), env.make_params(0)
    chex.clear_trace_counter()  # it counts by source: in a process that comes back to this module, the first one too
    init, iterate = jax.jit(agent.init), jax.jit(chex.assert_max_traces(agent.iterate, n=1))
    return agent, lambda key: init(key, given), lambda state: iterate(state, given)


def compiled(env, network, start=lambda agent: agent, **changes):
    """Agent, init and iterate of a learner, and the arguments of both; its numbers are among them, to be replaced."""
    config = dataclasses.replace(DQN, network=network, **changes)
    agent = start(make_given(make_dqn, env, config, 20, ITERATIONS))

    def given(**numbers):
        return env.make_params(0).replace(numbers=jax.tree.map(np.float32, numbers_of(config, 0.0) | numbers))

    return agent, jax.jit(agent.init), jax.jit(agent.iterate), given


@pytest.fixture(scope="module")
def reader(env):
    """The learner with the Transformer, whose step size is an argument of its own."""
    return compiled(env, NETWORK, task_encoder_learning_rate=DQN.learning_rate)


def test_codes_of_all_encoders_are_of_the_same_length_to_the_bilinear_head(env):
    for config in (NETWORK, ONE_HOT):
        network = QNetwork(dataclasses.replace(config, head="bilinear"), 3)
        shape = (4, config.task_encoder.code_size)
        embedding = jnp.eye(*shape) if config is ONE_HOT else jnp.ones(shape)
        codes = network.apply({}, embedding, method="codes")
        np.testing.assert_allclose(jnp.linalg.norm(codes[:, :-1], axis=-1), 1.0, rtol=1e-6)
        np.testing.assert_array_equal(codes[:, -1], 1.0)


@pytest.mark.parametrize("state_layers", [(16, 8), ()])
def test_the_concat_head_is_a_network_on_state_and_code_side_by_side(state_layers):
    """Against one written out in NumPy whose first layer has the state's and the code's weights one below the other."""
    network = QNetwork(dataclasses.replace(ONE_HOT, head="concat", state_layers=state_layers, dueling=False), 3)
    rng = np.random.default_rng(0)
    obs, codes = rng.normal(size=(5, 4)).astype(np.float32), rng.normal(size=(2, 16)).astype(np.float32)
    params = parameters(network, obs, codes, method="every_row")
    q = jax.jit(partial(network.apply, method="every_row"))(params, obs, codes)

    own = params["params"]
    first = np.concatenate([own["state_encoder_0"]["kernel"], own["task_share"]["kernel"]])
    assert first.shape == (4 + 16, (*state_layers, NETWORK.task_layer)[0])
    for row in range(2):
        x = np.concatenate([obs, np.repeat(codes[row : row + 1], 5, axis=0)], axis=1) @ first
        x = np.maximum(x + own["state_encoder_0"]["bias"], 0)
        for layer in range(1, len(state_layers) + 1):
            part = own[f"state_encoder_{layer}"]
            x = np.maximum(x @ part["kernel"] + part["bias"], 0)
        np.testing.assert_allclose(q[:, row], x @ own["advantage"]["kernel"] + own["advantage"]["bias"], atol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("head", ["film", "bilinear", "concat"])
def test_one_row_at_a_time_equals_every_row(env, head):
    network, rng = QNetwork(dataclasses.replace(NETWORK, head=head), 3), np.random.default_rng(0)
    obs, codes = (rng.normal(size=shape).astype(np.float32) for shape in ((5, 3), (env.table.num_rows, 8)))
    params = parameters(network, env.table, obs, method="initialise")

    @jax.jit
    def compute(codes):
        one = jax.vmap(lambda row: network.apply(params, obs, codes, jnp.full(5, row)), out_axes=1)
        return network.apply(params, obs, codes, method="every_row"), one(jnp.arange(len(codes)))

    np.testing.assert_allclose(*compute(codes), atol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("head", ["film", "bilinear", "concat"])
def test_probe_is_solved(env, head, request):
    """As it is initialised with the head that is the default, and from any start with the others."""
    if head == "film":
        agent, init, iterate, given = request.getfixturevalue("reader")
    else:
        network = dataclasses.replace(ONE_HOT, head=head)
        agent, init, iterate, given = compiled(env, network, start=begun_quickly)
    state = init(jax.random.key(0), given())
    for _ in range(ITERATIONS):
        state, _ = iterate(state, given())
    embedding, row = jax.jit(agent.embed)(state.params, env.table), env.table.initial_row[0]

    @jax.jit
    def step(env_state):
        action = agent.act(state.params, embedding, (), env_state.obs, env.row(env_state), jax.random.key(2), True)
        return env.step(env_state, action)

    env_state, steps = jax.jit(env.reset_to_row)(jax.random.key(1), row), 0
    while not env_state.done and steps < 10:
        env_state, steps = step(env_state), steps + 1
    assert steps == 3 and env_state.reward == 1

    # Up is wanted in row 2 and Down in row 3: with the other's code the greedy action is another one.
    compare = jax.jit(lambda code: agent.compare(state.params, (), jnp.ones((1, 3)), code, embedding[row]))
    same, other = compare(embedding[2]), compare(embedding[3])
    assert same == (0, 0) and other[0] == 1


def test_epsilon_falls_linearly_and_stays():
    config = dataclasses.replace(DQN, epsilon_start=1.0, epsilon_end=0.1, epsilon_fraction=0.2)
    values = [float(epsilon(config, jnp.float32(p))) for p in (0.0, 0.1, 0.2, 0.7)]
    np.testing.assert_allclose(values, [1.0, 0.55, 0.1, 0.1], atol=1e-6)


@pytest.mark.slow
def test_nothing_is_learnt_before_the_start_and_targets_are_copied_on_time(learner):
    _, init, iterate = learner
    start = init(jax.random.key(0))
    one, _ = iterate(start)
    two, _ = iterate(one)
    chex.assert_trees_all_equal(two.params, start.params)  # 20 steps of 8 environments: not yet more than 160
    three, _ = iterate(two)
    assert any((a != b).any() for a, b in zip(*map(jax.tree.leaves, (three.params, start.params)), strict=True))
    chex.assert_trees_all_equal(three.target_params, start.params)  # next copy at gradient step 30
    four, _ = iterate(three)
    assert any((a != b).any() for a, b in zip(*map(jax.tree.leaves, (four.target_params, start.params)), strict=True))
    assert four.iteration == 4  # traced once


@pytest.mark.slow
@pytest.mark.parametrize("iteration", [0, 10**9 + 7])
@pytest.mark.parametrize(("updates_per_step", "target_period", "steps"), [(1, 6, 4), (2, 12, 4), (2, 9, 3)])
def test_the_target_is_copied_when_the_count_of_gradient_steps_says(
    env, updates_per_step, target_period, steps, iteration
):
    """Some copies fall on the beginning of an iteration, others within one: between two blocks of its steps, or between
    the two updates of a step. Also where the count has more than 32 bits."""
    network = dataclasses.replace(SMALL, task_encoder=OneHotConfig(size=env.table.num_rows))
    config = dataclasses.replace(DQN, network=network, unroll_length=steps, learning_starts=0)
    config = dataclasses.replace(config, updates_per_step=updates_per_step, target_period=target_period)
    iterations = iteration + ITERATIONS
    agent, given = make_dqn(env, config, episode_length=5, iterations=iterations), env.make_params(0)
    start, iterate = jax.jit(agent.init)(jax.random.key(0), given), jax.jit(agent.iterate)
    states = [dataclasses.replace(start, iteration=jnp.int32(iteration))]
    begun = [iteration * steps * updates_per_step]  # gradient steps before each state
    for _ in range(4):
        states.append(iterate(states[-1], given)[0])
        begun.append(begun[-1] + steps * updates_per_step)
        due = (begun[-1] - 1) // target_period * target_period  # the last copy before the end of the iteration
        due = max(due, begun[0])  # before any, the target is what it was at the start
        target = states[-1].target_params
        same = [jax.tree.all(jax.tree.map(lambda a, b: (a == b).all(), target, state.params)) for state in states]
        assert [count for count, is_same in zip(begun, same, strict=True) if is_same] == [due] * (due in begun)


@pytest.fixture(scope="module")
def frozen(env):
    """A learner with a frozen encoder whose episodes of five steps start anywhere; its state before and after once."""
    world = TaskEnv(env.env, env.table, random_starts=1.0)
    network = dataclasses.replace(SMALL, task_encoder=GRAPH, freeze_task_encoder=True)
    config = dataclasses.replace(DQN, network=network, learning_starts=8)
    agent, given = make_dqn(world, config, episode_length=5, iterations=ITERATIONS), env.make_params(0)
    start = jax.jit(begun_quickly(agent).init)(jax.random.key(0), given)
    return agent, start, jax.jit(agent.iterate)(start, given)[0]


@pytest.mark.slow
def test_a_frozen_encoder_stays_and_all_else_learns(env, frozen):
    agent, start, state = frozen
    before, after = start.params["params"], state.params["params"]
    chex.assert_trees_all_equal(after["task_encoder"], before["task_encoder"])
    for part in set(before) - {"task_encoder"}:
        leaves = zip(jax.tree.leaves(after[part]), jax.tree.leaves(before[part]), strict=True)
        assert any((a != b).any() for a, b in leaves), part
    embedding = jax.jit(agent.embed)(state.params, env.table)
    chex.assert_trees_all_close(state.target_embedding, embedding, atol=1e-6)


@pytest.mark.slow
def test_movement_is_measured_of_an_encoder_that_learns(reader):
    """By a step size of its own, which is far larger than that of the rest: 0."""
    _, init, iterate, given = reader
    numbers = given(learning_rate=0.0, task_encoder_learning_rate=1e-2)
    start = init(jax.random.key(0), numbers)
    state, metrics = iterate(start, numbers)
    assert min(metrics.scalars[name] for name in ("code_change", "code_change_relative", "target_lag")) > 1e-3
    before, after = start.params["params"], state.params["params"]
    for part in before:
        leaves = zip(jax.tree.leaves(after[part]), jax.tree.leaves(before[part]), strict=True)
        assert any((a != b).any() for a, b in leaves) == (part == "task_encoder"), part


@pytest.mark.slow
def test_episodes_start_over_all_of_psi(env, frozen):
    _, _, state = frozen
    row = np.asarray(state.buffer.experience.row).reshape(-1)[: 25 * 8].reshape(25, 8)
    ended = np.asarray(state.buffer.experience.cut).reshape(-1)[: 25 * 8].reshape(25, 8)
    firsts = np.concatenate([row[0], row[1:][ended[:-1]]])  # behind a time limit begins a new episode
    assert set(firsts) == set(np.flatnonzero(np.asarray(env.table.is_open))) and ended.any()


@pytest.mark.slow
def test_replay_wraps_around_and_keeps_the_newest(learner):
    _, init, iterate = learner
    state, _ = iterate(init(jax.random.key(0)))
    assert state.buffer.is_full and state.buffer.current_index == (10 * 8) % 64
    stored = state.buffer.experience
    assert stored.obs.shape == (1, 64, 3)
    labels_match = np.asarray(stored.shared.letter[0]) == np.array([0, 1, 2])[np.asarray(stored.action[0])]
    assert labels_match.all()  # every slot holds one consistent transition: action k makes letter k


@pytest.mark.slow
def test_ten_billion_steps_overflow_no_counter(env):
    """In a run whose steps have more than 32 bits exploration, step size and the start of learning are as Python's
    whole numbers say, in two iterations begun anywhere in it."""
    length, starts, total = 10, 15, 10**10
    rates = {"learning_rate": 1e-5, "anneal_learning_rate": True, "epsilon_fraction": 1.0}
    sizes = {"unroll_length": length, "num_envs": 1, "learning_starts": starts, "batch_size": 16}
    agent = begun_quickly(make(env, SMALL, iterations=total // length, **sizes, **rates))
    given, iterate = env.make_params(0), jax.jit(chex.assert_max_traces(agent.iterate, n=1))
    state = jax.jit(agent.init)(jax.random.key(0), given)

    def moves(begun):
        """How far the parameters move in two iterations begun there."""
        before, moved = dataclasses.replace(state, iteration=jnp.int32(begun)), []
        for iteration in (begun, begun + 1):
            after, metrics = iterate(before, given)
            share = iteration * length / total
            expected = DQN.epsilon_start + share * (DQN.epsilon_end - DQN.epsilon_start)
            assert metrics.scalars["epsilon"] == pytest.approx(expected, abs=1e-6)
            assert after.iteration == iteration + 1
            moved.append(float(optax.tree.norm(optax.tree.sub(after.params, before.params))))
            before = after
        return moved

    early, late, end = (moves(at) for at in (0, 9 * total // length // 10, total // length - 2))
    assert early[0] == 0 < early[1]  # 10 steps, of which none learns, and 10 of which 5 do
    # Adam's step is about as large whatever the gradient: a tenth of the step size is left, for twice as many steps.
    assert late[0] == pytest.approx(2 * early[1] / 10, rel=0.5) and late[1] > 0
    assert max(end) < 1e-6 * early[1]
    assert dataclasses.replace(DQN, **sizes).max_frames == (2**31 - 1) * length


@pytest.mark.slow
def test_vmapped_seeds_equal_single_seeds(env, learner):
    """In the third iteration they learn."""
    agent, init, iterate = learner
    keys, given = jax.random.split(jax.random.key(3), 2), env.make_params(0)
    init_all, iterate_all = (jax.jit(jax.vmap(function, (0, None))) for function in (agent.init, agent.iterate))
    together, alone = init_all(keys, given), init(keys[1])
    for _ in range(3):
        together, metrics_all = iterate_all(together, given)
        alone, metrics_one = iterate(alone)
    chex.assert_trees_all_close(jax.tree.map(lambda x: x[1], metrics_all), metrics_one, atol=1e-3)
    chex.assert_trees_all_equal(
        jax.tree.map(lambda x: x[1], together.buffer.experience.action), alone.buffer.experience.action
    )


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"batch_size": 5000}, "buffer_size"),
        ({"num_envs": 0}, "at least 1"),
        ({"updates_per_step": 2**30}, "updates_per_iteration must be at most 2,147,483,647"),
        ({"learning_starts": 10**10}, "learning_starts must be at most 2,147,483,647"),
        ({"discount": math.nan}, "discount must lie between 0 and 1"),
        ({"epsilon_start": 2.0}, "epsilon_start must lie between 0 and 1"),
        ({"epsilon_end": math.nan}, "epsilon_end must lie between 0 and 1"),
        ({"max_gradient_norm": 0.0}, "max_gradient_norm must be a finite number above 0"),
        ({"task_encoder_learning_rate": -1.0}, "task_encoder_learning_rate must be a finite number, 0 or more"),
        (
            {"task_encoder_learning_rate": 1e-5, "network": dataclasses.replace(NETWORK, freeze_task_encoder=True)},
            "a frozen task encoder has no learning rate",
        ),
        ({"learning_rate": -1e-4}, "learning_rate must be a finite number, 0 or more"),
    ],
)
def test_impossible_settings_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(DQN, **changes)
