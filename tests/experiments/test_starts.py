"""How long a training takes to start: what the command measures, and what the page makes of it."""

import json

import pytest

from experiments.benchmarks import starts
from experiments.reproduction import aims, start_trials

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


ONE = {"first": {"process": 50.0, "compiling": 30.0}, "second": {"process": 12.0, "compiling": 1.0}}


def words(results):
    return " ".join(aims.aims(results).split())


def test_the_page_says_what_it_gained_to_ask_for_the_gpu_early(tmp_path):
    stored(tmp_path, "starts_a.json", 19.0, 9.0)
    starts = {"with": [{"process": 40.0}, {"process": 9.31}], "without": [{"process": 41.0}, {"process": 10.0}]}
    alone, *others = start_trials.ASKED
    (tmp_path / alone).write_text(json.dumps({"where": WHERE, "note": "By hand.", "training": "x", "starts": starts}))
    assert "asked for the GPU" not in words(tmp_path)
    for name in others:
        (tmp_path / name).write_text(json.dumps({"where": WHERE, "settings": {"seeds": 12}, "starts": {"y": ONE}}))
    said = words(tmp_path)
    assert "took 40.0 s with it, where nothing was compiled before, and 41.0 s without" in said
    assert "later one took 9.3 s with it and 10.0 s without" in said and "`y` 12.0 s with it and 12.0 s without" in said


def test_the_page_says_what_it_gained_to_keep_every_program(tmp_path):
    stored(tmp_path, "starts_a.json", 19.0, 9.0)
    for name, process in zip(start_trials.SMALL, (12.1, 11.4), strict=True):
        assert "every compiled program" not in words(tmp_path)
        starts = {"y": {which: of | {"process": process} for which, of in ONE.items()}}
        content = {"where": WHERE, "settings": {"seeds": 12}, "note": "After the other.", "starts": starts}
        (tmp_path / name).write_text(json.dumps(content))
    assert "`y` 12.1 s with it and 11.4 s without" in words(tmp_path)


def test_the_page_says_what_the_search_for_garbage_costs(tmp_path):
    stored(tmp_path, "starts_a.json", 19.0, 9.0)
    forms = {
        "looked for": [{"modules": 3.0, "traced": 14.0, "mib": 371.0}, {"modules": 4.0, "traced": 12.0, "mib": 370.0}],
        "not looked for": [{"modules": 2.0, "traced": 11.0, "mib": 380.2}],
    }
    content = {"where": WHERE, "training": "x", "seeds": 12, "note": "Alone.", "forms": forms}
    (tmp_path / start_trials.GARBAGE).write_text(json.dumps(content))
    said = words(tmp_path)
    assert "Loading modules takes 3.5 (3.0 to 4.0) s with it and 2.0 (2.0 to 2.0) s without, tracing 13.0" in said
    assert "holds 371 MiB with it and 380 MiB without. Alone." in said


def test_the_page_compares_versions_with_the_last_one_of_each_host(tmp_path):
    stored(tmp_path, "starts_a.json", 19.0, 9.0)

    def of(*later, traced=None):
        first = None if traced is None else {"traced": traced}
        return {"first": first, "later": [{"process": seconds} for seconds in later]}

    at = dict.fromkeys(("modules", "gpu found", "built", "traced", "compiled"), 4.0)
    content = {
        "where": WHERE,
        "note": "Alone.",
        "commits": {"before": "0123456789", "early": "abcdefghij"},
        "timelines": {
            "where": WHERE,
            "training": "x",
            "usual": [at, at],
            "only asked for in a thread": [at],
            "first_array": {"what": "a call", "seconds": 2.04},
        },
        "runs": [
            {"where": WHERE, "starts": {"x": {"before": of(12.0, 14.0, traced=9.0), "early": of(11.0, 12.5)}}},
            {"where": WHERE, "starts": {"x": {"before": of(12.0), "early": of(20.0), "now": of(9.5, traced=7.0)}}},
        ],
    }
    (tmp_path / start_trials.EARLY).write_text(json.dumps(content))
    said = words(tmp_path)
    assert "they take 1.2 to 2.5 s less than before on average; and with the GPU made ready alone -8.0 to 1.2 s" in said
    assert "(commits: before 0123456, early abcdefg)" in said and "modules were loaded after 4.0 s and 4.0 s;" in said
    assert "| `x` | 1 | before | 9.0 s | 12.0, 14.0 s (13.0 s) |" in said
    assert f"| `x` | 2 | {start_trials.FORMS['early']} | - | 20.0 s (20.0 s) |" in said
