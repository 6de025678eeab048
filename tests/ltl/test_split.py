"""What a test shares with a training: renamed rows are one, and the shares are those that were measured elsewhere."""

import random
from itertools import permutations

import numpy as np
import pytest

from t2tl_jax.ltl import (
    Chains,
    LTLError,
    Share,
    TooLargeError,
    compile_tasks,
    languages,
    languages_of_each,
    renaming,
    resolve_tasks,
    row_languages,
    tasks_of,
    together,
)
from t2tl_jax.ltl import share as share_of

COLOURS = ("Blue", "Green", "Magenta", "Yellow")
TESTS = "z1,z2,z3,z4,z5,z6,g1,g2,g3,g4,long,j10,s8"
# Open rows of TESTS that training has met, by language, as measured with other code.
MEASURED = {
    "Until_1_2_1_1": "0/5 0/4 0/7 0/2 1/2 0/2 0/7 0/8 0/5 0/4 0/12 0/6 0/15",
    "chains": "3/5 2/4 3/7 2/2 2/2 2/2 1/7 4/8 2/5 2/4 3/12 2/6 4/15",
}


@pytest.fixture(scope="module")
def trained():
    """The languages of all rows of a family, by name of the family and whether names of propositions do not count."""
    kept = {}

    def languages_of(family, renamed):
        if (family, renamed) not in kept:
            rows = row_languages(tasks_of(family, COLOURS), COLOURS, renamed=renamed)
            kept[family, renamed] = frozenset(rows)
        return kept[family, renamed]

    return languages_of


@pytest.mark.slow
@pytest.mark.parametrize(("family", "rows", "renamed_rows"), [("Until_1_2_1_1", 60, 3), ("chains", 1264, 72)])
def test_shares_and_sizes_are_the_measured_ones(trained, family, rows, renamed_rows):
    assert len(trained(family, False)) == rows and len(trained(family, True)) == renamed_rows
    tasks = resolve_tasks(TESTS).values()
    shares = [share_of(row_languages([task], COLOURS, renamed=False), trained(family, False)) for task in tasks]
    assert " ".join(map(str, shares)) == MEASURED[family]
    z4 = row_languages([next(iter(resolve_tasks("z4").values()))], COLOURS)
    # Both families are closed under renaming, which then adds nothing.
    assert str(share_of(z4, trained(family, True))) == MEASURED[family].split()[3]


def test_renaming_counts_where_training_has_some_names_only():
    rows = row_languages(["F Blue & F Green"], COLOURS, renamed=False)
    trained = row_languages(["F Magenta & F Yellow"], COLOURS, renamed=False)
    assert share_of(rows, frozenset(trained)) == Share(0, 3) and share_of(rows, frozenset(trained)).unseen
    rows = row_languages(["F Blue & F Green"], COLOURS)
    assert share_of(rows, frozenset(row_languages(["F Magenta & F Yellow"], COLOURS))) == Share(3, 3)


def test_a_part_of_a_training_shows_no_task_to_be_unseen():
    none, one = Share(0, 2, at_least=True), Share(1, 1, at_least=True)
    assert (str(none), str(one)) == (">=0/2", "1/1") and not none.unseen and Share(0, 2).unseen
    assert str(together([Share(1, 3), one])) == "2/4" and str(together([Share(1, 3), none])) == ">=1/5"


@pytest.mark.parametrize("alphabet", ["at_most_one", "every_subset"])
def test_formulas_that_are_compiled_together_have_the_rows_that_each_has_alone(alphabet):
    texts = ["F(a & F b)", "!a U b", "F b", "F(c & X F d) | F a", "F d & F c & F a"]
    together = list(languages_of_each(texts, tuple("abcd"), alphabet))
    for text, rows in zip(texts, together, strict=True):
        alone = compile_tasks(text, tuple("abcd"), alphabet).automaton()
        open_rows = np.flatnonzero(alone.verdict == 0)
        exact = languages.of_rows(alone.every_letter(), alone.verdict, open_rows)
        classes = renaming.classes(alone.next_row, alone.verdict, open_rows, alphabet)
        assert rows == dict(zip(exact, classes, strict=True))
        assert set(row_languages([text], tuple("abcd"), alphabet, renamed=False)) == set(rows)


def class_of(text, names, alphabet):
    table = compile_tasks(text, tuple(names), alphabet).automaton()
    return renaming.classes(table.next_row, table.verdict, table.initial_row, alphabet)[0]


@pytest.mark.parametrize("alphabet", ["at_most_one", "every_subset"])
@pytest.mark.parametrize(
    "text", ["!a U (b & (!c U d))", "(F a & F b) | (F c & F d)", "F(a & F b) & F(c & X F d)", "(!a U b) & (!b U c)"]
)
def test_every_renaming_has_the_same_class(text, alphabet):
    names = "abcd"
    orders = random.Random(0).sample(list(permutations(names)), 6)
    renamed = [text.translate(str.maketrans(names, "".join(order))) for order in orders]
    assert len({class_of(each, names, alphabet) for each in [text, *renamed]}) == 1
    assert class_of(text, "xbadyc", alphabet) == class_of(text, names, alphabet)  # other environments too


def brute_force_equal(one, other, names):
    """Whether some renaming makes two formulas mean the same, by trying all."""
    codes = {row_languages([one], names, renamed=False)[0]}
    tried = (other.translate(str.maketrans("".join(names), "".join(order))) for order in permutations(names))
    return any(row_languages([text], names, renamed=False)[0] in codes for text in tried)


def test_classes_are_equal_exactly_if_some_renaming_exists():
    names = tuple("abc")
    rng, family = random.Random(4), Chains((1, 2), (1, 2), (0, 1))
    texts = [str(family.draw(rng, names)) for _ in range(12)]
    answers = []
    for one, other in zip(texts[::2], texts[1::2], strict=True):
        equal = class_of(one, names, "at_most_one") == class_of(other, names, "at_most_one")
        answers.append(equal)
        assert equal == brute_force_equal(one, other, names), (one, other)
    assert set(answers) == {True, False}


def test_symmetric_tasks_are_quick_and_entangled_ones_refused(monkeypatch):
    """Of eight goals in any order one arrangement is tried, not 40,320."""
    names = tuple("abcdefgh")
    table = compile_tasks(" & ".join(f"F {name}" for name in names), names, "at_most_one").automaton()
    code = renaming.classes(table.next_row, table.verdict, table.initial_row, "at_most_one")
    assert code[0].startswith(np.int32(0).tobytes())
    monkeypatch.setattr(renaming, "MAX_ORDERS", 1)
    with pytest.raises(TooLargeError, match=r"compare these tasks without renaming"):
        class_of("(F a & F b) | (F c & F d)", "abcd", "at_most_one")


def test_families_are_listed_where_they_can_be():
    assert len(tasks_of(Chains(), COLOURS)) == 1688
    assert len(tasks_of(Chains(), COLOURS, draws=100)) <= 100
    assert len(tasks_of("Until_1_2_1_1", COLOURS)) == 36


def test_lists_of_tasks_are_resolved_by_name():
    tasks = resolve_tasks(" z4, F Blue ,phi_zone")
    assert list(tasks) == ["z4", "F Blue", "phi_zone"]
    assert str(tasks["z4"]) == "!(Magenta | Yellow) U (Blue & F Green)"
    for text, said in (
        (" , ", "is empty"),
        ("z7", 'unknown task "z7"; known: '),
        ("lettrs_2", "did you mean"),
        ("F (", "expected"),
    ):
        with pytest.raises(LTLError, match=said):
            resolve_tasks(text)
