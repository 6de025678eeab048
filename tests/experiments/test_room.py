"""What large tables, many letters, replays and files of metrics take: how it is measured, counted and shown."""

import json

import pytest

from experiments.benchmarks import letters, recording, room
from experiments.reproduction import room as shown


def test_a_table_is_compiled_by_the_command():
    found = room.table(3)
    assert (found["goals"], found["rows"]) == (3, 9) and found["seconds"] > 0 and found["memory_mib"] > 1


@pytest.mark.slow
def test_a_replay_is_counted_by_its_shapes():
    """By hand: 200,000 places of 2 observations of 68 numbers, 4 numbers of four bytes and 2 of one; where it is."""
    found = room.replay("waterworld_dqn", "t1tl", 1)
    assert found["bytes"] == 200_000 * (2 * 68 * 4 + 4 * 4 + 2) + 4 + 1


def test_what_is_stored_is_shown(tmp_path):
    assert shown.table(tmp_path) == shown.replays(tmp_path) == "Not measured yet."
    table = {"goals": 4, "rows": 17, "seconds": 2.4, "processor_seconds": 1.6, "memory_mib": 1234.5}
    replay = {"config": "x", "method": "t2tl", "seeds": 12, "bytes": 3 * 2**29}
    where = {"cpu_count": 2}
    (tmp_path / shown.FILE).write_text(json.dumps({"where": where, "table": table, "replays": [replay]}))
    said = " ".join(shown.table(tmp_path).split())
    assert "4 goals in any order are a table of 17 rows" in said and "one core of 2" in said and "1,234 MiB" in said
    assert "| `x` | `t2tl` | 12 | 1.50 GiB |" in shown.replays(tmp_path)


@pytest.mark.parametrize("flags", [["--goals", "0"], ["--goals", "21"], ["--seeds", "0"]])
def test_numbers_are_checked(flags, capsys):
    assert room.main(flags) == 2
    assert flags[0].strip("-") in capsys.readouterr().err


# ----- many letters -----


@pytest.mark.slow
def test_tables_over_more_and_more_propositions_are_compiled_and_looked_up_in(tmp_path):
    file = tmp_path / "letters.json"
    flags = ["--propositions", "6", "22", "--batch", "8", "--steps", "2", "--repeats", "2", "--json", str(file)]
    assert shown.letters(tmp_path) == "Not measured yet."
    assert letters.main(flags) == 0
    found = json.loads(file.read_text())["results"]
    assert [(one["shape"], one["propositions"], one["rows"], one["parts"]) for one in found] == [
        *(("thirds", 6, 5, 1), ("thirds", 22, 5, 2), ("chain", 6, 8, 1), ("chain", 22, 24, 2)),
        *(("pairs", 6, 3, 1), ("pairs", 22, 3, 2)),
    ]
    for one in found:
        assert 0 < one["compile_s"]["median"] <= one["compile_s"]["slowest"] < 10 and 0 < one["table_mib"] < 100
        for times in (one["step_ns"], one["step_all_ns"]):
            assert 0 < times["fastest"] <= times["median"] <= times["slowest"]
    said = shown.letters(tmp_path)
    assert "| `thirds` | 22 | 5 | 2 |" in said and "2 calls each, of 2 batches of 8 letters." in " ".join(said.split())


def test_formulas_name_every_proposition():
    names = tuple("abcdef")
    assert letters.thirds(names) == "F(a & d & F(b & e & F(c & f)))"
    assert letters.chain(names[:3]) == "F(a & F(b & F(c)))"
    assert letters.pairs(names) == "F((a & d) | (b & e) | (c & f))"


@pytest.mark.parametrize("flags", [["--propositions", "2"], ["--propositions", "32"], ["--batch", "0"]])
def test_what_is_no_size_is_refused(flags, capsys):
    assert letters.main(flags) == 2
    assert flags[0].strip("-") in capsys.readouterr().err


# ----- files of metrics -----


@pytest.mark.slow
def test_a_file_is_written_and_read(tmp_path):
    file = tmp_path / shown.RECORDING
    assert shown.recording(tmp_path) == "Not measured yet."
    assert recording.main(["--seeds", "3", "--iterations", "4", "--json", str(file)]) == 0
    found = json.loads(file.read_text())["results"]
    assert found["rows"] == 12 and 0 < found["iteration_ms"]["median"] <= found["iteration_ms"]["slowest"]
    assert found["file_mib"] > 0 and found["reading_s"] > 0
    assert "3 seeds with 10 scalars each" in " ".join(shown.recording(tmp_path).split())


# ----- groups of seeds -----


def test_groups_are_shown_beside_seeds_side_by_side(tmp_path):
    assert shown.groups(tmp_path) == "Not measured yet."
    one = {"config": "x", "method": "t1tl", "seeds": 24, "at_once": 24, "asked": 0, "iterations": 3, "frames": 1000}
    one |= {"command": ["python", "-m", "run", "--pretrained", ""]}
    runs = [
        one | {"training_seconds": 2.0},
        one | {"at_once": 12, "asked": 12, "training_seconds": 4.0},
        one | {"at_once": 8, "training_seconds": 6.0},
    ]
    stored = {"where": {}, "note": "Noted.", "beside": "Beside.", "runs": runs}
    (tmp_path / shown.GROUPS).write_text(json.dumps(stored))
    said = shown.groups(tmp_path).splitlines()
    assert said[:3] == 3 * ["    python -m run --pretrained ''"]
    lines = said[4:]
    assert lines[2] == "| `x:t1tl` | 24 | 24 | 3 | 2.0 s | 12,000 frames/s |"
    assert lines[3] == "| `x:t1tl` | 24 | 12 | 3 | 4.0 s | 6,000 frames/s |"
    assert lines[4] == "| `x:t1tl` | 24 | 8, chosen by the program | 3 | 6.0 s | 4,000 frames/s |"
    assert "Noted. Beside." in lines[-1]
