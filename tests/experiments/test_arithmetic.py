"""What programs compute, counted and stored, and what the page makes of it."""

import json

import pytest

from experiments.benchmarks import arithmetic as benchmark
from experiments.benchmarks import measured, tables
from experiments.reproduction import arithmetic

ONE = {"traced": 3, "gathers": 1, "scatters": 1, "products": 1, "factorisations": 0, "fused_loops": 2}
ROW = measured.Row("training", "zone_ppo_long:t1tl", "12 seeds", "frames/s", 4e6, 4e6, 4e6, acting_share=0.5)


@pytest.mark.slow
def test_the_command_counts_less_in_a_straight_line(tmp_path):
    file = tmp_path / "arithmetic.json"
    small = ["--num-envs", "4", "--substeps", "2", "--repeats", "1"]
    assert benchmark.main([*small, "--json", str(file)]) == 0
    found = json.loads(file.read_text())
    plain, straight, before = found["substep"].values()
    assert straight["traced"] < 0.5 * plain["traced"] and plain["products"] > 0
    assert not any(straight[name] for name in ("gathers", "scatters", "products", "factorisations"))
    assert straight["traced"] == before["traced"]
    steps = found["gradient_step"]
    assert set(arithmetic.LEARNERS.values()) <= set(steps) and all(one["kiloflop"] > 100 for one in steps.values())


def test_the_page_sets_what_was_measured_against_the_floor(tmp_path):
    where = {"devices": ["NVIDIA H200"], "packages": {"jax": "0.11"}, "git_revision": "abcdefg", "time": "2026"}
    of = {name: ONE | {"kilobytes": 50.0, "kiloflop": 67.0, "microseconds": 1.0, "compile_s": 2.0}
          for name in (arithmetic.MJX, arithmetic.STRAIGHT, arithmetic.BEFORE)}  # fmt: skip
    of[arithmetic.BEFORE]["microseconds"] = 0.5
    steps = {arithmetic.T1TL: {"kiloflop": 335.0}, arithmetic.T2TL: {"kiloflop": 1000.0}}
    settings = {"num_envs": 4, "substeps": 2, "repeats": 1}
    stored = {"where": where, "settings": settings, "substep": of, "gradient_step": steps}
    assert arithmetic.substep(tmp_path) == arithmetic.gradient(tmp_path) == "Not measured yet."
    (tmp_path / arithmetic.FILE).write_text(json.dumps(stored))
    passes = {65_536: 0.5, 131_072: 0.8}  # ms
    speeds = [
        measured.Row("environments", "zones, mjx", f"{n:,} at once", "steps/s", *[n / (11e-3 * ms)] * 3)
        for n, ms in passes.items()
    ]
    measured.write(tmp_path / "benchmark_a.json", where, {}, [ROW, *speeds])
    text = " ".join(arithmetic.substep(tmp_path).split())
    assert "65,536 environments takes 0.50 ms, of 131,072 0.80 ms" in text
    assert "4.8 TB/s would take 0.68 ms" in text and "0.066 ms" in text  # 65,536 x 67 kFLOP at 67 TFLOP/s
    assert "0.20 ms of a pass are there whatever the batch" in text
    assert "is 1.00 times on this processor, and 2.00 times with [rows before the batch]" in text
    # Four epochs of 335 kFLOP take 0.02 us at 67 TFLOP/s; half of 0.25 us a frame is not acting.
    assert "| 4 | 1,340 | 0.020 us a frame | 0.125 us a frame | 6.2 times |" in arithmetic.gradient(tmp_path)


def test_a_file_that_cannot_be_written_is_told_before_anything_is_counted(tmp_path, capsys):
    assert benchmark.main(["--json", str(tmp_path / "no" / "file.json")]) == 2
    assert "there is no folder" in capsys.readouterr().err


@pytest.mark.slow
def test_tables_are_timed_by_their_rows(tmp_path):
    file = tmp_path / arithmetic.TABLES
    small = ["--rows", "16", "--num-envs", "4", "--unroll-length", "4", "--minibatch-size", "8"]
    assert arithmetic.tables(tmp_path) == "Not measured yet."
    assert tables.main([*small, "--repeats", "1", "--json", str(file)]) == 0
    found = json.loads(file.read_text())["results"]
    kinds = ("steps", "environments")
    assert [(one["rows"], one["minibatches_of"]) for one in found] == [(n, kind) for n in (16,) for kind in kinds]
    assert all(0 < one["open_rows"] < one["rows"] and one["seconds"] > 0 for one in found)
    shown = arithmetic.tables(tmp_path)
    assert "| 16 | environments | " in shown and "4 environments of" in shown
    assert tables.main(["--rows", "3"]) == 2


def test_an_aim_for_large_tables_is_reached_where_no_kind_of_minibatch_is_slower(tmp_path):
    settings = {"num_envs": 4, "unroll_length": 4, "minibatch_size": 8, "repeats": 1}
    where = {"git_revision": "a" * 40, "devices": ["NVIDIA H200"]}

    def told(*seconds):
        results = [
            {
                "rows": rows,
                "minibatches_of": kind,
                "seconds": took,
                "fastest": took,
                "slowest": took,
                "memory_mib": None,
            }
            for (rows, kind), took in zip(
                [(n, kind) for n in (64, 10_240) for kind in ("steps", "environments")], seconds, strict=True
            )
        ]
        content = {"where": where, "settings": settings, "results": results}
        (tmp_path / "tables_h200.json").write_text(json.dumps(content))
        return " ".join(arithmetic.tables(tmp_path).split())

    assert "is reached here: 10,240 rows take 1.00 times as long (steps) and 1.09" in told(0.02, 0.02, 0.02, 0.0219)
    slower = told(0.02, 0.02, 0.02, 0.03)
    assert "**not reached** here" in slower and "| 64 | steps | 20.0 ms (20.0 ms, 20.0 ms) | - |" in slower
