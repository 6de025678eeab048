"""Certificates of agents for any task, as the page shows what is stored."""

import json

from experiments import evaluate_tasks
from experiments.reproduction import stored
from experiments.reproduction.anytask import tested, water_chains
from experiments.reproduction.anytask.runs import PAPER_COLOURS
from experiments.reproduction.runs import all_runs
from experiments.reproduction.sections import anycertified
from tests.made_up_runs import write
from tests.page_cells import cells


def test_certificates_made_afterwards_are_those_beside_the_parameters(tmp_path):
    runs = {name: write(tmp_path / name, all_runs()[name].config, (24, 25)) for name in ("any-water", "any-flat")}
    assert anycertified.certified(runs) == (
        "any-water has none: its parameters are not stored. any-flat has none: its parameters are not stored."
    )
    bound = {"value": 0.25, "low": 0.125, "high": 0.5, "count": 8}
    one = {"success": bound, "violation": bound | {"low": 0.0}, "env_terminations": 1, "timeouts": 3}
    settings = {"checkpoint": "final", "episode_length": 1500}
    made = {"settings": settings, "seed": 24, "policy": "sampled", "by_task": {"F a | F b": one}}
    where = {"git_revision": "0123456789", "devices": ["cpu"], "cpu": "some chip"}
    times = {"episodes": 8, "seconds": 61.4, "compile_seconds": 2.0, "map_seconds": 3.0, "own_maps": True}
    (tmp_path / "any-water" / "certificates.json").write_text(
        json.dumps({"certificates": [{"where": where, **made, **times}]})
    )
    said = anycertified.certified(runs)
    bounds = "0.25000 [0.12500, 0.50000]", "0.25000 [0.00000, 0.50000]"
    assert cells(said)["any-water"] == ["F a \\| F b", "-", "-", *bounds, "0.37500", "0.12500"]
    assert "seed 24, 8 episodes a task of at most 1,500 steps, 2 intervals; 61 s of playing, 61.4 s a task, " in said
    assert "after 3 s of drawing maps and 2 s of compiling, on a CPU." in said
    assert "any-flat has none" in said and "Commits: 0123456. Hardware: 1 x CPU (some chip)." in said
    assert "Each episode has a map of its own" in said and "come again" not in said


def test_the_certificates_on_the_page_are_those_that_are_stored_from_clean_commits():
    page = (stored.REPOSITORY / "docs" / "zeroshot.md").read_text(encoding="utf-8")
    shown = [line for line in page.splitlines() if line.startswith("| any-")]
    for name in anycertified.RUNS:
        entries = anycertified.certificates(stored.Stored(stored.REPOSITORY / "results" / "any" / name))
        assert entries, name
        for made in entries:
            assert stored.unclean(made["where"]) == "" and f"results/any/{name}" in made["where"]["command"]
            assert made["own_maps"] and made["episodes"] >= 1000
            for task, one in made["by_task"].items():
                rate, low, high = (f"{one['success'][what]:.5f}" for what in ("value", "low", "high"))
                called = task.replace("|", "\\|")
                begins, bounds = f"| {name} | {called} | ", f" | {rate} [{low}, {high}] |"
                assert sum(line.startswith(begins) and bounds in line for line in shown) == 1, begins


def test_all_formulas_of_small_families_are_certified():
    until = [str(formula) for formula in tested.every_task("Until_1_2_1_1", PAPER_COLOURS)]
    assert len(until) == 36 and len(water_chains.CHAINS) == 32
    lists = {"any-walls": ("until.txt", until), "any-water": ("water.txt", ["phi_water", *water_chains.CHAINS])}
    for run, (name, tasks) in lists.items():
        file = stored.REPOSITORY / "experiments" / "reproduction" / "anytask" / "certified" / name
        assert evaluate_tasks.listed(str(file)) == tasks
        made = anycertified.certificates(stored.Stored(stored.REPOSITORY / "results" / "any" / run))
        assert [one for one in made if list(one["by_task"]) == tasks], run
