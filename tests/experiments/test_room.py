"""What large tables and replays take: how it is measured, counted and shown."""

import json

import pytest

from experiments.benchmarks import room
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
