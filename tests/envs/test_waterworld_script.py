"""The hand-written player goes where it should, and beats chance by far."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from envs.waterworld import WaterWorld, WaterWorldConfig
from envs.waterworld.scripted_player import scripted_action
from experiments.paper.scripted_player import colours_of_rows, main, play, random_player, scripted_player
from t2tl_jax.ltl import compile_tasks, named_task
from t2tl_jax.task_env import TaskEnv

YES, NO = jnp.array([True, False]), jnp.array([False, True])
NONE = jnp.zeros(2, bool)


@pytest.fixture(scope="module")
def world() -> WaterWorld:
    return WaterWorld(WaterWorldConfig(layout="random", pool_size=0))


@pytest.fixture(scope="module")
def task_env(world) -> TaskEnv:
    return TaskEnv(world, compile_tasks(named_task("phi_water"), world.propositions, world.alphabet))


@jax.jit
def action(wanted_at, avoided_at, wanted, avoided):
    env = WaterWorld(WaterWorldConfig(colours=("Red", "Blue"), balls_per_colour=1))
    balls = jnp.array([wanted_at, avoided_at], jnp.float32)
    state = env.reset_to(jnp.array([200.0, 200.0]), jnp.zeros(2), balls, jnp.zeros((2, 2)))
    return scripted_action(state.pipeline_state, env.make_params(0), wanted, avoided)


@pytest.mark.slow
@pytest.mark.parametrize(("where", "expected"), [((200, 390), 1), ((390, 200), 2), ((200, 10), 3), ((10, 200), 4)])
def test_it_goes_to_what_it_wants(where, expected):
    assert action(where, (20, 20), YES, NONE) == expected


def test_it_does_not_go_through_what_it_avoids():
    between = (250, 200)
    assert action((350, 200), between, YES, NONE) == 2
    assert action((350, 200), between, YES, NO) != 2
    assert action((350, 200), (240, 200), NONE, NO) == 4


@pytest.mark.slow
def test_wanted_and_avoided_colours_come_from_the_table(task_env):
    wanted, avoided = (np.asarray(x) for x in colours_of_rows(task_env.table))
    start = int(task_env.table.initial_row[0])
    row, order = start, []
    while task_env.table.verdict[row] == 0:
        (colour,) = np.flatnonzero(wanted[row])
        assert np.flatnonzero(avoided[row]).tolist() == [5, 6, 7]
        order.append(int(colour))
        row = int(task_env.table.next_row[row, task_env.table.letter(jnp.arange(8) == colour)])
    assert order == [0, 1, 2, 3, 4]


@pytest.mark.slow
def test_it_beats_random_actions(task_env):
    """A script of this kind is reported to return 0.90 in 112 steps; random actions -1.00 in 62."""
    script = play(task_env, scripted_player, 100, 600, seed=0)
    chance = play(task_env, random_player, 100, 600, seed=0)
    assert chance.total < -0.95
    assert script.total > 0.75 and script.success > 0.85
    assert 85 < script.length < 140


@pytest.mark.slow
def test_command_prints_a_table(capsys):
    assert main(["--tasks", "F Pink", "F Gray", "--episodes", "2", "--episode-length", "3"]) == 0
    printed = capsys.readouterr().out
    assert [line.split()[-5] for line in printed.splitlines()[2:]] == ["random", "script"] * 2


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (["--tasks", "phi_water", "phi_watr"], 'did you mean "phi_water"'),
        (["--tasks", "rm_t1"], "rm_t1"),
        (["--tasks", "F Teal"], 'unknown proposition "Teal"'),
        (["--tasks"], "one or more names or formulas, got none"),
        (["--episodes", "0"], "episodes must be at least 1, got 0"),
        (["--radii", "15", "20"], "radii has 2 entries for 8 colours"),
        (["--episode", "5"], "did you mean '--episodes'"),
    ],
)
def test_mistakes_are_explained(flags, said, capsys):
    assert main(flags) == 2
    printed = capsys.readouterr()
    assert printed.err.startswith("error: ") and said in printed.err and not printed.out
