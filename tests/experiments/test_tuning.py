"""Seeds that settings are chosen on and seeds that are reported: kept apart, and named."""

from dataclasses import replace

import pytest

from experiments import configs, tuning  # noqa: F401, registers the configurations
from experiments.methods import apply
from t2tl_jax.registry import configs as all_configs
from t2tl_jax.registry import named_config


def test_a_method_keeps_its_configurations_searches():
    for name in ("zone_ppo", "zone_ppo_long", "waterworld_dqn"):
        assert tuning.nearest(apply(named_config(name), "dfa_cont" if "zone" in name else "dfa")) == name
    assert set(tuning.TUNED) <= set(all_configs())


def test_which_seeds_are_kept_for_tuning():
    zone, ten_tasks = named_config("zone_ppo"), named_config("rm_water_ql")
    assert tuning.tuning_seeds(zone, (0, 99, 100, 250)) == [100, 250]
    assert tuning.tuning_seeds(ten_tasks, range(1, 11)) == [5, 6, 7, 8]


@pytest.mark.parametrize(
    ("first", "second", "refused"),
    [((0, 1), (12, 13), False), ((100, 101), (102,), False), ((100,), (0,), True), ((0, 100), (0, 100), True)],
)
def test_mixtures(first, second, refused):
    config = named_config("zone_ppo")
    runs = {"a": (config, first), "b": (replace(config, frames=10), second)}
    assert bool(tuning.mixture(runs)) == refused


def test_seeds_in_words():
    assert tuning.in_words([3, 1, 2, 7, 9, 10]) == "1-3, 7, 9-10" and tuning.in_words([]) == ""
