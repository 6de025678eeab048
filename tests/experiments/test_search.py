"""Searches: what can be searched, on which seeds, that one goes on as if it had never stopped, and what it leaves."""

import pickle
import re
import shlex
from dataclasses import replace

import numpy as np
import pytest

import tests.fake_learner  # noqa: F401, the configuration `fake`
from experiments import sweep, tuning
from experiments.cli import request
from experiments.sweeps import plan, space
from experiments.sweeps.search import CONFIGURATION, FILE, Search, recorded, worth
from t2tl_jax.errors import UserError
from t2tl_jax.registry import named_config
from t2tl_jax.runs import folder as run_folder

RATE, EPOCHS = "learner.learning-rate=log:1e-5..1e-3", "learner.epochs=2..9"


@pytest.fixture(autouse=True)
def optuna():
    return pytest.importorskip("optuna", reason="needs the extra search: pip install -e '.[search]'")


def dimensions(*texts):
    return space.check(space.read(texts), "100,", request.read(["--config", "zone_ppo"]), "sweep")


# ----- what is searched -----


def test_ranges_and_choices():
    rate, epochs, layers, method = dimensions(
        RATE, EPOCHS, "learner.network.actor_layers=64 32,8", "method=t1tl,rm,dfa"
    )
    assert (rate.is_range, rate.log, rate.whole, rate.ends) == (True, True, False, (1e-5, 1e-3))
    assert (epochs.log, epochs.whole, epochs.in_words(3)) == (False, True, "3")
    assert rate.in_words(0.000123456) == "0.0001235" and rate.in_words(1e-3) == "0.001"
    assert not layers.is_range and method.in_words("rm") == "rm"
    texts = {"learner.learning_rate": "2e-4", "learner.epochs": "3", "learner.network.actor_layers": "64 32"}
    asked = request.read(["--config", "zone_ppo"])
    point = space.point((rate, epochs, layers, method), texts | {"method": "rm"}, "100,101,", asked, "sweep")
    assert (point.config.learner.learning_rate, point.config.learner.epochs, point.config.seeds) == (
        2e-4,
        3,
        "100,101,",
    )
    assert point.words[:2] == ("--method", "rm")


@pytest.mark.parametrize(
    ("texts", "said"),
    [
        (["learner.discount"], "--space takes FIELD=1e-5..1e-3, .* got 'learner.discount'"),
        (["learner.discount=0.9"], "--space takes FIELD=1e-5..1e-3"),
        (["learner.discount=0.9..high"], "a range has two numbers, the lower one first"),
        (["learner.discount=0.9..0.8"], "a range has two numbers, the lower one first"),
        (["learner.discount=log:0..0.8"], "a logarithmic range begins above 0"),
        (["learner.discount=0.9,0.8"], "a search needs a range"),
        ([RATE, RATE], "learner.learning-rate is given twice"),
        (["learner.learning-rat=1e-5..1e-3"], "no such field; the nearest field that can is learner.learning-rate"),
        (["learner.discount=0.9..1.9"], "discount must lie between 0 and 1, got 1.9"),
        (["learner.epochs=1.5..3"], "learner.epochs takes a whole number"),
        (["task=1..2"], "this field is no number|task"),
        (["method=1..2"], "unknown method"),
        ([RATE, "method=t1tl,t3tl"], "unknown method 't3tl'"),
        ([RATE, "learner.network.context.length=2,4", "method=t2tl,t1tl"], "no such field|context"),
        (["seeds=1..2"], "seeds: it cannot be swept"),
    ],
)
def test_what_cannot_be_searched_is_refused(texts, said):
    with pytest.raises(UserError, match=said):
        dimensions(*texts)


def test_tuning_seeds_and_reported_seeds_are_kept_apart():
    assert tuning.for_search("3") == "100,101,102," and tuning.for_search("104,") == "104,"
    with pytest.raises(UserError, match=r"a search trains on seeds from 100 on, .* such as 7"):
        tuning.for_search("100,7")
    assert tuning.for_report(named_config("zone_ppo"), 3) == "0,1,2"
    assert tuning.for_report(named_config("zone_ppo_long"), 3) == "12,13,14"  # 0 to 11 had a search, once


def test_a_seed_without_a_return_counts_as_the_worst():
    assert worth(np.array([0.5, np.nan])) == -0.25


# ----- the trials -----


def search_for(folder, texts=(RATE, EPOCHS), seed=0, begins=True):
    return Search(folder, dimensions(*texts), seed, {"space": list(texts), "search-seed": seed}, begins)


def objective(texts):
    return -abs(np.log(float(texts["learner.learning_rate"]) / 1e-4)) + 0.01 * int(texts["learner.epochs"])


def searched(folder, trials, batch=4, between=lambda search, number: search):
    """The settings of a search; `between` may exchange it for another object before each proposal."""
    search, found = search_for(folder), []
    for start in range(0, trials, batch):
        numbers = range(start, min(start + batch, trials))
        for number in numbers:
            search = between(search, number)
            found.append(search.texts(number))
        for number in numbers:
            search.tell(number, objective(found[number]))
    return found


@pytest.mark.slow
def test_a_search_goes_on_as_if_it_had_never_stopped(tmp_path, monkeypatch):
    monkeypatch.setattr(pickle, "loads", lambda *_: pytest.fail("a file was unpickled"))
    whole = searched(tmp_path / "whole", 24)
    assert whole == searched(tmp_path / "again", 24)
    assert len({tuple(texts.values()) for texts in whole}) > 20
    late = [abs(np.log(float(texts["learner.learning_rate"]) / 1e-4)) for texts in whole]
    assert np.mean(late[16:]) < np.mean(late[:16])  # it has learnt something

    def killed(search, number):
        if number in (6, 18, 21):  # while the proposal is written: half of its line
            search.texts(number)
            file = tmp_path / "killed" / FILE
            lines = file.read_bytes().splitlines(keepends=True)
            file.write_bytes(b"".join(lines[:-1]) + lines[-1][: len(lines[-1]) // 2])
        return search_for(tmp_path / "killed")

    assert searched(tmp_path / "killed", 24, between=killed) == whole
    assert search_for(tmp_path / "killed").values == search_for(tmp_path / "whole").values


def test_another_seed_is_another_search(tmp_path):
    one, other = search_for(tmp_path / "one"), search_for(tmp_path / "other", seed=1)
    assert one.texts(0) != other.texts(0)
    with pytest.raises(UserError, match="holds a search that differs in search-seed; take another --folder"):
        search_for(tmp_path / "one", seed=1)
    with pytest.raises(UserError, match="has no trial 5; the first 1 are proposed"):
        one.texts(5)


def test_only_who_has_the_lock_proposes(tmp_path):
    with pytest.raises(UserError, match="holds no search yet"):
        search_for(tmp_path, begins=False)
    search_for(tmp_path).texts(0)
    file = tmp_path / FILE
    before = file.read_bytes()
    reader = search_for(tmp_path, begins=False)
    assert reader.texts(0) == search_for(tmp_path).texts(0)
    with pytest.raises(UserError, match="has no trial 1; the first 1 are proposed"):
        reader.texts(1)
    assert file.read_bytes() == before
    for unfinished in (b"", before.splitlines(keepends=True)[0]):  # no study yet, or one that does not say of what
        file.write_bytes(unfinished)
        with pytest.raises(UserError, match="holds no search yet"):
            search_for(tmp_path, begins=False)
        assert file.read_bytes() == unfinished


def test_a_search_of_before_there_was_a_field_is_still_the_same(tmp_path):
    config = named_config("fake")
    content = {CONFIGURATION: recorded(config), "space": []}
    older = {**content, CONFIGURATION: {k: v for k, v in content[CONFIGURATION].items() if k != "plan"}}
    Search(tmp_path, (), 0, older)
    Search(tmp_path, (), 0, content)
    with pytest.raises(UserError, match="holds a search that differs in configuration; take another --folder"):
        Search(tmp_path, (), 0, {**content, CONFIGURATION: recorded(replace(config, frames=7))})


def test_a_journal_that_was_changed_is_told(tmp_path):
    search_for(tmp_path).texts(0)
    file = tmp_path / FILE
    right = file.read_text()
    lines = right.splitlines(keepends=True)
    for wrong in ("nonsense\n", "[]\n", '{"op_code": 99}\n', '{"op_code": 4}\n'):
        file.write_text(lines[0] + wrong + "".join(lines[1:]))
        with pytest.raises(UserError, match=r"cannot read .*search.jsonl"):
            search_for(tmp_path)
    file.write_text(re.sub(r'"learner.epochs":[0-9.]+', '"learner.epochs":77', right))
    with pytest.raises(UserError, match=r"learner.epochs=2..9: 77 lies outside"):
        search_for(tmp_path).texts(0)


# ----- the command -----


def command(folder, trials, *flags):
    given = ("--batch", "2", "--space", "learner.rate=log:1e-4..1e-1", "--seeds", "2", *flags)
    return sweep.main(["--config", "fake", "--folder", str(folder), "--search", str(trials), *given])


@pytest.mark.slow
def test_a_search_leaves_ordinary_runs_and_says_how_to_report(tmp_path, capsys):
    assert command(tmp_path, 3) == 0
    said = capsys.readouterr().out
    assert "search on seeds 100,101" in said and said.count("compiled in") == 2
    assert said.count("program 1 of 1, 2 points side by side") == 1
    ranked = [line for line in said.splitlines() if "  trial " in line and "[" in line]
    assert len(ranked) == 3
    returns = [float(line.split()[2]) for line in ranked]
    assert returns == sorted(returns, reverse=True)
    best = ranked[0].split("trial ")[1].split(":")[0]
    config = run_folder.open_existing(tmp_path / f"trial-{int(best):04d}")[1]
    assert config.seeds == "100,101,"
    (reported,) = (line for line in said.splitlines() if "experiments.run" in line)
    words = shlex.split(reported)
    assert words[-1] == "0,1,2,3,4,5,6,7,8,9,10,11" and words.count("--seeds") == 1
    again, _ = request.configuration(request.read(words[3:]), "", "run")
    assert replace(again, seeds=config.seeds, run=config.run) == config

    assert command(tmp_path, 4) == 0  # only the trial that is not there yet
    assert capsys.readouterr().out.count("compiled in") == 1


@pytest.mark.parametrize("words", [["64"], ["64", "trials"], ["64 trials"]])
def test_how_many_trials_may_be_said_in_words(words):
    flags = ["--config", "fake", "--search", *words, "--space", "learner.rate=log:1e-3..1e-1"]
    assert plan.read(plan.split(flags)).trials == 64


@pytest.mark.parametrize("words", [["0"], ["-3"], ["four"], ["4", "runs"], ["4", "5"], [""], ["9" * 5000]])
def test_how_many_trials_is_a_number(words, capsys):
    flags = ["--config", "fake", "--search", *words, "--space", "learner.rate=log:1e-3..1e-1"]
    assert sweep.main(flags) == 2
    assert "--search takes how many trials" in capsys.readouterr().err


def test_a_search_needs_its_own_options(tmp_path, capsys):
    for flags, said in (
        (("--grid", "learner.rate=1,2"), "give --grid alone for a grid, or both --search TRIALS"),
        (("--seeds", "1,2"), "a search trains on seeds from 100 on"),
        (("--batch", "0"), "--batch takes a whole number from 1 on, got 0"),
    ):
        assert command(tmp_path, 2, *flags) == 2
        assert said in capsys.readouterr().err
    assert sweep.main(["--config", "fake", "--search", "4"]) == 2
    assert "at least one --space FIELD=RANGE" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
