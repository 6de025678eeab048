"""Runs with fewer frames than the paper's are named on the page of results."""

from types import SimpleNamespace

from envs.waterworld import WaterWorldConfig
from envs.zones import ZoneConfig
from experiments.reproduction import budgets


def run(frames, env, trained=True, falls=True):
    config = SimpleNamespace(env=env, learner=SimpleNamespace(anneal_learning_rate=falls))
    return SimpleNamespace(frames=frames, config=config, status={"all_sessions": {}} if trained else {})


def test_runs_with_fewer_frames_are_named():
    """But those in another world, of the search, that are only timed, and that are not trained at all."""
    runs = {
        "zone-long": run(10_027_008, ZoneConfig()),
        "zone-short": run(3_014_656, ZoneConfig()),
        "water": run(2_500_000, WaterWorldConfig()),
        "search-zone-x": run(3_014_656, ZoneConfig()),
        "zone-alone": run(1_015_808, ZoneConfig()),
        "zone-table": run(0, ZoneConfig(), trained=False),
    }
    assert budgets.fewer(runs) == {"zone-short": 3_014_656}
    assert " ".join(budgets.said(runs).split()).endswith("They had fewer: 3.0 million (zone-short).")
    assert budgets.said({"zone-long": runs["zone-long"]}) == ""
    constant = run(3_014_656, ZoneConfig(), falls=False)
    said = " ".join(budgets.said(runs | {"zone-constant": constant}).split())
    assert said.endswith("the learning rate is constant, where it falls in the main runs: zone-constant.")
