"""The same search for every method: what is planned, kept and shown of it, and what it found."""

import json
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from experiments import reproduce
from experiments.reproduction import claims, rates, stored
from experiments.reproduction.plan import Scale
from experiments.reproduction.runs import RM_SEARCH_FRAMES, SEARCH_METHODS, ZONE_SEARCH_FRAMES, all_runs
from experiments.reproduction.sections import figures, safe, search, settings, ten_tasks
from t2tl_jax.errors import UserError
from t2tl_jax.registry import make_env
from t2tl_jax.runs import config_files, pretraining
from t2tl_jax.runs.differences import differences
from t2tl_jax.runs.group import same_program
from t2tl_jax.training.seeds import FIRST_TUNING_SEED, parse_seeds
from tests.made_up_runs import rows, write

NEAR = np.array([0.0, 0.001, 0.002, 0.003])
SEEDS = parse_seeds(rates.SEEDS)
CASES = [(world, method) for world, methods in SEARCH_METHODS.items() for method in methods]
OF_ZONE = {"learner.noise_decay", "frames"}
"""What a shorter training in ZoneEnv has otherwise."""


@pytest.fixture(scope="module")
def runs():
    return all_runs()


@pytest.fixture
def found(monkeypatch):
    """Sets what the search is said to have found."""
    monkeypatch.setattr(claims, "worlds", lambda config, seeds: None)
    return lambda own: monkeypatch.setattr(rates, "OWN_RATE", own)


@pytest.fixture
def tried(runs, tmp_path):
    """Writes a method's runs, by the rate, with the return that they end with."""

    def made(world, method, returns):
        names = {rates.search_name(world, method, which): value for which, value in returns.items()}
        return {
            name: write(tmp_path / name, runs[name].config, seeds=SEEDS, discounted_return=value)
            for name, value in names.items()
        }

    return made


def fields(one, other):
    return {text.partition("=")[0] for text in differences(one, other)}


@pytest.mark.parametrize(("world", "method"), CASES)
def test_every_method_has_the_same_search_of_its_main_run(runs, world, method):
    main = runs[f"{world}-{method}"]
    points = {which: runs[rates.search_name(world, method, which)] for which in rates.RATES}
    shared = main.config.learner.learning_rate
    rate = {which: run.config.learner.learning_rate for which, run in points.items()}
    assert rate[rates.SHARED] == shared and rate["low"] == pytest.approx(shared / 3, rel=3e-3)
    assert rate["high"] == pytest.approx(3 * shared)
    for run in points.values():
        assert Scale("full", "12").apply(run).seeds == "100,101,102,103" and min(SEEDS) >= FIRST_TUNING_SEED
        assert run.search and not run.evaluated and run.suites == () and not run.read
        assert same_program(run.config, points[rates.SHARED].config)  # one program serves all three
        others = fields(main.config, run.config) - {"learner.learning_rate", "selection.points"}
        assert others == {"zone": OF_ZONE, "safe": OF_ZONE, "rm": {"frames"}}.get(world, set())
    fewer = {"zone": ZONE_SEARCH_FRAMES, "safe": ZONE_SEARCH_FRAMES, "rm": RM_SEARCH_FRAMES}
    assert points["low"].config.frames == fewer.get(world, main.config.frames)


@pytest.mark.parametrize(("world", "method"), CASES)
def test_encoders_are_pretrained_on_the_seeds_of_the_search_as_for_the_main_runs(runs, world, method):
    main = runs[f"{world}-{method}"]
    befores = {runs[rates.search_name(world, method, which)].before for which in rates.RATES}
    assert len(befores) == 1 and (befores == {None}) == (main.before is None)
    for before in befores - {None}:
        first, config = runs[before], runs[rates.search_name(world, method, "low")].config
        assert first.search and not first.evaluated and Scale("full", "12").apply(first).seeds == rates.SEEDS
        assert first.config == runs[main.before].config
        wanted = pretraining.matching(config, make_env(config.env))
        assert replace(wanted, seeds=first.config.seeds) == first.config


def test_methods_of_a_world_share_a_rate_and_the_paper_s_figures_show_them(runs):
    labels = {"zone": figures.ZONE_LABELS, "water": figures.WATER_LABELS, "safe": safe.LABELS, "rm": ten_tasks.TEN}
    for world, methods in SEARCH_METHODS.items():
        assert sorted(f"{world}-{method}" for method in methods) == sorted(labels[world])
        shared = {runs[f"{world}-{method}"].config.learner.learning_rate for method in methods}
        assert len(shared) == (2 if world == "rm" else 1)  # crm's and ql's, shaped or not


def test_what_the_search_found_is_what_is_stored():
    """Also that nothing is said of a world whose search is not stored in full."""
    there = stored.load(reproduce.RESULTS)
    known = {world: search.own_rates(there, world) for world in SEARCH_METHODS}
    assert {world: own for world, own in known.items() if own is not None} == rates.OWN_RATE


def test_a_method_with_a_rate_of_its_own_is_trained_with_it_as_its_main_run_was(found):
    found({"zone": {"gnn": "high"}, "water": {"rm-6": "low"}})
    planned = all_runs.__wrapped__()
    for name, rate in (("zone-gnn", 9e-4), ("water-rm-6", 1.33e-4)):
        main, own = planned[name], planned[f"{name}-own-rate"]
        assert fields(main.config, own.config) == {"learner.learning_rate"}
        assert own.config.learner.learning_rate == rate
        assert replace(own, config=main.config) == main  # seeds, pre-training, evaluation
    assert {name for name in planned if name.endswith("-own-rate")} == {"zone-gnn-own-rate", "water-rm-6-own-rate"}
    names = search.planned()
    assert set(names) <= set(planned) and {"zone-gnn-own-rate", "zone-t2tl", "water-rm"} <= set(names)
    found({"zone": {}, "water": {}})
    assert all(name.startswith("search-") for name in search.planned())


def test_the_best_rate_is_the_highest_mean_and_the_shared_one_where_none_is_above_it(tried):
    there = tried("zone", "gnn", {"low": 0.3 + NEAR, "same": 0.5 + NEAR})
    assert search.best(there, "zone", "gnn") is None
    there |= tried("zone", "gnn", {"high": 0.5 + NEAR})
    assert search.best(there, "zone", "gnn") == "same"
    there = tried("zone", "t2tl", {"low": 0.5 + NEAR, "same": 0.5 + NEAR, "high": 0.3 + NEAR})
    assert search.best(there, "zone", "t2tl") == "same"
    there = tried("zone", "dfa", {"low": 0.3 + NEAR, "same": 0.5 + NEAR, "high": 0.501 + NEAR})
    assert search.best(there, "zone", "dfa") == "high"
    there = tried("zone", "t1tl", {"low": 0.5, "same": 0.4, "high": 0.9})
    assert search.best(there, "zone", "t1tl") == "high"
    there["search-zone-t1tl-high"].metrics["episodes"][3] = 0.0  # a seed in which no episode ends counts -1
    assert search.best(there, "zone", "t1tl") == "low"
    assert search.own_rates(there, "zone") is None


def test_methods_whose_best_rate_is_another_one_are_found_once_all_are_there(tried):
    there = {}
    for method in SEARCH_METHODS["zone"]:
        assert search.own_rates(there, "zone") is None
        top = {"gnn": "high", "dfa": "low"}.get(method, "same")
        there |= tried("zone", method, {which: 0.5 + 0.1 * (which == top) + NEAR for which in rates.RATES})
    assert search.own_rates(there, "zone") == {"gnn": "high", "dfa": "low"}
    assert search.own_rates(there, "water") is None


def test_the_search_is_shown_with_the_best_rates_marked(tried, found):
    found({})
    there = tried("water", "rm", {"low": 0.7 + NEAR, "same": 0.5 + NEAR, "high": 0.3 + NEAR})
    there |= tried("water", "t1tl", {"low": 0.7 + NEAR})
    text = search.search(there)
    low, same, high, best = rows(text)["rm"]
    assert low.startswith("**0.70") and low.endswith("]**") and same.startswith("0.50") and high.startswith("0.30")
    assert best == "a third of it"
    assert rows(text)["t1tl"][1:] == ["-", "-", "not known yet"]
    heading = rows(text)["method"]
    assert heading[:3] == ["a third of it, 0.000133", "the usual one, 0.0004", "three times it, 0.0012"]
    said = " ".join(text.split())
    assert (
        "WaterWorld, `phi_water`: return at the end of training, on seeds 100-103, which are kept for tuning." in said
    )
    assert "10,000 frames a seed" in said and "plain maximum" in said and "ZoneEnv, `phi_zone`" not in said
    assert search.STAYS not in text and search.search({}) == ""
    found({"water": {}})
    assert search.STAYS in search.search(there)


def test_the_claims_are_judged_again_with_each_method_at_its_best(tmp_path, found):
    """gnn is below dfa_number at the shared rate and above it at its own."""
    found({"zone": {"gnn": "high"}})
    returns = {"zone-t2tl": 0.8, "zone-gnn": 0.4, "zone-gnn-own-rate": 0.7, "zone-dfa_number": 0.5}
    planned = all_runs.__wrapped__()
    there = {
        name: write(tmp_path / name, planned[name].config, discounted_return=value + NEAR)
        for name, value in returns.items()
    }
    text = search.search(there)
    shown = rows(text)
    assert shown["zone-gnn-own-rate"][2].startswith("0.70") and shown["zone-gnn"][2].startswith("0.40")
    assert shown["zone-gnn-own-rate - zone-gnn"][0].startswith("0.300 [")
    assert shown["zone-gnn-own-rate > zone-dfa_number"][-1] == "reproduced"
    assert "zone-gnn > zone-dfa_number" not in shown and "zone-t2tl > zone-gnn" not in shown
    assert shown["zone-t2tl > zone-gnn-own-rate"][-1] == "reproduced"
    assert text.count("Corrected for 9 comparisons, 3 of which") == text.count("Corrected for 1 comparison.") == 2
    del there["zone-gnn-own-rate"]
    assert search.search(there) == ""


def test_the_figures_say_what_was_searched_for(found):
    found({})
    said = " ".join(settings.searched("zone").split())
    assert said == " ".join(settings.searched("water").split())
    assert said.startswith(" ".join(settings.SEARCHED.split())) and "not complete" in said
    found({"zone": {"gnn": "high", "dfa": "low"}})
    said = " ".join(settings.searched("zone").split())
    assert "it took another one than the usual for gnn (three times it), dfa (a third of it)" in said
    assert (
        "is in the section linked as far as it is trained. Other" in said
        and "on seeds 100-103" in said
        and f"#{settings.SEARCH_ANCHOR}" in said
    )
    assert "not complete" in settings.searched("water")
    assert "none was searched for on this one" in " ".join(settings.searched("steps").split())
    found({"zone": {}, "water": {}})
    said = " ".join(settings.searched("water").split())
    assert "the usual one is best for every method. Other settings" in said and "section linked" not in said


@pytest.fixture
def repository(tmp_path):
    """A checkout of one commit, and its name."""
    path = tmp_path / "repository"
    path.mkdir()
    who = ["-c", "user.name=Nobody", "-c", "user.email=nobody@example.org", "-c", "commit.gpgsign=false"]

    def git(*words):
        return subprocess.run(["git", "-C", path, *who, *words], capture_output=True, text=True, check=True).stdout

    git("init")
    git("commit", "--allow-empty", "--message", "one")
    return path, git("rev-parse", "HEAD").strip()


def test_a_search_is_kept_on_its_own_seeds_alone_and_thinned_but_for_its_end(runs, tmp_path, repository):
    """What is compared is the same before and after."""
    path, revision = repository
    name, config = "search-water-rm-low", Scale("full", "12").apply(runs["search-water-rm-low"])
    curve = np.random.default_rng(0).random((4, 306))
    source = tmp_path / name
    run = write(source, config, seeds=SEEDS, iterations=306, discounted_return=curve)
    (source / "versions.json").write_text(json.dumps({"started": {"git_revision": revision, "git_modified": False}}))
    kept = tmp_path / "kept"
    with pytest.raises(UserError, match="seeds 100-103, on which settings were chosen"):
        stored.keep(name, source, kept, repository=path)
    stored.keep(name, source, kept, repository=path, search=True, most=stored.MOST_OF_SEARCH)
    again = stored.Stored(kept)
    assert again.end("discounted_return") == run.end("discounted_return")
    count = len(np.unique(again.columns["iteration"]))
    assert stored.last_ones(306) < count <= 2 * stored.MOST_OF_SEARCH
    (source / "config.json").write_text(config_files.to_json(replace(config, seeds="7,100")))
    with pytest.raises(UserError, match="is a search and was made with seeds 7, on which results are reported"):
        stored.keep(name, source, kept, repository=path, search=True)


@pytest.mark.parametrize(
    ("world", "own", "order", "lead"),
    [
        ("rm", {"ql": "high"}, "rm-crm > rm-ql-own-rate", "The orderings that the paper of reward machines claims"),
        ("safe", {"gnn": "low"}, "safe-t1tl - safe-gnn-own-rate", "The comparisons of its section"),
    ],
)
def test_other_worlds_are_judged_again_as_their_sections_judge(tmp_path, found, world, own, order, lead):
    """Those of reward machines by their scores, and where nothing is claimed the same pairs as in the section."""
    found({world: own})
    [method] = own
    planned = all_runs.__wrapped__()
    scores = {f"{what}_{k + 1}": 1.0 for k in range(10) for what in ("episodes", "best_score")}
    there, seeds = {}, (1, 2, 3, 4)
    for name in {f"{world}-{method}", f"{world}-{method}-own-rate", *order.replace(" > ", " - ").split(" - ")}:
        columns = scores | {f"score_{k + 1}": 0.5 + NEAR for k in range(10)} if world == "rm" else {}
        played = {
            planned[name].config.episode_length: dict.fromkeys(
                ("discounted_return", "success_rate", "violation_rate"), 0.5
            )
        }
        made = {"seeds": seeds, "frames": 200_000, "evaluated": played, **columns}
        there[name] = write(tmp_path / name, planned[name].config, **made)
    text = search.search(there)
    assert order in rows(text) and f"{lead}, each method at the rate that the search took:" in text
    assert f"{world}-{method}-own-rate - {world}-{method}" in rows(text) and "return at the end" in text
    others = {name: there[name] for name in (f"{world}-{method}", f"{world}-{method}-own-rate")}
    assert "each method at the rate that the search took:\n\nNone can be made yet." in search.search(others)
    del there[f"{world}-{method}-own-rate"]
    assert search.search(there) == ""


def test_the_benchmark_says_what_the_search_found_and_which_runs_it_does_not_hold_for():
    said = settings.again_searched("rm", "All runs whose names have no ending")
    own = [f"{method} ({rates.WORDS[which]})" for method, which in rates.OWN_RATE["rm"].items()]
    assert ", ".join(own) in said and "All runs whose names have no ending have the usual one." in said
    assert "as far as it is trained" in said
