"""Task families: shapes, distributions, seeds and errors."""

import random
from collections import Counter
from functools import reduce
from itertools import pairwise

import pytest

from t2tl_jax.ltl import (
    Formula,
    LTLError,
    UnknownTaskError,
    compile_pool,
    eventually,
    families,
    is_family,
    make_sampler,
    parse,
    prop,
    register_family,
    sample,
)

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


def reach(rng, propositions, goals):
    """A family of one's own: some goals in any order."""
    tasks = [eventually(prop(name)) for name in rng.sample(propositions, goals)]
    return reduce(Formula.__and__, tasks)


@pytest.fixture
def own_families(monkeypatch):
    """What a test registers is gone after it."""
    monkeypatch.setattr(families, "_FAMILIES", dict(families._FAMILIES))


@pytest.fixture
def with_reach(own_families):
    register_family("Reach", reach, parameters=("goals",), least=lambda goals: goals, example="Reach_2")


def test_a_family_of_ones_own_is_sampled_and_joined(with_reach):
    assert is_family("Reach_2") and is_family("Reach")
    assert sample("Reach_2", NAMES, 0) == reach(random.Random(0), NAMES, 2)
    assert sample("Reach_1_OR_Default", NAMES, 0).op == "or"


def test_a_family_of_ones_own_makes_pools(with_reach):
    table = compile_pool("Reach_2", NAMES[:5], "at_most_one", 0, size=6, rows=32, length=10)
    tasks = {str(table.formula(row)) for row in table.initial_row.tolist()}
    assert len(tasks) == 6 and all(parse(task).op == "and" for task in tasks)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("Reah_3", 'known: chains, .*, Default, .*, Reach_<goals>, X_OR_Y; did you mean "Reach_2"'),
        ("Reach", '"Reach" needs 1 positive whole number: Reach_<goals>; did you mean "Reach_2"'),
        ("Reach_13", "needs at least 13 propositions, got 12"),
    ],
)
def test_errors_know_the_families_of_ones_own(with_reach, name, message):
    with pytest.raises(LTLError, match=message):
        make_sampler(name, NAMES)


def test_ranges_of_a_family_of_ones_own_are_checked(own_families):
    register_family("Some", lambda rng, names, few, low, high: prop(names[0]), parameters=("few", "min x", "max x"))
    assert make_sampler("Some_3_1_2", NAMES)(random.Random(0)) == prop("a")
    with pytest.raises(LTLError, match="2 to 1, an empty range: Some_<few>_<min x>_<max x>"):
        make_sampler("Some_3_2_1", NAMES)


def test_a_name_belongs_to_one_function(with_reach):
    register_family("Reach", reach, parameters=("goals",), example="Reach_4")
    with pytest.raises(UnknownTaskError, match="Reach_4"):
        make_sampler("Reach", NAMES)
    with pytest.raises(
        ValueError, match=r'"Reach" is registered with another function, .*\.reach; choose another name'
    ):
        register_family("Reach", lambda rng, names: prop(names[0]))
    with pytest.raises(ValueError, match='"Default" is registered'):
        register_family("Default", reach)


@pytest.mark.parametrize("name", ["", "My_family", "2nd", "a b", "F", "true", "OR", "phi", "rm"])
def test_names_that_would_be_read_as_something_else_are_refused(own_families, name):
    with pytest.raises(ValueError, match="a family cannot be called"):
        register_family(name, reach)


@pytest.mark.parametrize("example", ["Reach", "Reach_0", "Raech_1", "Reach_1_2"])
def test_an_example_has_to_fit(own_families, example):
    with pytest.raises(ValueError, match=f'the example "{example}" of the family "Reach" does not read Reach_<goals>'):
        register_family("Reach", reach, parameters=("goals",), example=example)


def test_a_family_draws_formulas(own_families):
    register_family("Texts", lambda rng, names: "F a")
    with pytest.raises(LTLError, match=r'"Texts" is to draw a Formula, but .* returned a str; `parse`'):
        sample("Texts", NAMES, 0)
