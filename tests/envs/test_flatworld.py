"""FlatWorld: which colours hold together, its nine actions, its edge, its starts, the published tasks."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from envs.flatworld import EPISODE_LENGTH, LETTERS, FlatWorld, FlatWorldConfig
from envs.flatworld.config import REGIONS
from t2tl_jax.evaluation.episodes import first_episodes
from t2tl_jax.evaluation.report import summarise, table
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.ltl.benchmark_tasks import BENCHMARK_TASKS
from t2tl_jax.registry import make_env
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.training.unroll import Player

TASKS = tuple(BENCHMARK_TASKS[f"flat_{number}"] for number in range(1, 6))

# By number: up, right, down, left, the diagonals, nothing.
WAYS = [(0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1), (0, 0)]


@pytest.fixture(scope="module")
def env() -> FlatWorld:
    return FlatWorld(FlatWorldConfig(pool_size=200))


@pytest.fixture(scope="module")
def labels_at(env):
    return jax.jit(jax.vmap(lambda position: env.labels(env.reset_to(position))))


@pytest.fixture(scope="module")
def task_env(env):
    return TaskEnv(env, compile_tasks(TASKS, env.propositions, env.alphabet))


def test_thirteen_letters_occur(env, labels_at):
    xs = np.linspace(-2, 2, 201)
    labels = np.asarray(labels_at(np.stack(np.meshgrid(xs, xs), axis=-1).reshape(-1, 2)))
    names = np.array(env.propositions)
    alone = [{name} for name in names]
    together = [{"Red", "Magenta"}, {"Blue", "Green"}, {"Green", "Aqua"}, {"Blue", "Aqua"}, {"Blue", "Green", "Aqua"}]
    expected = {frozenset(letter) for letter in [set(), *alone, *together]}
    assert {frozenset(names[letter]) for letter in np.unique(labels, axis=0)} == expected and len(expected) == 13


def test_labels_hold_strictly_inside(env, labels_at):
    """By the definition in float64; and on the edge of the green disc of radius 0.5, whose distance is exact."""
    rng = np.random.default_rng(0)
    points = rng.uniform(-2, 2, (5000, 2)).astype(np.float32)
    for point, label in zip(points, np.asarray(labels_at(points)), strict=True):
        distances = {(name, x, y): (np.hypot(point[0] - x, point[1] - y), r) for name, x, y, r in REGIONS}
        if all(abs(distance - radius) > 1e-5 for distance, radius in distances.values()):
            inside = {name for (name, *_), (distance, radius) in distances.items() if distance < radius}
            assert inside == {name for name, holds in zip(env.propositions, label, strict=True) if holds}
    edge = np.float32(0.7) - np.float32(0.5)
    on_and_in = np.array([[0.7, edge], [0.7, edge + 1e-6]], np.float32)
    np.testing.assert_array_equal(labels_at(on_and_in)[:, env.propositions.index("Green")], [False, True])


@pytest.mark.parametrize("action", range(9))
def test_actions(env, action):
    state = env.reset_to((0.25, -0.5))
    way = np.array(WAYS[action], float)
    after = jax.jit(env.step)(state, jnp.int32(action))
    expected = np.array([0.25, -0.5]) + 0.08 * way / max(1.0, np.linalg.norm(way))
    np.testing.assert_allclose(after.obs, expected, atol=1e-7)
    np.testing.assert_array_equal(after.obs, after.pipeline_state.position)
    assert after.reward == 0 and after.done == 0
    as_array = jax.jit(env.step)(state, jnp.array([action]))
    np.testing.assert_array_equal(as_array.obs, after.obs)


@pytest.mark.parametrize(("action", "at"), [(0, (0.3, 1.95)), (1, (1.95, 0.3)), (2, (0.3, -1.95)), (3, (-1.95, 0.3))])
def test_leaving_ends_the_episode_with_a_reward_of_minus_one(env, action, at):
    step = jax.jit(env.step)
    after = step(env.reset_to(at), jnp.int32(action))
    assert after.done == 1 and after.reward == -1 and np.abs(after.obs).max() > 2
    stayed = step(env.reset_to(at), jnp.int32(8))
    assert stayed.done == 0 and stayed.reward == 0


def test_starts_lie_outside_all_discs_and_everywhere_else(env, labels_at):
    starts = FlatWorld(FlatWorldConfig(pool_size=4000)).make_params(0).starts
    assert not labels_at(starts).any() and np.abs(starts).max() <= 2
    # Uniform: in a cell of the grid lie as many as its share of what is outside.
    xs = np.linspace(-2, 2, 401)[:-1] + 0.005
    grid = np.stack(np.meshgrid(xs, xs), axis=-1).reshape(-1, 2)
    outside = grid[~np.asarray(labels_at(grid)).any(1)]
    area, counts = (np.histogram2d(*points.T, bins=4, range=[[-2, 2]] * 2)[0] for points in (outside, starts))
    expected = 4000 * area / area.sum()
    assert (np.abs(counts - expected) < 4.5 * np.sqrt(expected) + 1).all()
    pools = [env.make_params(seed, purpose).starts for seed in (0, 1) for purpose in ("training", "evaluation")]
    assert len(np.unique(np.concatenate(pools), axis=0)) == 800


def test_no_label_at_a_reset(env):
    states = jax.jit(jax.vmap(env.reset))(jax.random.split(jax.random.key(0), 500))
    assert not jax.jit(jax.vmap(env.labels))(states).any()
    assert len(np.unique(np.asarray(states.obs), axis=0)) > 150


def play(env: TaskEnv, act, count: int, limit: int):
    """The first episodes of so many environments."""
    given = env.make_params(0)
    player = Player(lambda carry, state, key: (act(state, key), carry, ()))
    run = jax.jit(lambda key: first_episodes(env, player, (), given, key, count, limit, 0.98))
    return jax.device_get(run(jax.random.key(0)))


@pytest.mark.slow
def test_leaving_is_reported_apart_from_violation(task_env):
    """Everybody goes right: whoever does not end by a verdict before leaves; nobody runs out of time."""
    played = play(task_env, lambda state, key: jnp.full(len(state.obs), 1), 200, EPISODE_LENGTH)
    assert played.env_termination.sum() > 100 and played.violation.sum() > 5
    np.testing.assert_array_equal(1 * played.success + played.violation + played.env_termination, 1)
    np.testing.assert_array_equal(played.total_reward, np.where(played.success, 1, -1))
    report = summarise(jax.tree.map(lambda x: x[None], played), [0])
    seed = report.seeds[0]
    assert seed.env_termination_rate.value == played.env_termination.mean()
    assert seed.violation_rate.value == played.violation.mean() and seed.timeout_rate.value == 0
    shown = table({"final sampled": report}).splitlines()
    at = shown[0].index("ended by env")
    assert float(shown[2][at:].split()[0]) == round(played.env_termination.mean(), 3)


def test_the_published_tasks_are_solved_by_a_script(task_env):
    """By steps towards one point after another of a plan made by hand: all five can be carried out."""
    plans = (
        [(-1.15, 0.78), (0.5, 0.35), (-1, -1.2)],
        [(-1.53, -0.5), (-0.7, 0.5), (-0.8, 1.2)],
        [(0.65, 0.35), (-1.53, -0.5), (-1.15, 0.78)],
        [(-0.9, 1.2), (0.3, 0.6)],
        [(-1, -1.2)],
    )
    starts = ((-1.8, 1.6), (-1.9, -1.5), (1.8, 1.8), (-1.8, 1.8), (0, -1.8))
    step, directions = (
        jax.jit(task_env.step),
        np.array([way / np.linalg.norm(way) for way in np.array(WAYS[:8], float)]),
    )
    for row, plan, start in zip(task_env.table.initial_row, plans, starts, strict=True):
        state = task_env.reset_to_row(jax.random.key(0), row)
        first = task_env.env.reset_to(start)
        state = state.replace(pipeline_state=state.pipeline_state.replace(env=first.pipeline_state), obs=first.obs)
        for goal in plan:
            for _ in range(100):
                way = np.array(goal) - np.asarray(state.obs)
                if np.linalg.norm(way) < 0.06 or state.done:
                    break
                state = step(state, jnp.int32(np.argmin(np.linalg.norm(way - 0.08 * directions, axis=1))))
        assert state.done == 1 and state.reward == 1


def test_names_and_horizon(env):
    assert EPISODE_LENGTH == 500 and make_env("FlatWorld-v0").config == FlatWorldConfig()
    assert env.propositions == ("Aqua", "Blue", "Green", "Magenta", "Orange", "Red", "Yellow")


@pytest.mark.parametrize(
    ("config", "message"),
    [({"pool_size": 0}, "at least one start"), ({"pool_seed": -1}, "must not be negative")],
)
def test_bad_configurations_fail_clearly(config, message):
    with pytest.raises(ValueError, match=message):
        FlatWorldConfig(**config)


@pytest.mark.slow
def test_letters_are_the_sets_of_colours_that_hold_somewhere():
    world = FlatWorld()
    grid = np.stack(np.meshgrid(*[np.linspace(-2, 2, 401)] * 2), axis=-1).reshape(-1, 2)
    labels = np.unique(jax.vmap(lambda place: world.labels(world.reset_to(place)))(grid), axis=0)
    found = {frozenset(np.array(world.propositions)[of].tolist()) for of in labels}
    assert found == {frozenset(), *(frozenset(letter.split(" & ")) for letter in LETTERS)}
