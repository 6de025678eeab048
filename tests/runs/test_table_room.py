"""Room in the table of a task: formulas of different sizes share one compiled program, which computes what it would."""

from dataclasses import replace

import jax
import numpy as np
import pytest

import t2tl_jax
from experiments.paper import step_tables
from experiments.reproduction import runs as named
from experiments.reproduction.plan import Scale
from t2tl_jax import UserError
from t2tl_jax.registry import named_config
from t2tl_jax.runs import experiment, pretraining
from t2tl_jax.runs.config import Config, SelectionConfig

ROWS, LENGTH = 8, 32
SMALLER, LARGER = "phi_water_4_1", "phi_water_6_1"


def water(task: str, rows: int = ROWS, length: int = LENGTH) -> Config:
    """A short training by double DQN, which learns every row of the table from every step."""
    config = named_config("waterworld_dqn")
    network = replace(config.learner.network, state_layers=(8,), task_layer=8, freeze_task_encoder=False)
    reader = replace(network.task_encoder, layers=1, width=8, heads=2, feed_forward=8, output=4)
    small = {"num_envs": 4, "unroll_length": 8, "batch_size": 8, "learning_starts": 16, "buffer_size": 64}
    learner = replace(config.learner, network=replace(network, task_encoder=reader), **small)
    quiet = replace(config.run, evaluation_episodes=0, gif=False, progress=False, table_rows=rows, table_length=length)
    return replace(
        config,
        task=task,
        learner=learner,
        frames=128,
        seeds="3,",
        episode_length=8,
        pretrained="",
        selection=SelectionConfig(points=0),
        run=quiet,
    )


def programs(config: Config) -> tuple[str, str]:
    """What would be compiled."""
    program = experiment.build(config).program
    return program.lowered_init.as_text(), program.lowered_iterate.as_text()


@pytest.mark.slow
def test_formulas_of_different_sizes_share_one_program():
    assert programs(water(SMALLER)) == programs(water(LARGER))
    assert programs(water(SMALLER, 0, 0)) != programs(water(LARGER, 0, 0))


@pytest.mark.slow
def test_a_training_with_room_is_the_same_training():
    """But for the rounding of sums, in which rows that nobody is ever in take part as zeros."""
    with_room, without = (t2tl_jax.train(water(SMALLER, *room)) for room in ((ROWS, LENGTH), (0, 0)))
    assert with_room.experiment.table.num_rows == ROWS and without.experiment.table.num_rows < ROWS
    assert {"loss", "success_rate"} <= with_room.metrics.keys()
    for name, values in without.metrics.items():
        np.testing.assert_allclose(with_room.metrics[name], values, rtol=1e-4, atol=1e-6, err_msg=name)
    pairs = zip(*(jax.tree.leaves(run.params["final"]) for run in (with_room, without)), strict=True)
    for one, other in pairs:
        np.testing.assert_allclose(one, other, atol=1e-5)


def test_what_does_not_fit_is_refused():
    with pytest.raises(
        UserError, match=r"phi_water_6_1: .* room for 7 rows of 32; set run.table_rows and run.table_len"
    ):
        experiment.build(water(LARGER, 7))
    with pytest.raises(UserError, match="room for 8 rows of 20"):
        experiment.build(water(LARGER, length=20))
    config = water(LARGER)
    reader = replace(config.learner.network.task_encoder, masked=False)
    learner = replace(config.learner, network=replace(config.learner.network, task_encoder=reader))
    with pytest.raises(UserError, match="this task encoder reads; leave it at 0"):
        experiment.build(replace(config, learner=learner))


def test_room_is_for_the_task_of_the_run_alone():
    """Not for those that its agent is evaluated on or that its encoder is pre-trained on, nor for machines."""
    config = water(SMALLER, 6, 19)
    assert config.for_task(LARGER).run.table_rows == config.for_task(LARGER).run.table_length == 0
    env = experiment.build(config).env
    for text, rows in (("auto:own", 6), (f"auto:{LARGER}", 0), ("auto", 0)):
        assert pretraining.matching(replace(config, pretrained=text), env).run.table_rows == rows, text
    assert experiment.build(water("rm_phi_water", 3, 3)).table.num_rows > 3


@pytest.mark.slow
def test_the_worlds_of_the_tables_of_steps_share_their_programs():
    """Of each method; and the room is no larger than the largest of them needs."""
    runs = named.all_runs()
    cells = [(cell, False) for cell in step_tables.BY_GOALS] + [(cell, True) for cell in step_tables.BY_SIZE]
    found, needed = set(), []
    for cell, same_maps in cells:
        config = Scale("full", "2").apply(runs[named.step_name(cell, same_maps, "rm")])
        learner = replace(config.learner, num_envs=2, unroll_length=4, batch_size=4, learning_starts=8, buffer_size=16)
        found.add(programs(replace(config, learner=learner)))
    assert len(found) == 1
    for cell in (*step_tables.BY_GOALS, *step_tables.BY_OBSTACLES, *step_tables.BY_SIZE):
        config = runs[named.step_name(cell, cell in step_tables.BY_SIZE, "rm")].config
        needed.append(experiment.build(config.for_task(config.task)).table.tokens.shape)
    assert tuple(np.max(needed, axis=0)) == (named.STEP_ROWS, named.STEP_LENGTH)
