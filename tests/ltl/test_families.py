"""Task families: shapes, distributions, seeds and errors."""

import random
from collections import Counter
from itertools import pairwise

import pytest

from t2tl_jax.ltl import LTLError, UnknownTaskError, make_sampler, sample

NAMES = tuple("abcdefghijkl")


def draws(name, count=2000, names=NAMES):
    sampler, rng = make_sampler(name, names), random.Random(7)
    return [sampler(rng) for _ in range(count)]


def length(formula):
    """Goals of an eventually-chain or levels of an until-chain."""
    return sum(node.op in ("eventually", "until") for node in formula.nodes())


def near(count, total, probability):
    """Within five standard deviations of a binomial count."""
    return abs(count - total * probability) < 5 * (total * probability * (1 - probability)) ** 0.5


def conjuncts(formula):
    return [formula.args[0], *conjuncts(formula.args[1])] if formula.op == "and" else [formula]


def test_equal_seeds_give_equal_tasks():
    assert sample("Eventually_1_5_1_4", NAMES, 3) == sample("Eventually_1_5_1_4", NAMES, 3)
    assert len({sample("Default", NAMES, seed) for seed in range(50)}) > 45


def test_default():
    for task in draws("Default", 200):
        p = task.propositions()
        assert len(p) == 4 and str(task) == f"!{p[0]} U ({p[1]} & (!{p[2]} U {p[3]}))"


def test_until():
    tasks = draws("Until_1_3_1_2")
    assert near(sum(task.op == "and" for task in tasks), 2000, 1 / 2)
    parts = [part for task in tasks for part in conjuncts(task)]
    for levels, count in Counter(map(length, parts)).items():
        assert 1 <= levels <= 3 and near(count, len(parts), 1 / 3)
    for task in tasks:
        assert len(task.propositions()) == 2 * length(task), "propositions are distinct"
    used = Counter(name for task in tasks for name in task.propositions())
    assert max(used.values()) < 1.2 * min(used.values())


def test_sequence():
    tasks = draws("Sequence_2_4")
    for size, count in Counter(map(length, tasks)).items():
        assert 2 <= size <= 4 and near(count, 2000, 1 / 3)
    for task in tasks:
        order = [node.name for node in task.nodes() if node.op == "prop"]
        assert all(x != y for x, y in pairwise(order))
    assert any(len(set(t.propositions())) < length(t) for t in tasks), "a colour may come back later"


def test_eventually():
    tasks = draws("Eventually_1_5_1_4")
    for size, count in Counter(len(conjuncts(task)) for task in tasks).items():
        assert 1 <= size <= 4 and near(count, 2000, 1 / 4)
    parts = [part for task in tasks for part in conjuncts(task)]
    for size, count in Counter(map(length, parts)).items():
        assert 1 <= size <= 5 and near(count, len(parts), 1 / 5)
    goals = sum(map(length, parts))
    assert near(sum(node.op == "or" for part in parts for node in part.nodes()), goals, 1 / 4)
    for part in parts:
        previous: set[str] = set()
        while True:
            body = part.args[0]
            goal = body.args[0] if body.op == "and" else body
            assert not previous & set(goal.propositions())
            previous = set(goal.propositions())
            if body.op != "and":
                break
            part = body.args[1]


def test_disjunction_of_families():
    for task in draws("Sequence_2_4_OR_Until_3_3_1_1", 20):
        assert task.op == "or" and task.args[0].op == "eventually" and task.args[1].op == "until"


def test_adversarial_and_super():
    counts = Counter(map(str, draws("Adversarial")))
    assert set(counts) == {"F(a & F b)", "F(a & F c)"} and near(counts["F(a & F b)"], 2000, 1 / 2)
    assert {task.op for task in draws("Super", 200)} == {"eventually", "until", "and"}


@pytest.mark.parametrize(
    ("name", "suggested"),
    [("UntilTask_1_2_1_1", "Until_1_2_1_1"), ("Eventuall_1_5_1_4", "Eventually_1_5_1_4"), ("default", "Default")],
)
def test_unknown_names_never_fall_back(name, suggested):
    with pytest.raises(UnknownTaskError, match=f'unknown task family "{name}".* did you mean "{suggested}"'):
        make_sampler(name, NAMES)


@pytest.mark.parametrize(
    "name", ["Until_1_2", "Sequence_2_x", "Sequence_0_4", "Sequence_4_2", "Default_3", "", "A_OR_B"]
)
def test_bad_parameters(name):
    with pytest.raises(LTLError):
        make_sampler(name, NAMES)


@pytest.mark.parametrize(
    "name", ["Default", "Until_1_3_1_2", "Sequence_2_4", "Eventually_1_2_1_1", "Adversarial", "Super"]
)
def test_too_few_propositions(name):
    with pytest.raises(LTLError, match=r"needs at least \d+ propositions, got 1: a"):
        make_sampler(name, ("a",))
