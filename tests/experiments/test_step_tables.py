"""The worlds of the tables of steps: what differs between them, and that nothing else does."""

import numpy as np
import pytest

import experiments.configs  # noqa: F401, registers the configurations
from envs.waterworld import WaterWorld
from experiments.paper.step_tables import BY_GOALS, BY_OBSTACLES, BY_SIZE, configuration
from t2tl_jax.ltl import WATER_PROPOSITIONS, compile_named
from t2tl_jax.registry import named_config

BASE = named_config("waterworld_dqn")


def test_goals_and_obstacles_are_the_formula():
    assert [(cell.goals, cell.obstacles) for cell in (*BY_GOALS, *BY_OBSTACLES)] == [
        *((4, 1), (5, 1), (6, 1)),
        *((5, 1), (5, 2), (5, 3)),
    ]
    for cell in (*BY_GOALS, *BY_OBSTACLES):
        config = configuration(BASE, cell, same_maps=False)
        assert compile_named(config.task, WATER_PROPOSITIONS).num_rows == 2 + cell.goals
        assert config.env.radius_of_each_colour == (15.0,) * 8


def test_sizes_are_the_obstacles_radii_on_the_same_maps():
    configs = [configuration(BASE, cell, same_maps=True) for cell in BY_SIZE]
    assert [config.env.radii[4:] for config in configs] == [
        (15.0, 15.0 * size, 15.0 * size, 15.0) for size in (1.0, 1.5, 2.5)
    ]
    assert {config.task for config in configs} == {"phi_water_5_2"}
    for seed in (0, 11):
        first, *others = [WaterWorld(config.env).make_params(seed).starts for config in configs]
        for start in others:
            for ours, theirs in zip(first, start, strict=True):
                np.testing.assert_array_equal(ours, theirs)


def test_other_worlds_have_no_tables():
    with pytest.raises(ValueError, match="about T2TL's WaterWorld, got ZoneConfig"):
        configuration(named_config("zone_ppo"), BY_SIZE[0], same_maps=True)
