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
            shown_as = {task: task.replace("|", "\\|") for task in made["by_task"] if " " not in task}
            for label, task in three(made).items():
                shown_as[task] = label
            for task, called in shown_as.items():
                one = made["by_task"][task]
                rate, low, high = (f"{one['success'][what]:.5f}" for what in ("value", "low", "high"))
                begins, bounds = f"| {name} | {called} | ", f" | {rate} [{low}, {high}] |"
                assert sum(line.startswith(begins) and bounds in line for line in shown) == 1, begins


def three(made):
    """By what the page calls them, the formulas that stand for a list of formulas, by success."""
    ordered = sorted((one["success"]["value"], task) for task, one in made["by_task"].items() if " " in task)
    if not ordered:
        return {}
    places = {"lowest": 0, "middle": (len(ordered) - 1) // 2, "highest": len(ordered) - 1}
    return {f"{which} of {len(ordered)} formulas": ordered[place][1] for which, place in places.items()}


def test_of_a_long_list_of_formulas_three_are_shown(tmp_path):
    run = write(tmp_path / "any-walls", all_runs()["any-walls"].config, (24, 25))
    rates = [0.9, 0.5, 0.8, 0.7, 0.99, 0.6, 0.65]
    where = {"git_revision": "0123456789", "devices": ["cpu"]}
    rest = {"violation": {"value": 0.0, "low": 0.0, "high": 0.1, "count": 9}, "env_terminations": 0, "timeouts": 0}
    by_task = {
        f"F a | F {k}": rest | {"success": {"value": rate, "low": 0.4, "high": 1.0, "count": 9}}
        for k, rate in enumerate(rates)
    }
    times = {"episodes": 1000, "seconds": 7.0, "compile_seconds": 2.0, "map_seconds": 3.0, "own_maps": True}
    entry = {"where": where, "seed": 24, "policy": "sampled", "by_task": by_task} | times
    one = entry | {"by_task": {"phi_zone": by_task["F a | F 0"]}, "episodes": 100_000}
    on_gpu = {"where": where | {"devices": ["a GPU"]}}
    both = [entry, one | on_gpu | {"seconds": 90.0}, one | on_gpu]
    (run.path / "certificates.json").write_text(json.dumps({"certificates": both}))
    said = anycertified.certified({"any-walls": run})
    lines = [line.split(" | ")[1:5] for line in said.splitlines() if line.startswith("| any-walls | ")]
    assert [line[0] for line in lines] == [
        *(f"{which} of 7 formulas" for which in ("lowest", "middle", "highest")),
        *["phi_zone"] * 2,
    ]
    assert [line[3].split()[0] for line in lines] == ["0.50000", "0.70000", "0.99000", "0.90000", "0.90000"]
    assert "lowest `F a | F 1`, middle `F a | F 3`, highest `F a | F 4`; certificates.json has every one." in said
    assert set(anycertified.bounds(run)) == {*by_task, "phi_zone"}
    (aim,) = anycertified.in_time({"any-walls": run})
    assert aim[1:] == ("under 60", "at most 95 (any-walls), maps and compiling included", "**not reached**")
    assert anycertified.in_time({}) == []
    (run.path / "certificates.json").write_text(json.dumps({"certificates": [one, one | on_gpu]}))
    (aim,) = anycertified.in_time({"any-walls": run})
    assert aim[2:] == ("at most 12 (any-walls), maps and compiling included; on a CPU 12 (any-walls)", "reached")


def test_all_formulas_of_small_families_are_certified():
    until = [str(formula) for formula in tested.every_task("Until_1_2_1_1", PAPER_COLOURS)]
    assert len(until) == 36 and len(water_chains.CHAINS) == 32
    lists = {"any-walls": ("until.txt", until), "any-water": ("water.txt", ["phi_water", *water_chains.CHAINS])}
    for run, (name, tasks) in lists.items():
        file = stored.REPOSITORY / "experiments" / "reproduction" / "anytask" / "certified" / name
        assert evaluate_tasks.listed(str(file)) == tasks
        made = anycertified.certificates(stored.Stored(stored.REPOSITORY / "results" / "any" / run))
        assert [one for one in made if list(one["by_task"]) == tasks], run
