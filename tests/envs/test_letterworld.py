"""LetterWorld: which maps are valid, moves over joined edges, labels, what is seen, the published tasks."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from envs.letterworld import EPISODE_LENGTH, LetterWorld, LetterWorldConfig, LetterWorldParams
from envs.letterworld import maps as letter_maps
from experiments.paper.fixed_set import LETTERS
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.registry import make_env
from t2tl_jax.task_env import TaskEnv, TaskParams

UP, DOWN, LEFT, RIGHT = range(4)
STEPS = {UP: (-1, 0), DOWN: (1, 0), LEFT: (0, -1), RIGHT: (0, 1)}


@pytest.fixture(scope="module")
def env() -> LetterWorld:
    return LetterWorld(LetterWorldConfig(pool_size=64))


@pytest.fixture(scope="module")
def walk(env):
    """``(grid, actions [T]) -> (State [T], labels [T, P])``."""

    @jax.jit
    def run(grid, actions):
        def step(state, action):
            state = env.step(state, action)
            return state, (state, env.labels(state))

        return jax.lax.scan(step, env.reset_to((0, 0), grid), actions)[1]

    return lambda grid, actions: jax.device_get(run(jnp.asarray(grid), jnp.asarray(actions, jnp.int32)))


def paths(grid: np.ndarray) -> dict[tuple[int, int], list[int]]:
    """To every cell that can be reached past the letters: the actions of a shortest way, by breadth-first search."""
    size, found, queue = len(grid), {(0, 0): []}, [(0, 0)]
    for cell in queue:
        if grid[cell] >= 0:
            continue  # a letter may be entered, but not passed
        for action, (down, right) in STEPS.items():
            beside = ((cell[0] + down) % size, (cell[1] + right) % size)
            if beside not in found:
                found[beside] = [*found[cell], action]
                queue.append(beside)
    return found


def test_validity_agrees_with_a_search():
    """On random placements, most of them invalid, at several densities, and on grids of other sizes."""
    rng, seen = np.random.default_rng(0), set()
    for size, taken, count in ((7, 24, 300), (7, 12, 200), (7, 18, 200), (3, 3, 100), (4, 5, 100)):
        grids = np.full((count, size * size), -1)
        for grid in grids:
            grid[rng.choice(np.arange(1, size * size), taken, replace=False)] = 0
        grids = grids.reshape(-1, size, size)
        expected = [len(paths(grid)) == size * size for grid in grids]
        np.testing.assert_array_equal(letter_maps.is_valid(grids >= 0), expected)
        seen |= set(expected)
    assert seen == {True, False}


def test_maps_of_a_pool_are_valid_and_have_every_letter_twice(env):
    pool = env.make_params(0).maps
    assert pool.shape == (64, 7, 7) and pool.dtype == np.int8 and (pool[:, 0, 0] == -1).all()
    for grid in pool:
        assert len(paths(grid)) == 49
        np.testing.assert_array_equal(np.bincount(grid[grid >= 0], minlength=12), 2)
    assert len(np.unique(pool.reshape(64, -1), axis=0)) == 64


def test_the_published_share_of_placements_is_valid():
    """1.35 % of them, here of 40,000: a standard deviation is 0.06 %."""
    taken = np.zeros((40_000, 49), bool)
    taken[:, 1:25] = True
    taken[:, 1:] = np.random.default_rng(0).permuted(taken[:, 1:], axis=1)
    assert letter_maps.is_valid(taken.reshape(-1, 7, 7)).mean() == pytest.approx(0.0135, abs=0.0018)


def test_every_letter_comes_everywhere():
    """No corner of the map, and no letter, is preferred: over many maps each is anywhere but at the start."""
    pool = letter_maps.sample_maps(7, 12, 2, 3000, 0)
    counts = np.array([(pool == letter).sum(0).reshape(-1) for letter in range(12)])[:, 1:]
    assert counts.min() > 60 and counts.max() < 220  # 125 on average


def test_pools_differ_by_seed_and_purpose():
    env = LetterWorld(LetterWorldConfig(pool_size=20))
    pools = [
        env.make_params(seed, purpose).maps for seed in (0, 1) for purpose in ("training", "evaluation", "selection")
    ]
    assert len(np.unique(np.concatenate(pools).reshape(120, -1), axis=0)) == 120
    np.testing.assert_array_equal(pools[4], env.make_params(1, "evaluation").maps)


def test_by_seed_has_one_map_a_run():
    env = make_env("Letter-7x7-v3")
    assert env.fixed_start and env.make_params(0).maps.shape == (1, 7, 7)
    np.testing.assert_array_equal(env.make_params(3).maps, env.make_params(3, "evaluation").maps)
    assert not np.array_equal(env.make_params(3).maps, env.make_params(4).maps)


def test_a_walk_on_the_torus(env, walk):
    """Position, label and observation of a random walk, each by its definition."""
    grid = env.make_params(0).maps[0]
    actions = np.random.default_rng(0).integers(0, 4, 300)
    states, labels = walk(grid, actions)
    row, column = 0, 0
    for step, action in enumerate(actions):
        row, column = (row + STEPS[action][0]) % 7, (column + STEPS[action][1]) % 7
        np.testing.assert_array_equal(states.pipeline_state.position[step], (row, column))
        held = grid[row, column]
        np.testing.assert_array_equal(labels[step], np.arange(12) == held)
        cells = np.zeros((7, 7, 13))
        for i in range(7):
            for j in range(7):
                if grid[i, j] >= 0:
                    cells[(i - row + 3) % 7, (j - column + 3) % 7, grid[i, j]] = 1
        cells[3, 3, 12] = 1
        np.testing.assert_array_equal(states.obs[step], cells.reshape(-1))
    assert not states.reward.any() and not states.done.any()
    assert env.observation_size == 637 and states.obs.dtype == np.float32


def test_edges_are_joined(env, walk):
    grid = env.make_params(0).maps[0]
    around = walk(grid, [UP, UP, LEFT, *[DOWN] * 3, RIGHT])[0].pipeline_state.position.tolist()
    assert around == [[6, 0], [5, 0], [5, 6], [6, 6], [0, 6], [1, 6], [1, 0]]


def test_no_label_at_the_start(env):
    states = jax.jit(jax.vmap(env.reset))(jax.random.split(jax.random.key(0), 200))
    assert not jax.vmap(env.labels)(states).any()
    grids = np.roll(states.pipeline_state.seen, (-3, -3), (1, 2))  # back to where the agent's cell is the first
    assert all((env.make_params(0).maps == grid).all((1, 2)).any() for grid in grids)
    assert len(np.unique(grids.reshape(200, -1), axis=0)) > 50


@pytest.fixture(scope="module")
def published(env):
    table = compile_tasks([line["task"] for line in LETTERS], env.propositions, env.alphabet)
    return table, np.stack([letter_maps.from_text(line["grid"], env.propositions) for line in LETTERS])


def test_the_published_tasks_are_solved_by_a_script(env, published):
    """A search that knows the table finds the shortest solution of every task on its map; playing it gives +1."""
    table, grids = published
    assert len(grids) == table.num_tasks == 50 and letter_maps.is_valid(grids >= 0).all()
    assert (np.array([np.bincount(grid[grid >= 0], minlength=12) for grid in grids]) == 2).all()
    following, verdict = np.asarray(table.next_row), np.asarray(table.verdict)
    letters = np.asarray(table.letter(np.concatenate([np.zeros((1, 12), bool), np.eye(12, dtype=bool)])))
    plans = [
        solve(grid, int(row), following, verdict, letters) for grid, row in zip(grids, table.initial_row, strict=True)
    ]
    lengths = np.array([len(plan) for plan in plans])
    assert lengths.max() < EPISODE_LENGTH
    actions = np.full((50, lengths.max()), -1)
    for line, plan in zip(actions, plans, strict=True):
        line[: len(plan)] = plan
    task_env = TaskEnv(env, table)

    @jax.jit
    @jax.vmap
    def play(row, grid, actions):
        params = TaskParams(LetterWorldParams(grid[None]), table)
        first = task_env.reset_to_row(jax.random.key(0), row, params)

        def step(state, action):
            state = task_env.step(state, action, params)
            return state, (state.reward, state.done)

        return first.pipeline_state.env.seen, *jax.lax.scan(step, first, actions)[1]

    seen, reward, done = jax.device_get(play(table.initial_row, grids, jnp.asarray(actions)))
    np.testing.assert_array_equal(np.roll(seen, (-3, -3), (1, 2)), grids)
    np.testing.assert_array_equal(done.argmax(1) + 1, lengths)
    np.testing.assert_array_equal(reward[np.arange(50), lengths - 1], 1)


def solve(grid, row, following, verdict, letters) -> list[int]:
    """The shortest actions that make a task true, by breadth-first search over cells and rows."""
    came: dict = {(0, 0, row): None}
    queue = [(0, 0, row)]
    for state in queue:
        for action, (down, right) in STEPS.items():
            cell = ((state[0] + down) % 7, (state[1] + right) % 7)
            after = (*cell, int(following[state[2], letters[grid[cell] + 1]]))
            if after in came or verdict[after[2]] < 0:
                continue
            came[after] = (state, action)
            if verdict[after[2]] > 0:
                plan = []
                while came[after] is not None:
                    after, action = came[after]
                    plan.append(action)
                return plan[::-1]
            queue.append(after)
    raise AssertionError("no solution")


def test_an_unknown_action_does_nothing(env):
    state = jax.jit(env.reset)(jax.random.key(0))
    jax.tree.map(np.testing.assert_array_equal, jax.jit(env.step)(state, jnp.int32(4)), state)


def test_names_and_horizon():
    assert EPISODE_LENGTH == 75
    assert make_env("LetterEnv-v0").config == LetterWorldConfig()


@pytest.mark.parametrize(
    ("config", "message"),
    [
        ({"layout": "fixed"}, "must be 'random' or 'by_seed'"),
        ({"size": 2}, "at least 3 cells"),
        ({"letters": ("a", "a")}, "1 to 127 different names"),
        ({"copies": 0}, "at least one cell"),
        ({"copies": 4}, "12 letters x 4 copies need 48 cells; a grid of 7 x 7 has 48"),
        ({"pool_size": 0}, "at least one map"),
        ({"pool_seed": -1}, "must not be negative"),
    ],
)
def test_bad_configurations_fail_clearly(config, message):
    with pytest.raises(ValueError, match=message):
        LetterWorldConfig(**config)


def test_letters_that_do_not_fit_fail_clearly(monkeypatch):
    monkeypatch.setattr(letter_maps, "FAILED_ATTEMPTS", 20_000)
    with pytest.raises(ValueError, match="15 letters x 3 copies cannot be placed on a grid of 7 x 7"):
        LetterWorld(LetterWorldConfig(letters=tuple("abcdefghijklmno"), copies=3))


@pytest.mark.parametrize(("rows", "message"), [(["ab", "c"], "a square"), ([".z", ".."], "unknown letters z")])
def test_wrong_maps_fail_clearly(rows, message):
    with pytest.raises(ValueError, match=message):
        letter_maps.from_text(rows, "abc")
