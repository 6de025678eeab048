"""What is left of a metrics file after a process was killed is read; damage is told with its place."""

import re

import numpy as np
import pytest

from t2tl_jax.runs import metrics_file
from t2tl_jax.runs.metrics_file import (
    FIXED_COLUMNS,
    LATER_COLUMNS,
    MetricsFile,
    MetricsFileError,
    as_curves,
    lines_up_to,
    read_columns,
)

HEADER = ",".join(FIXED_COLUMNS)
ROWS = ("1,10,0,1,1,0,0,0,0.5,1,5,5", "1,10,1,0,,,,,,,,", "2,20,0,2,1,0,0,0,0.5,1,5,5", "2,20,1,1,1,0,0,0,0.5,1,5,5")


@pytest.fixture
def write(tmp_path):
    """Writes the rows, with others behind them, and returns the file."""

    def of(*more: str, end: str = "\n"):
        path = tmp_path / "metrics.csv"
        path.write_text("\n".join([HEADER, *ROWS, *more]) + end)
        return path

    return of


def test_empty_cells_are_nan(write):
    columns = read_columns(write())
    assert list(columns) == list(FIXED_COLUMNS)
    np.testing.assert_array_equal(columns["discounted_return"], [0.5, np.nan, 0.5, 0.5])


@pytest.mark.parametrize("cut", ["3,30,0,1,1,0,0,0,0.5,5", "3", "3,30,0,1,1,0,0,0,0.5,1,5,5"])
def test_a_last_line_without_its_end_does_not_count(write, cut):
    path = write(cut, end="")
    assert read_columns(path)["iteration"].tolist() == [1, 1, 2, 2]
    assert len(lines_up_to(path, 2)) == 5


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "holds no metrics yet"),
        (HEADER.encode() + b"\n1,10", "holds no metrics yet"),
        (b"a,b\n1,2\n", "not a metrics file"),
        (b"\xff\xfe\n", "is damaged: 'utf-8' codec"),
        (f"{HEADER}\n{ROWS[0]}\n1,10,0\n".encode(), "in line 3: 3 cells instead of 12"),
        (
            f"{HEADER}\n{ROWS[0].replace('0.5', 'much')}\n".encode(),
            "in line 2: could not convert string",
        ),
        (f"{HEADER}\n{ROWS[0][1:]}\n".encode(), "in line 2: iteration, frames or seed is missing in ',10,0'"),
        (f'{HEADER}\n{ROWS[0]}\n"{ROWS[1]}\n'.encode(), "in line 3"),
    ],
)
def test_damage_is_told_with_its_place(tmp_path, content, said):
    path = tmp_path / "metrics.csv"
    path.write_bytes(content)
    for read in (read_columns, lambda path: lines_up_to(path, 1), lambda path: MetricsFile(path, after=1)):
        with pytest.raises(MetricsFileError, match=re.escape(said)):
            read(path)
    assert path.read_bytes() == content


def test_a_resumed_file_keeps_the_rows_up_to_the_checkpoint(write):
    path = write("3,30,0,1,1,0,0,0,0.5,1,5,5")
    MetricsFile(path, after=1).close()
    assert path.read_text().splitlines() == [HEADER, *ROWS[:2]]


def test_rows_that_a_checkpoint_counts_on_must_be_there(write, tmp_path):
    with pytest.raises(MetricsFileError, match="ends at iteration 2, but the checkpoint stands at 3"):
        lines_up_to(write(), 3)
    with pytest.raises(MetricsFileError, match="is missing, but the checkpoint stands at iteration 3"):
        lines_up_to(tmp_path / "other.csv", 3)


OLD = [name for name in FIXED_COLUMNS if name not in LATER_COLUMNS]
"""What the first versions wrote."""


def text(names, *rows):
    return "".join(",".join(str(row.get(name, 0)) for name in names) + "\n" for row in ({n: n for n in names}, *rows))


def test_columns_go_by_their_names(tmp_path):
    """A file of before there was env_termination_rate, and one with a column more and another order."""
    path = tmp_path / "metrics.csv"
    path.write_text(text(OLD, {"iteration": 1, "frames": 10, "episodes": 4, "success_rate": 0.5}))
    columns = read_columns(path)
    assert list(columns) == OLD and columns["episodes"].tolist() == [4] and columns["success_rate"].tolist() == [0.5]
    names = ["seed", "new", *(name for name in OLD if name != "seed")]
    rows = [{"seed": 7, "new": new, "frames": 10 * k, "iteration": k} for k, new in ((1, 0.25), (2, 0.5))]
    path.write_text(text(names, *rows))
    columns = read_columns(path)
    assert columns["new"].tolist() == [0.25, 0.5] and columns["seed"].tolist() == [7, 7]
    assert len(lines_up_to(path, 1)) == 2
    file = MetricsFile(path, after=1)
    file.append([dict.fromkeys(names, 0) | {"iteration": 2, "frames": 20, "seed": 7, "new": 1.5}])
    file.close()
    assert [line.split(",")[:2] for line in path.read_text().splitlines()[1:]] == [["7", "0.25"], ["7", "1.5"]]


@pytest.mark.parametrize("name", ["episodes", "discounted_return", "length"])
def test_a_file_without_a_column_that_every_version_writes_is_refused(tmp_path, name):
    path = tmp_path / "metrics.csv"
    path.write_text(text([f"{other}x" if other == name else other for other in FIXED_COLUMNS], {"iteration": 1}))
    with pytest.raises(MetricsFileError, match=f"has no column {name}, which every version writes"):
        read_columns(path)


def test_what_takes_too_much_memory_is_refused_before_it_is_read(tmp_path, monkeypatch):
    """A compressed file of a few kilobytes can hold millions of cells."""
    path = tmp_path / "metrics.csv"
    metrics_file.write_compressed(path, text(FIXED_COLUMNS) + ("," * (len(FIXED_COLUMNS) - 1) + "\n") * 100_000)
    assert (tmp_path / "metrics.csv.gz").stat().st_size < 10_000
    pages = {"SC_PHYS_PAGES": 2**13, "SC_PAGE_SIZE": 2**12}  # 32 MiB
    monkeypatch.setattr(metrics_file.os, "sysconf", pages.__getitem__)
    monkeypatch.setattr(metrics_file, "_parse", lambda *_: pytest.fail("it is read"))
    with pytest.raises(MetricsFileError, match=r"metrics.csv, with 100,001 rows of 12 columns, takes some 0\.0 GiB"):
        read_columns(path)


def test_curves_that_take_too_much_memory_are_refused(monkeypatch):
    """Rows of a seed and a number of frames each make curves as wide as they are high."""
    columns = {name: np.arange(2_000.0) for name in FIXED_COLUMNS}
    assert as_curves({name: values[:50] for name, values in columns.items()})[1]["episodes"].shape == (50, 50)
    pages = {"SC_PHYS_PAGES": 2**13, "SC_PAGE_SIZE": 2**12}
    monkeypatch.setattr(metrics_file.os, "sysconf", pages.__getitem__)
    with pytest.raises(MetricsFileError, match="curves of 2,000 seeds and 2,000 frames takes some"):
        as_curves(columns)


def test_a_compressed_file_is_read_where_the_plain_one_is_missing(write, tmp_path, monkeypatch):
    path, packed = write(), tmp_path / "metrics.csv.gz"
    plain = read_columns(path)
    metrics_file.write_compressed(path, path.read_text())
    made = packed.read_bytes()
    path.unlink()
    for name, values in read_columns(path).items():
        np.testing.assert_array_equal(values, plain[name])
    packed.write_bytes(made[: len(made) // 2])
    with pytest.raises(MetricsFileError, match="damaged"):
        read_columns(path)
    packed.write_bytes(made)
    monkeypatch.setattr(metrics_file, "MOST_BYTES", 10)
    with pytest.raises(MetricsFileError, match="more than"):
        read_columns(path)
