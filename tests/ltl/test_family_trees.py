"""Families that are data: how many tasks they have, that draws are among them, and what is refused."""

import random
import tracemalloc
from collections import Counter
from functools import reduce

import pytest

from t2tl_jax.ltl import (
    Chains,
    Conjunction,
    Disjunction,
    Listed,
    LTLError,
    Mixture,
    Named,
    TaskFamily,
    UnknownTaskError,
    compile_pool,
    families,
    is_family,
    make_sampler,
    name_family,
    named_families,
    parse,
    sample,
    tasks_of,
)

COLOURS = ("Blue", "Green", "Magenta", "Yellow")
ONE = (1, 1)
SMALL = Chains(ONE, ONE, (0, 1))


def every(family, names=COLOURS):
    return list(map(str, family.every(names)))


@pytest.mark.parametrize(
    ("family", "count"),
    [
        (Chains(ONE, ONE, (0, 0)), 4),
        (Chains((2, 2), ONE, (0, 0), repeat=False), 12),
        (Chains(ONE, ONE, ONE), 12),
        (Chains((2, 2), ONE, ONE, repeat=False), 72),
        (Chains(ONE, (1, 2), (0, 2)), 52),
        (Chains((1, 2), (1, 2), (0, 2)), 1688),
        (Conjunction(SMALL), 16 * 15 // 2),
        (Disjunction(SMALL, (1, 2)), 16 + 16 * 15 // 2),
        (Mixture((SMALL, Listed(("z1", "F Blue")))), 16 + 2),
    ],
)
def test_families_have_as_many_tasks_as_published_or_counted(family, count):
    """The chains are DeepLTL's stages, whose sizes its code states; the others follow from these."""
    assert len(every(family)) == count


@pytest.mark.parametrize(
    "family",
    [
        Chains((1, 2), (1, 2), (1, 2)),
        Chains((2, 2), (1, 2), (0, 1), repeat=False),
        Conjunction(SMALL),
        Disjunction(SMALL),
    ],
)
def test_what_is_drawn_is_a_task_of_the_family_and_all_of_them_are_drawn(family):
    small = COLOURS[:3]
    tasks, rng = set(every(family, small)), random.Random(0)
    drawn = Counter(str(family.draw(rng, small)) for _ in range(60 * len(tasks)))
    if isinstance(family, Chains):
        assert set(drawn) == tasks
    else:  # the parts come in any order, and twice
        in_order = {frozenset(str(part) for part in parse(task).args) for task in tasks}
        found = {frozenset(str(part) for part in parse(task).args) for task in drawn}
        assert in_order <= found and all(len(parts) == 1 or parts in in_order for parts in found)


def test_a_family_of_far_too_many_tasks_is_drawn_from_without_listing_its_parts():
    """There are millions of chains, and trillions of pairs of them."""
    family, names = Conjunction(Chains((1, 3), (1, 2), (0, 2))), tuple("abcdefgh")
    tracemalloc.start()
    tasks = tasks_of(family, names, draws=100)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert 90 < len(tasks) <= 100 and peak < 2**22
    assert tasks[0] == sample(family, names, 0)


def test_texts_of_chains():
    texts = every(Chains((2, 2), (1, 2), (0, 2)))
    assert "!(Magenta | Yellow) U ((Blue | Green) & F(Blue | Green))" in texts
    assert "!Blue U (Green & (!Blue U Yellow))" in texts
    assert not [text for text in texts if text.startswith("F(Blue & (!Blue")], "the robot is still in it"


def test_depths_are_drawn_equally_often():
    rng, family = random.Random(1), Chains((1, 3), (1, 2), (0, 2))
    tasks = [family.draw(rng, "abcdefgh") for _ in range(2000)]
    depths = Counter(sum(node.op in ("eventually", "until") for node in task.nodes()) for task in tasks)
    assert set(depths) == {1, 2, 3} and max(depths.values()) < 1.2 * min(depths.values())


def test_mixtures_draw_by_weight():
    family = Mixture((Listed(("F Blue",)), Listed(("F Green",))), weights=(3.0, 1.0))
    drawn = Counter(str(sample(family, COLOURS, seed)) for seed in range(1000))
    assert 690 < drawn["F Blue"] < 810


def test_named_parts_are_the_families_of_that_name():
    family = Named("Until_1_2_1_1")
    assert family.every(COLOURS) is None and Mixture((family, SMALL)).every(COLOURS) is None
    assert Conjunction(family).every(COLOURS) is None
    assert family.draw(random.Random(3), COLOURS) == sample("Until_1_2_1_1", COLOURS, 3)


def test_names_stand_for_settings_everywhere():
    assert is_family("chains") and is_family("chains_OR_Default") and is_family(Chains()) and not is_family("reach_4")
    assert sample("chains", COLOURS, 5) == sample(Chains(), COLOURS, 5)
    assert sample("chains_OR_Default", COLOURS, 0).op == "or"
    assert str(Chains()) == "chains" and str(SMALL) == repr(SMALL)
    with pytest.raises(UnknownTaskError, match='did you mean "chains"'):
        make_sampler("chain_1", COLOURS)


def test_settings_can_be_named(monkeypatch):
    monkeypatch.setattr(families, "_NAMED", dict(families._NAMED))
    name_family("short_chains", SMALL)
    name_family("short_chains", SMALL)
    assert named_families()["short_chains"] == SMALL and str(SMALL) == "short_chains"
    assert sample("short_chains", COLOURS, 0) == sample(SMALL, COLOURS, 0)
    with pytest.raises(LTLError, match="choose another name"):
        name_family("short_chains", Chains())
    for name in ("Chains", "a b", "phi_mine", "true"):
        with pytest.raises(LTLError, match="settings of a family cannot be called"):
            name_family(name, SMALL)


def test_pools_of_data_are_those_of_their_fields():
    one, same, other = (
        compile_pool(family, COLOURS, "at_most_one", 0, size=6, rows=64, length=30)
        for family in (Chains(), Chains(), Chains(avoid=(0, 1)))
    )
    texts = [[str(table.formula(row)) for row in table.initial_row.tolist()] for table in (one, same, other)]
    assert texts[0] == texts[1] != texts[2] and len(set(texts[0])) == 6


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Chains(depth=(0, 1)), "depth is a range of at least 1, the smaller number first, got 0 to 1"),
        (lambda: Chains(avoid=(2, 1)), "avoid is a range of at least 0"),
        (lambda: Conjunction(count=(0, 2)), "count is a range of at least 1"),
        (lambda: Mixture(()), "at least one family"),
        (lambda: Mixture((SMALL,), (1.0, 2.0)), "a mixture of 1 families needs as many weights, each above 0"),
        (lambda: Listed(()), "at least one"),
        (lambda: Chains(depth=(1, 51)), "depth is a range up to 50 at most, got 1 to 51"),
        (lambda: Chains(reach=(1, 51)), "reach is a range up to 50"),
        (lambda: Chains(avoid=(0, 10**9)), "avoid is a range up to 50"),
        (lambda: Conjunction(count=(2, 51)), "count is a range up to 50"),
        (
            lambda: Listed(("F a",) * 10_001),
            r"a list of tasks: 10,001; the limit is 10,000 \(family_trees.MAX_LISTED\)",
        ),
        (lambda: Mixture((SMALL,) * 101), "families of a mixture: 101; the limit is 100"),
        (lambda: reduce(lambda inner, _: Mixture((inner,)), range(8), SMALL), "inside each other: 9; the limit is 8"),
        (lambda: reduce(lambda inner, _: Mixture((inner,) * 20), range(3), SMALL), "families of a tree: 8,421"),
        (lambda: Disjunction(Conjunction(Chains((1, 2)), (1, 25)), (1, 21)), "in one task: 1,050; the limit is 1,000"),
        (lambda: make_sampler(Chains(avoid=(3, 3), reach=(2, 2)), COLOURS), "needs at least 5 propositions, got 4"),
        (lambda: Chains((2, 2), ONE, (3, 3), repeat=False).draw(random.Random(0), COLOURS), "make the sets smaller"),
    ],
)
def test_what_cannot_be_is_refused(make, said):
    with pytest.raises(LTLError, match=said):
        make()


def test_the_base_class_draws_nothing():
    with pytest.raises(NotImplementedError):
        TaskFamily().draw(random.Random(0), COLOURS)


def test_goals_may_be_several_propositions_at_once():
    family = Chains(ONE, ONE, (1, 1), goals=("a", "b", "c", "a & b"))
    assert {str(task) for task in family.every(("a", "b", "c"))} == {
        *("!b U a", "!c U a", "!a U b", "!c U b", "!a U c", "!b U c", "!(a & b) U c", "!c U (a & b)")
    }
    drawn = {family.draw(random.Random(seed), ()) for seed in range(200)}
    assert drawn == set(family.every(()))
    with pytest.raises(LTLError, match="a formula of one state"):
        Chains(goals=("F a",))
