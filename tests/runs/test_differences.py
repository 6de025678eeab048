"""What two configurations differ in: only settings that matter are named."""

import dataclasses

from experiments.methods import apply
from t2tl_jax.ltl import Chains, Listed, Mixture
from t2tl_jax.registry import named_config
from t2tl_jax.runs.differences import changed_fields, differences, in_short


def test_differences_name_nested_fields_and_leave_out_where_the_run_lies():
    base = named_config("zone_ppo")
    learner, run = dataclasses.replace(base.learner, noise_time=0.0), dataclasses.replace(base.run, folder="x")
    assert list(differences(base, dataclasses.replace(base, learner=learner, run=run))) == ["learner.noise_time=0.0"]


def test_a_family_is_named_in_short():
    base = named_config("zone_ppo")
    mixed = Mixture((Chains((1, 2)), Chains((2, 3)), Listed(("F Blue",))))
    assert list(differences(base, dataclasses.replace(base, task=mixed))) == ["task=a mixture of 3 families"]
    short, long = (dataclasses.replace(base, task=Chains((1, last))) for last in (3, 4))
    assert list(differences(short, long)) == ["task.depth=(1, 4)"]
    assert [in_short(task) for task in ("F Blue", Chains())] == ["F Blue", "chains"]
    assert in_short(short.task) == "a family of the kind chains"


def test_the_period_of_maps_counts_where_maps_are_renewed():
    for name, named in (("zone_ppo", []), ("zone_ppo_random", ["map_period=0"])):
        config = named_config(name)
        assert list(differences(config, dataclasses.replace(config, map_period=0))) == named


def test_differences_between_kinds_are_those_from_the_defaults():
    zone, water = named_config("zone_ppo"), apply(named_config("waterworld_dqn"), "rm")
    water = dataclasses.replace(water, frames=zone.frames)
    assert set(differences(zone, water)) == {
        "env=waterworld",
        "env.layout=by_seed",
        "learner=dqn",
        "learner.network.task_encoder=one_hot",
        "learner.network.head=bilinear",
        "learner.network.task_layer=512",
        "learner.num_envs=128",
        "learner.unroll_length=64",
        "learner.batch_size=1024",
        "learner.target_period=25",
        "learner.learning_rate=0.0004",
        "learner.epsilon_fraction=0.05",
        "task=phi_water",
        "pretrained=",
        "episode_length=600",
    }
    assert {"env=zones", "learner=ppo"} <= set(differences(water, zone))


def test_changed_fields_are_the_smallest_parts_that_differ():
    base, water = named_config("zone_ppo"), named_config("waterworld_dqn")
    network = dataclasses.replace(base.learner.network, value_scale=3.0)
    learner = dataclasses.replace(base.learner, noise_time=0.0, network=network)
    other = dataclasses.replace(base, env=water.env, learner=learner)
    assert set(changed_fields(base, other)) == {"env", "learner.noise_time", "learner.network.value_scale"}
    assert not list(changed_fields(base, base))
