"""How long a training takes to start: what the command measures, and what the page makes of it."""

import json

import pytest

from experiments.benchmarks import starts
from experiments.reproduction import aims

WHERE = {
    "devices": ["NVIDIA H200"],
    "cpu": "One CPU",
    "packages": {"jax": "0.11"},
    "git_revision": "abcdefg",
    "time": "2026",
}


def test_a_training_that_is_not_known_is_refused_before_anything_starts(capsys):
    assert starts.main(["--trainings", "zone_pqo:t1tl"]) == 2
    assert "zone_ppo" in capsys.readouterr().err


@pytest.mark.slow
def test_a_second_start_finds_the_programs_of_the_first(tmp_path):
    file = tmp_path / "starts_cpu.json"
    assert starts.main(["--trainings", "zone_ppo:dfa:closed_form:8", "--seeds", "1", "--json", str(file)]) == 0
    first, second = (json.loads(file.read_text())["starts"]["zone_ppo:dfa:closed_form:8"][one] for one in starts.WHICH)
    for one in (first, second):
        assert 0 < one["compiling"] < one["done"] < one["process"] and one["traced"] < one["done"]
    assert second["compiling"] < 0.5 * first["compiling"]


def stored(folder, name, compiling, second, where=WHERE, **settings):
    of = {
        "first": {"compiling": compiling, "process": 30.0},
        **({"second": {"process": second, "compiling": 1.0}} if second else {}),
    }
    content = {"where": where, "settings": {"seeds": 12, **settings}, "starts": {aims.T1TL: of}}
    (folder / name).write_text(json.dumps(content))


def test_an_aim_is_reached_only_where_every_start_is_within_it(tmp_path):
    stored(tmp_path, "starts_a.json", 19.0, 9.0, traces=True)
    page = aims.aims(tmp_path)
    assert "| compiled within 20 s | 19.0 s | reached |" in page
    assert "| second start within 10 s | 9.0 s | reached |" in page
    stored(tmp_path, "starts_b.json", 21.0, None)
    page = aims.aims(tmp_path)
    assert "| compiled within 20 s | 19.0, 21.0 s | **not reached** |" in page
    assert "| second start within 10 s | 9.0 s | reached |" in page
    stored(tmp_path, "starts_c.json", 19.0, 11.0, traces=True)
    assert "| second start within 10 s | 9.0 s, 11.0 s | **not reached** |" in aims.aims(tmp_path)


def test_starts_with_kept_traces_decide_and_all_are_shown(tmp_path):
    stored(tmp_path, "starts_a.json", 19.0, 11.0)
    assert "| second start within 10 s | 11.0 s | **not reached** |" in aims.aims(tmp_path)
    stored(tmp_path, "starts_b.json", 19.0, 8.0, traces=True)
    page = aims.aims(tmp_path)
    assert "| second start within 10 s | 8.0 s | reached |" in page
    assert "| 12 seeds | H200 | kept | 30.0 s | 8.0 s |" in page
    assert "| 12 seeds | H200 | not kept | 30.0 s | 11.0 s |" in page


def test_starts_on_two_kinds_of_cpu_are_not_in_one_row(tmp_path):
    for name, cpu in (("starts_a.json", "Fast CPU"), ("starts_b.json", "Slow CPU")):
        stored(tmp_path, name, 19.0, 11.0, where={**WHERE, "devices": ["cpu"], "cpu": cpu}, traces=True)
    stored(tmp_path, "starts_c.json", 19.0, 11.0, traces=True)
    stored(tmp_path, "starts_d.json", 19.0, 12.0, where={**WHERE, "cpu": "Slow CPU"}, traces=True)
    page = aims.aims(tmp_path)
    for cpu in ("Fast CPU", "Slow CPU"):
        assert f"| 12 seeds | CPU, one device, {cpu} | kept | 30.0 s | 11.0 s |" in page
    assert "| 12 seeds | H200 | kept | 30.0, 30.0 s | 11.0, 12.0 s |" in page
