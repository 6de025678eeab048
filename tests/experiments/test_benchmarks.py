"""Benchmarks: mistakes in arguments are answered before any measurement, and what is measured is kept and compared."""

import json
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

import tests.fake_learner  # noqa: F401, the configuration `fake`
from experiments import benchmark
from experiments.benchmarks import dqn as benchmark_dqn
from experiments.benchmarks import env, json_file, measured
from experiments.benchmarks import ltl as benchmark_ltl
from experiments.benchmarks.timing import Costs, Rate


@pytest.mark.parametrize(
    ("command", "flags", "said"),
    [
        (benchmark_ltl, ["--families", "phi_water", "Foo"], 'unknown task family "Foo"; known: chains, '),
        (benchmark_ltl, ["--families", "phi_watr"], 'did you mean "phi_water"'),
        (benchmark_ltl, ["--families"], "one or more names, got none"),
        (benchmark_ltl, ["--draws", "0"], "draws must be at least 1, got 0"),
        (benchmark_ltl, ["--alphabet", "at_most_two"], "did you mean 'at_most_one'"),
        (benchmark_dqn, ["--batch-size", "300000"], "buffer_size must hold at least one batch"),
        (benchmark_dqn, ["--repeats", "0"], "repeats must be at least 1, got 0"),
        (benchmark_dqn, ["--batch", "3"], "did you mean '--batch-size'"),
    ],
)
def test_mistakes_are_explained(command, flags, said, capsys):
    assert command.main(flags) == 2
    printed = capsys.readouterr()
    assert printed.err.startswith("error: ") and said in printed.err and not printed.out


def test_compiler_is_timed(capsys):
    assert benchmark_ltl.main(["--families", "phi_water", "Sequence_2_2", "--draws", "2"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()[-2:]] == ["phi_water", "Sequence_2_2"]


# ----- everything in one command -----


def measured_rows(scale):
    rate = Rate(100.0 * scale, 90.0 * scale, 110.0 * scale)
    return [
        measured.row(
            "training", "zone_ppo:t1tl", "1 seed", "frames/s", rate, Costs(1.0, 2.0, 3.0, 4.0, 5.0), acting_share=0.25
        ),
        measured.row("environments", "zones, mjx", "8 at once", "steps/s", rate, None),
    ]


def test_what_was_measured_is_read_again_and_compared(tmp_path):
    measured.write(tmp_path / "a.json", {"devices": ["cpu"]}, {}, measured_rows(1.0))
    where, rows = measured.read(tmp_path / "a.json")
    assert where == {"devices": ["cpu"]} and rows == measured_rows(1.0)
    assert "(25%)" in measured.table(rows) and "1.0 + 2.0 s" in measured.table(rows)
    for scale, said in ((1.1, "within spread"), (2.0, "faster"), (0.5, "slower")):
        lines = measured.against(measured_rows(scale), rows).splitlines()[2:]
        assert len(lines) == 2 and all(f"{scale:.2f}" in line and said in line for line in lines)
    assert measured.against(rows[:1], rows[1:]) == "Nothing here was measured there."


def test_the_number_of_devices_is_shown_where_there_were_several():
    rows = [replace(one, devices=1) for one in measured_rows(1.0)]
    assert measured.table(rows) == measured.table(measured_rows(1.0))
    lines = measured.table([replace(rows[0], devices=2), rows[1]]).splitlines()
    assert lines[0].startswith("| what | size | devices | per second")
    assert "| 1 seed | 2 | 100" in lines[2] and "| 8 at once | 1 | 100" in lines[3]


@pytest.mark.parametrize(
    "content", ["", "[]", "{}", '{"version": 1, "where": {}, "rows": [{"part": 1}]}', '{"version": 9}']
)
def test_a_file_that_is_none_is_refused_before_anything_is_timed(content, tmp_path, capsys):
    (tmp_path / "b.json").write_text(content)
    assert benchmark.main(["--against", str(tmp_path / "b.json")]) == 2
    assert "b.json" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (["--trainings", "zone_pp"], "zone_ppo"),
        (["--trainings", "zone_ppo:t2t"], "did you mean 't2tl'"),
        (["--trainings", "zone_ppo:t2tl:mjy"], "mjx"),
        (["--trainings", "zone_ppo:t1tl:mjx:x"], "whole number of at least 1"),
        (["--one-seed", "zone_pp"], "zone_ppo"),
        (["--devices-per-seed", "-1"], "at least 0"),
        (["--trainings", "waterworld_dqn:rm:mjx"], "no choice of physics"),
        (["--seeds", "0"], "at least 1"),
        (["--json", "nowhere/x.json"], "there is no folder nowhere"),
    ],
)
def test_mistakes_are_answered_before_anything_is_timed(flags, said, capsys):
    assert benchmark.main(flags) == 2
    printed = capsys.readouterr()
    assert printed.err.startswith("error: ") and said in printed.err and "##" not in printed.out


def test_what_is_stopped_leaves_the_earlier_file_and_what_it_has(tmp_path, monkeypatch):
    file, part = tmp_path / "a.json", tmp_path / "a.json.part"
    flags = ["--parts", "progression", "--trainings", "fake", "--json", str(file)]

    def stopped(arguments, trainings):
        yield from measured_rows(2.0)[:1]
        raise KeyboardInterrupt

    monkeypatch.setitem(benchmark.MEASURE, "progression", lambda arguments, trainings: iter(measured_rows(1.0)))
    assert benchmark.main(flags) == 0 and not part.exists()
    earlier = file.read_text()
    monkeypatch.setitem(benchmark.MEASURE, "progression", stopped)
    assert benchmark.main(flags) == 130
    assert file.read_text() == earlier and len(measured.read(file)[1]) == len(measured_rows(1.0))
    assert measured.read(part)[1] == measured_rows(2.0)[:1]


@pytest.mark.slow
def test_every_part_is_timed(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(env, "PHYSICS", {"letterworld": ("grid",)})
    monkeypatch.setattr(benchmark, "TASKS", ("phi_zone",))
    small = ["--num-envs", "4", "--rows", "8", "--steps", "5", "--repeats", "2", "--seeds", "2", "--trainings", "fake"]
    small += ["--one-seed", "fake", "--solve", "fake"]
    assert benchmark.main([*small, "--json", str(tmp_path / "c.json")]) == 0
    where, rows = measured.read(tmp_path / "c.json")
    assert [row.part for row in rows] == ["progression", "environments", "training", "training", "solve"]
    assert where["packages"]["jax"] and [row.devices for row in rows] == [None, 1, 1, 1, None]
    assert all(0 < row.slowest <= row.rate <= row.fastest for row in rows)
    two, one, solved = rows[-3:]
    assert (two.size, one.size) == ("2 seeds", "1 seed") and two.memory_mib > 0 and two.acting_share > 0
    assert solved.size == "2 seeds" and solved.seconds > 0 and (solved.frames is None or solved.frames > 0)
    shown = capsys.readouterr().out
    assert "## training" in shown and "| whole run |" in shown and "## The table of the README" in shown


def test_the_table_of_the_readme_needs_what_is_stored(tmp_path, monkeypatch):
    """Without the runs of its rows, such as where only the package is installed, a benchmark prints the rest."""
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "benchmark_mine.json").write_text("{}", encoding="utf-8")
    monkeypatch.setattr(benchmark, "__file__", str(tmp_path / "experiments" / "benchmark.py"))
    assert benchmark._of_the_readme({}, []) == ""


def test_rollout_and_update_share_the_time_of_an_iteration():
    row = measured.Row("training", "x", "1 seed", "frames/s", 3e6, 3e6, 3e6, acting_share=0.75)
    assert "| 4,000,000 frames/s (75%) | 12,000,000 frames/s (25%) |" in measured.table([row])
    assert measured.table([replace(row, acting_share=None)]).endswith("| - | - |")
    solved = replace(row, seconds=61.4, frames=None)
    assert measured.solved_table([solved]).endswith("| x | 1 seed | 61 s | not within its frames |")


@dataclass(frozen=True)
class File:
    """Arguments of a command that has no others."""

    json: Path


def test_what_is_measured_so_far_lies_beside_the_file_until_all_is_there(tmp_path):
    arguments = File(tmp_path / "x.json")
    json_file.store_so_far(arguments, "x", [], found=[1])
    beside = json_file.unfinished(arguments.json)
    assert json.loads(beside.read_text())["found"] == [1] and not arguments.json.exists()
    json_file.store(arguments, "x", ["--json", "x.json"], found=[1, 2])
    content = json.loads(arguments.json.read_text())
    assert content["found"] == [1, 2] and content["settings"] == {} and not beside.exists()
    assert content["where"]["command"] == ["python", "-m", "x", "--json", "x.json"]


@pytest.fixture
def trees(monkeypatch):
    """Of the source tree, as it is told to be by turns."""
    trees = [
        {"git_modified": False},
        {"git_modified": True, "git_revision": "abc", "git_changed": ["results/a.json"] * 4},
    ]
    monkeypatch.setattr(json_file.source_tree, "describe", lambda: trees.pop(0))
    json_file._tree.cache_clear()
    yield trees
    json_file._tree.cache_clear()  # which other tests look up again


def test_the_tree_is_told_as_it_was_at_the_beginning(tmp_path, trees, capsys):
    """Other commands may store results in it meanwhile."""
    json_file.check(tmp_path / "a.json")
    assert json_file.where(["a command"])["git_modified"] is False and capsys.readouterr().err == ""


def test_a_modified_tree_is_told_before_anything_is_measured(tmp_path, trees, capsys):
    del trees[0]
    json_file.check(tmp_path / "a.json")
    named = ", ".join(["results/a.json"] * 3)
    assert f"differs from commit abc in {named} and others: its results are not kept" in capsys.readouterr().err
