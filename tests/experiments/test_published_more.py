"""What the page says of the published program on more seeds, and of the sign of the critic that they begin with."""

import dataclasses

import numpy as np
import pytest

from experiments.reproduction import stored
from experiments.reproduction.items import ITEMS
from experiments.reproduction.page import page
from experiments.reproduction.published_runs import KEPT, VALUE_BIAS, VALUES
from experiments.reproduction.runs import all_runs
from experiments.reproduction.sections import critic_moved, critic_sign, figures, published_more
from experiments.reproduction.stored import Stored
from t2tl_jax.registry import named_config
from tests.made_up_runs import played, rows

FIRST, SECOND = published_more.BEFORE
NEW_FIRST, NEW_SECOND = published_more.MORE
SEEDS = tuple(range(36, 48))


@pytest.fixture
def begun(make):
    """Writes a run: the value that its seeds begin with, when their noise comes to its limit, and who solves."""

    def of(name, values, limits, solved, seeds=SEEDS, **more):
        iterations = np.arange(1, 11)
        entropy = np.where(iterations >= np.asarray(limits)[:, None], figures.MOST_ENTROPY, 1.0)
        value = np.where(iterations == 1, np.asarray(values)[:, None], 5.0)  # what comes later says nothing
        rates = [1.0 if done else 0.2 for done in solved]
        evaluated = {1000: played(rates, 100.0)}
        returns = np.linspace(0.5, 0.7, len(seeds)) * np.asarray(solved)
        return make(
            name,
            seeds=seeds,
            frames=1_000_000,
            entropy=entropy,
            value=value,
            evaluated=evaluated,
            discounted_return=returns,
            **more,
        )

    return of


def halves(low, high):
    """Of twelve seeds the first six begin below 0."""
    return [low] * 6 + [high] * 6


def test_outcomes_by_sign_are_counted_and_tested_on_the_new_seeds_alone(begun):
    values, limits = halves(-0.1, 0.2), halves(8, 2)
    first = begun(FIRST, values, limits, halves(True, False), seeds=tuple(range(24, 36)))
    new = begun(NEW_FIRST, values, limits, [True] * 5 + [False] * 7)
    text = critic_sign.by_sign({FIRST: first, NEW_FIRST: new}, published_more.GROUPS, published_more.MORE)
    found = [line for line in text.splitlines() if line.startswith(("| zone", "| T1TL"))]
    assert f"| {NEW_FIRST} | below 0 | 6 | 5/6 | " in found[2] and found[2].endswith("| 8.00 M [8.00 M, 8.00 M] |")
    assert f"| {NEW_FIRST} | 0 or above | 6 | 0/6 | 0.000 | 2.00 M [2.00 M, 2.00 M] |" == found[3]
    assert found[4].startswith("| T1TL, all | below 0 | 12 | 11/12 | ") and "T2TL" not in text.partition("| run")[2]
    said = " ".join(text.split())
    assert f"6 of 12 (24-29) in {FIRST}; 6 of 12 (36-41) in {NEW_FIRST}." in said
    # Fisher's p is 0.0152, three times which is the second smallest of four; those of the frames are far smaller.
    assert f"In {NEW_FIRST} 5 of 6 seeds below 0 solve the task and 0 of 6 others: that is more (p 0.045)." in said
    assert "When the noise comes to its limit: later below 0 (p " in said and f"In {FIRST} 6" not in said


@pytest.mark.parametrize(
    ("solved", "limits", "said", "when"),
    [
        (halves(False, True), halves(2, 8), "that is less (p 0.0", "sooner below 0 (p 0.0"),
        (halves(True, True), [99] * 12, "no difference is shown (p 1)", "no difference is shown (p 1)"),
    ],
)
def test_whatever_comes_out_is_what_is_said(begun, solved, limits, said, when):
    run = begun(NEW_SECOND, halves(-0.1, 0.2), limits, solved)
    text = critic_sign.compared({NEW_SECOND: critic_sign.begun(run)})
    assert said in text and f"When the noise comes to its limit: {when}" in text


def test_seeds_of_one_sign_are_not_tested(begun):
    seeds = {NEW_FIRST: critic_sign.begun(begun(NEW_FIRST, [0.1] * 12, halves(2, 3), halves(True, False)))}
    assert critic_sign.compared(seeds) == "None of them can be made so far."
    assert critic_sign.counted(seeds) == f"Below 0 begin 0 of 12 in {NEW_FIRST}."


def test_where_it_is_not_known_how_seeds_began_nothing_is_said(make, begun):
    assert critic_sign.begun(make(FIRST)) == []
    run = begun(NEW_FIRST, halves(-0.1, 0.2), halves(2, 3), halves(True, False))
    lines = (run.path / "metrics.csv").read_text().splitlines()
    (run.path / "metrics.csv").write_text("\n".join([lines[0], *lines[1 + len(SEEDS) :]]) + "\n")
    assert critic_sign.begun(Stored(run.path)) == []  # its first iteration is not kept


def test_runs_of_the_same_seeds_are_said_to_share_their_draws(begun):
    """Of two that differ in the sign of one seed."""
    same = {"limits": halves(8, 2), "solved": halves(True, False)}
    runs = {NEW_FIRST: begun(NEW_FIRST, halves(-0.1, 0.2), **same)}
    assert "not independent" not in critic_sign.by_sign(runs, published_more.GROUPS, published_more.MORE)
    runs[NEW_SECOND] = begun(NEW_SECOND, [*halves(-0.1, 0.2)[:-1], -0.3], **same)
    text = " ".join(critic_sign.by_sign(runs, published_more.GROUPS, published_more.MORE).split())
    assert f"the sign is the same in 11 of 12 seeds of {NEW_FIRST} and {NEW_SECOND} (not in 47)." in text


def test_the_published_mean_lies_where_it_lies(begun):
    """T1TL, published .605 at the end, comes to .3 and, without an interval, to 0; T2TL, published .68, to .6."""
    before = {"limits": [2] * 12, "values": [0.1] * 12, "seeds": tuple(range(24, 36))}
    runs = {
        FIRST: begun(FIRST, solved=[False] * 12, **before),
        SECOND: begun(SECOND, solved=[True] * 12, gradient_norm=[0.1] * 11 + [3000.0], **before),
        NEW_FIRST: begun(NEW_FIRST, halves(-0.1, 0.2), [2] * 12, halves(True, False)),
    }
    text = published_more.more_seeds(runs)
    shown, said = rows(text.partition("\n\n")[0]), " ".join(text.split())
    assert shown[FIRST][:2] == ["24-35", "0/12"] and shown[FIRST][3:6] == ["0.000", "0.60", "no interval"]
    assert shown[SECOND][1].startswith("12/12") and shown[SECOND][4:6] == ["0.68", "above it"]
    assert shown["T1TL, all"][:2] == ["24-35, 36-47", "6/24"] and "T2TL, all" not in shown
    assert "by MJX and without the first token" not in said
    assert "T1TL without pre-training, 24 seeds: 0.13" in said and "The 12 new ones alone: 0.27" in said
    assert "Of those 6 begin below 0 and come to 0.54" in said and "6 others to 0.000. T2TL" in said
    assert "T2TL with its pre-training, 12 seeds: 0.600 [" in said
    assert f"3,000 in seed 35, at most 0.10 in the others ({SECOND}, without it)." in said
    assert published_more.place(dataclasses.replace(published_more._end([runs[SECOND]]), high=0.7), 0.68) == "in it"
    assert published_more.place(published_more._end([runs[SECOND]]), 0.1) == "below it"


@pytest.mark.parametrize(
    ("below", "above", "p", "said"),
    [
        (9, 0, "0.0039", "lower at first makes more seeds solve the task, as the inference has it."),
        (0, 9, "0.0039", "lower at first makes fewer seeds solve the task, against"),
        (3, 1, "0.62", "So it is not shown that where the critic begins"),
        (0, 0, "1)", "So it is not shown that where the critic begins"),
    ],
)
def test_who_solves_it_alone_decides_whether_the_sign_matters(begun, below, above, p, said):
    solved = [True] * below + [False] * (12 - below), [False] * (12 - above) + [True] * above
    runs = {
        name: begun(name, [bias] * 12, [4] * 12, done)
        for (name, bias), done in zip(VALUES.items(), solved, strict=True)
    }
    text = " ".join(critic_moved.moved(runs, 0.6).split())
    assert f"Only with the lower start {below} of them solve the task, and only with the higher one {above} (" in text
    assert f"p {p}" in text and said in text
    low, high = VALUES
    assert f"| {low} | 36-47 | 12/12 | {below}/12 |" in text and f"| {high} | 36-47 | 0/12 | {above}/12 |" in text


@pytest.mark.parametrize(
    ("solved", "lower", "higher"),
    [
        (
            6,
            "6 solve the task only with it and 0 only without (no difference is shown; p 0.062)",
            "0 solve the task only",
        ),
        (
            0,
            "12 solve the task only with it and 0 only without (more do; p 0.00098)",
            "0 solve the task only with it and 0",
        ),
        (12, "0 solve the task only with it and 0", "with it and 12 only without (fewer do; p 0.00098)"),
    ],
)
def test_each_changed_start_is_compared_with_the_program_as_it_is(begun, solved, lower, higher):
    """All 12 seeds solve it with the lower start and none with the higher one."""
    kept = [True] * solved + [False] * (12 - solved)
    done = dict(zip((*VALUES, KEPT), ([True] * 12, [False] * 12, kept), strict=True))
    runs = {name: begun(name, [0.0] * 12, [4] * 12, which) for name, which in done.items()}
    two = " ".join(critic_moved.moved({name: runs[name] for name in VALUES}, 0.6).split())
    text = " ".join(critic_moved.moved(runs, 0.6).split())
    assert "were not trained without such a change" in two and "were not trained without" not in text
    low, high = VALUES
    assert f"| {KEPT} | 36-47 | 0/12 | {solved}/12 |" in text and KEPT not in two
    assert f"{low}: {lower}" in text and higher in text[text.index(f"{high}: ") :]


def test_nothing_is_said_of_one_sign_alone(begun):
    (low, bias), _ = VALUES.items()
    assert critic_moved.moved({low: begun(low, [bias] * 12, [4] * 12, [True] * 12)}, 0.6) == ""


def test_critics_begin_where_they_are_set():
    """The two runs differ in the bias alone, and from the run of before in that and the seeds."""
    runs = all_runs()
    for name, bias in (VALUES | {KEPT: 0.0}).items():
        network = runs[name].config.learner.network
        assert network.value_bias == bias and abs(bias) == (0.0 if name == KEPT else VALUE_BIAS)
        learner = runs[name].config.learner
        same = dataclasses.replace(learner, network=dataclasses.replace(network, value_bias=0.0))
        assert dataclasses.replace(runs[name].config, learner=same) == runs[FIRST].config


def test_the_page_shows_it_before_the_runs_are_there_and_does_not_have_others_done():
    item = ITEMS["published-more"]
    assert item.names("full") == (*published_more.MORE, *VALUES, KEPT)
    assert set(item.names("smoke")) < set(published_more.MORE)
    assert f"Not measured yet: {', '.join(item.names('full'))}." in " ".join(page({"x": item}, {}, smoke=False).split())
    kept = stored.load(stored.REPOSITORY / "results" / "paper")
    text = " ".join(item.section({name: kept[name] for name in published_more.BEFORE}).split())
    assert f"Below 0 begin 2 of 12 (25, 28) in {FIRST};" in text
    assert "3,377 in seed 31, 3,485 in seed 35, at most 0.24 in the others" in text


def test_the_runs_are_those_of_before_on_other_seeds_and_those_of_before_stay_as_they_were():
    runs = all_runs()
    old, new = runs[FIRST].config, runs[NEW_FIRST].config
    assert old == new and runs[NEW_FIRST].seeds == ",".join(map(str, range(36, 60)))
    assert runs[NEW_SECOND].seeds == ",".join(map(str, range(36, 48)))
    program, before = named_config("zone_ppo_published"), runs[NEW_SECOND].before
    assert dataclasses.replace(runs[NEW_SECOND].config, env=program.env) == program
    assert runs[NEW_SECOND].config.env.physics == "closed_form" and before is not None
    assert runs[before].seeds == runs[NEW_SECOND].seeds
    assert runs[SECOND].config.learner.network.context.first_token == "none"
    for name in published_more.BEFORE:  # but for the seeds, and for what names folders
        kept = stored.load(stored.REPOSITORY / "results" / "paper")[name].config
        aside = {"pretrained": "", "seeds": "", "run": kept.run}
        assert dataclasses.replace(kept, **aside) == dataclasses.replace(runs[name].config, **aside)
