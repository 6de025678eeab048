"""Comparing runs by command: what is not known, what is given twice, tests and pictures."""

import json
import re
from pathlib import Path

import pytest

from experiments.compare import main

pytestmark = pytest.mark.slow  # nearly every test loads, compiles or draws

HEADER = (
    "iteration,frames,seed,episodes,success_rate,violation_rate,timeout_rate,discounted_return,length,success_length"
)
RESULTS = Path(__file__).parents[2] / "results"
ZONE = RESULTS / "corrections_h200"
"""Runs of `phi_zone`: twelve seeds, 24 to 35."""


@pytest.fixture
def metrics(tmp_path):
    """Two seeds, four iterations; seed 1 finishes no episode in the last one."""
    lines = [HEADER]
    for iteration in range(1, 5):
        lines.append(f"{iteration},{iteration * 10},0,{iteration},{iteration / 4},0,0,{iteration / 10},5,5")
        lines.append(f"{iteration},{iteration * 10},1," + ("0,,,,,," if iteration == 4 else "2,1.0,0,0,0.5,5,5"))
    path = tmp_path / "metrics.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture
def incomplete(metrics, tmp_path):
    """A run with those metrics and without status.json."""
    (tmp_path / "config.json").write_text((ZONE / "t2_base" / "config.json").read_text())
    return tmp_path


def test_what_is_not_known_is_a_dash(incomplete, capsys):
    assert main([str(incomplete), "--last", "0.01"]) == 0
    shown = capsys.readouterr().out
    assert shown.splitlines()[1].split()[:3] == ["-", "-", "1/1"]
    assert f"note: {incomplete}: left out 1 of 2 seeds" in shown

    (incomplete / "metrics.csv").write_text(f"{HEADER}\n1,10,36,0,,,,,,\n1,10,37,0,,,,,,\n")
    assert main([str(incomplete), str(ZONE / "t2_base"), "--pairs", "True"]) == 0
    shown = capsys.readouterr().out
    assert shown.splitlines()[1].split()[:3] == ["-", "-", "-"] and "left out 2 of 2 seeds" in shown
    assert "p=-" in shown and "a test needs two seeds of each run or more, got 0 and 12" in shown


def test_violations_are_reported(metrics, incomplete, capsys):
    """Mean over seeds of the last part: of phi_safe and its like, success alone does not say how the rest went."""
    text = metrics.read_text().replace(",0,4,1.0,0,", ",0,4,0.5,0.25,").replace(",1,2,1.0,0,", ",1,2,0.5,0.25,")
    metrics.write_text(text)
    assert main([str(incomplete), "--last", "0.01"]) == 0
    header, line = capsys.readouterr().out.splitlines()[:2]
    at = header.index("violation")
    assert line[at:].split()[0] == "0.250"


def test_ends_of_the_environments_own_are_reported_apart(metrics, incomplete, capsys):
    """A run of before they were counted has a dash."""
    assert main([str(incomplete), "--last", "0.01"]) == 0
    header, line = capsys.readouterr().out.splitlines()[:2]
    assert line[header.index("ended by env") :].split()[0] == "-"
    rows = metrics.read_text().splitlines()
    metrics.write_text("\n".join([rows[0] + ",env_termination_rate", *(row + ",0.5" for row in rows[1:])]) + "\n")
    assert main([str(incomplete), "--last", "0.01"]) == 0
    header, line = capsys.readouterr().out.splitlines()[:2]
    assert line[header.index("ended by env") :].split()[0] == "0.500"


def test_a_run_given_twice_counts_once(capsys):
    run = str(ZONE / "t2_base")
    assert main([run, f"{run}/../t2_base", str(ZONE / "t2_none"), "--pairs", "True"]) == 0
    shown = capsys.readouterr().out
    assert "t2_base/../t2_base is given more than once" in shown and shown.count("p=") == 1
    assert main([run, run, "--pairs", "True"]) == 2
    assert "--pairs tests two or more runs" in capsys.readouterr().err


def test_wrong_folder_is_a_clean_error(tmp_path, capsys):
    assert main([str(tmp_path / "nowhere")]) == 2
    assert "there is no folder" in capsys.readouterr().err


def test_runs_are_tested_and_drawn(tmp_path, capsys):
    runs, figure = [str(ZONE / name) for name in ("t2_base", "t2_none", "t1_base")], tmp_path / "curves.png"
    assert main([*runs, "--pairs", "True", "--figure", str(figure)]) == 0
    shown = capsys.readouterr().out
    assert shown.count("p=") == 3 and "0.008 [-0.007, 0.023]" in shown and shown.count("undecided") == 3
    assert figure.stat().st_size > 10_000
    assert main([runs[0], "--figure", str(tmp_path / "nowhere" / "x.png")]) == 2
    assert main([runs[0], "--figure", str(tmp_path / "x.pdf")]) == 2 and not (tmp_path / "x.pdf").exists()
    assert "cannot write" in capsys.readouterr().err
    assert main([*runs, "--margin", "-1"]) == 2


def test_area_and_time_to_95_percent(capsys):
    assert main([str(ZONE / "t1_base"), "--last", "0.05"]) == 0
    cells = capsys.readouterr().out.splitlines()[1].split()
    assert cells[1:6] == ["12/12", "12/12", "4,653,056", "/", "5,373,952"] and cells[6] == "0.486"


def test_water_worlds_maps_make_pairs(capsys):
    """Seed k has map k in both runs; on ZoneEnv's one map a seed is nothing but a number."""
    runs = [str(RESULTS / "paper" / name) for name in ("water-rm", "water-dfa")]
    assert main([*runs, "--pairs", "True", "--measure", "success_rate", "--margin", "0.3"]) == 0
    shown = capsys.readouterr().out
    assert " paired " in shown and "not reproduced" in shown and "unpaired" not in shown


def test_solved_is_said_of_final_parameters_alone(tmp_path, capsys):
    """Success in training is another column; evaluations of other parameters or other tasks are not asked."""
    for name in ("config.json", "metrics.csv.gz", "status.json"):
        (tmp_path / name).write_bytes((RESULTS / "paper" / "water-dfa" / name).read_bytes())
    entries = json.loads((RESULTS / "paper" / "water-dfa" / "evaluation.json").read_text())["evaluations"]
    best = next(entry for entry in entries if entry["settings"]["checkpoint"] == "best")
    rates = [seed["success_rate"]["value"] for seed in best["policies"]["sampled"]["seeds"]]
    solved = f"{sum(rate > 0.95 for rate in rates)}/12"

    def shown(*changes):
        stored = [{**best, "settings": {**best["settings"], **change}} for change in changes]
        (tmp_path / "evaluation.json").write_text(json.dumps({"evaluations": stored}))
        assert main([str(tmp_path)]) == 0
        return capsys.readouterr().out.splitlines()[1].split()[1:3]

    (dash, in_training), after = shown({}), shown({"checkpoint": "latest"})
    assert dash == "-" and after == [solved, in_training] and solved != in_training
    assert shown({"checkpoint": "latest", "task": "F a"}) == shown({"checkpoint": "latest", "iteration": 1})
    assert shown({"checkpoint": "latest", "episode_length": 50}) == ["-", in_training]


def test_tuning_seeds_are_not_tested_against_reported_ones(capsys):
    tuned, fresh = (str(RESULTS / name) for name in ("zone_cpu/t2tl_100", "zone_short_h200/t2tl"))
    assert main([tuned, fresh]) == 0
    shown = capsys.readouterr().out
    assert f"note: {tuned}: settings were chosen on seeds 100" in shown
    assert "on some of these seeds and not on others" in shown
    assert main([tuned, fresh, "--pairs", "True"]) == 2
    assert "no test: settings were chosen on some" in capsys.readouterr().err


def test_of_runs_that_differ_in_much_a_few_fields_are_named(capsys):
    assert main([str(RESULTS / "paper" / name) for name in ("zone-t2tl", "water-rm")]) == 0
    line = capsys.readouterr().out.splitlines()[2]
    assert " env=waterworld " in line and re.search(r" and \d+ more$", line) and "Config" not in line


def test_what_else_differs(capsys):
    runs = [str(RESULTS / name) for name in ("zone_short_h200/t2tl", "paper/water-rm")]
    assert main([*runs, "--fairness", "True"]) == 0
    shown = capsys.readouterr().out.split("\n\n")[1].splitlines()
    taught, coded = (dict(zip(re.split(r"  +", shown[0]), re.split(r"  +", line), strict=True)) for line in shown[1:3])
    assert taught["settings of"] == "zone_ppo" and taught["on seeds"] == "100-111"
    assert taught["seeds here"] == "24-35" and taught["frames before"] == "169,984" and coded["frames before"] == "0"
    assert coded["encoder"] == "0" and int(taught["encoder"].replace(",", "")) > 1000
