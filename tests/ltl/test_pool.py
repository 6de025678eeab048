"""Pools of random tasks: equal shapes, true to the formulas, padding that takes part in nothing."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.ltl import (
    WATER_PROPOSITIONS,
    ZONE_PROPOSITIONS,
    Listed,
    TooLargeError,
    UnknownTaskError,
    compile_pool,
    compile_tasks,
    is_family,
    renaming,
    row_languages,
)

CAPS = {"size": 8, "rows": 128, "length": 40}


def pool(seed=0, family="Eventually_1_5_1_4", propositions=ZONE_PROPOSITIONS, alphabet="at_most_one", **changes):
    return compile_pool(family, propositions, alphabet, seed, **CAPS | changes)


@pytest.mark.parametrize("alphabet", ["at_most_one", "every_subset"])
def test_shapes_are_equal_whatever_is_drawn(alphabet):
    tables = [pool(seed, name, alphabet=alphabet) for seed in range(3) for name in ("Until_1_2_1_1", "Sequence_2_3")]
    kinds = {str(jax.tree.map(lambda x: (x.shape, x.dtype), table)) for table in tables}
    assert len(kinds) == 1 and len({jax.tree.structure(table) for table in tables}) == 1
    assert tables[0].num_letters == (5 if alphabet == "at_most_one" else 16)


def test_equal_seeds_draw_equal_pools_and_others_differ():
    one, same, other = pool("1 3"), pool("1 3"), pool("1 4")
    jax.tree.map(np.testing.assert_array_equal, one, same)
    assert not np.array_equal(one.tokens, other.tokens)


@pytest.mark.parametrize("alphabet", ["at_most_one", "every_subset"])
@pytest.mark.parametrize("family", ["Eventually_1_3_1_2", "Until_1_2_1_1"])
def test_every_task_behaves_like_its_formula_compiled_alone(family, alphabet):
    table = pool(5, family, alphabet=alphabet)
    rng = np.random.default_rng(0)
    chosen = rng.integers(-1, 4, 12)
    words = np.arange(4) == chosen[:, None] if alphabet == "at_most_one" else rng.random((12, 4)) < 0.3
    for task in range(table.num_tasks):
        row = int(table.initial_row[task])
        alone = compile_tasks(table.formula(row), ZONE_PROPOSITIONS, alphabet)
        own = int(alone.initial_row[0])
        for labels in words:
            row = int(table.progress(row, table.letter(jnp.asarray(labels))))
            own = int(alone.progress(own, alone.letter(jnp.asarray(labels))))
            assert table.verdict[row] == alone.verdict[own]


def test_tasks_differ_and_are_open():
    table = pool()
    assert len(set(np.asarray(table.initial_row).tolist())) == table.num_tasks == 8
    assert (np.asarray(table.verdict)[np.asarray(table.initial_row)] == 0).all()


def test_left_over_rows_are_false_and_out_of_reach():
    table = pool(family="Until_1_2_1_1")
    verdict, next_row = np.asarray(table.verdict), np.asarray(table.next_row)
    left_over = np.flatnonzero(verdict == -1)[1:]
    assert len(left_over) > 50
    reachable = set(next_row[: left_over[0]].ravel().tolist())
    assert reachable.isdisjoint(left_over) and set(np.asarray(table.initial_row)).isdisjoint(left_over)
    assert (next_row[left_over] == 1).all()
    np.testing.assert_array_equal(table.tokens[left_over], np.broadcast_to(table.tokens[1], (len(left_over), 40)))
    assert table.mask[left_over].any(1).all()  # an encoder that averages over the tokens divides by one, not by zero


@pytest.mark.slow
def test_caps_that_are_too_small_are_explained():
    with pytest.raises(TooLargeError, match=r"of 8 formulas .* more than 3 tokens.* raise the caps"):
        pool(length=3)
    with pytest.raises(TooLargeError, match="too many states for the 12 rows"):
        pool(rows=12)
    with pytest.raises(TooLargeError, match="came twice"):
        pool(family="Sequence_1_1")  # there are only four


def test_a_formula_that_cannot_be_compared_with_what_is_held_out_is_drawn_again(monkeypatch):
    held_out = frozenset(row_languages(["!a U b"], tuple("abcd")))
    monkeypatch.setattr(renaming, "MAX_ORDERS", 1)
    entangled = "(F a & F b) | (F c & F d)"
    chosen = {"propositions": tuple("abcd"), "held_out": held_out}
    table = pool(family=Listed((entangled, "!d U c", "F a & F c")), least=1, size=2, **chosen)
    assert [str(table.formula(row)) for row in table.initial_row.tolist()] == ["F a & F c"]
    with pytest.raises(TooLargeError, match=r"0 belong to another pool, 50 have too many propositions that play"):
        pool(family=Listed((entangled,)), size=1, **chosen)


@pytest.mark.parametrize(
    ("text", "answer"),
    [
        ("Until_1_2_1_1", True),
        ("Default_OR_Sequence_1_2", True),
        ("Untl_1_2_1_1", True),
        ("phi_zone", False),
        ("phi_water_4_1", False),
        ("rm_t1", False),
        ("F Red", False),
        ("Red", False),
        ("Default", True),
    ],
)
def test_families_are_told_from_formulas(text, answer):
    assert is_family(text, ZONE_PROPOSITIONS) == answer


def test_a_proposition_is_no_family_and_a_misspelt_family_gets_the_nearest():
    assert not is_family("Default", ("Default",))
    with pytest.raises(UnknownTaskError, match="did you mean"):
        pool(family="Untl_1_2_1_1", propositions=WATER_PROPOSITIONS)
