"""Roles of propositions against a walk through the formulas, and lidars merged by them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.ltl import FALSE, TRUE, compile_tasks, progress
from t2tl_jax.networks.lookahead import LookaheadConfig
from t2tl_jax.networks.merged import MergedConfig
from t2tl_jax.networks.roles import ROLES, RolesConfig, RolesTaskEncoder
from t2tl_jax.networks.state_encoders import make_state_encoder
from t2tl_jax.objects import Objects

COLOURS = ("Blue", "Green", "Magenta", "Yellow")
TASKS = ("!Blue U (Green & (!Magenta U Yellow))", "F Green & F(Blue | Yellow)")
CONFIG = RolesConfig(propositions=5)
LIDARS = Objects.blocks((1, 4, 7, 10), 3, (2, 0, 1, 3))


def test_roles_are_what_progression_makes_of_a_row():
    table = compile_tasks(TASKS, COLOURS, "at_most_one")
    code = jax.jit(RolesTaskEncoder(CONFIG).apply)({}, table)
    told, rest = CONFIG.by_proposition(code)
    assert code.shape == (table.num_rows, CONFIG.code_size) and rest.shape == (table.num_rows, 0)
    assert not told[:2].any() and not told[:, 4].any()  # true and false; the room that is left
    for row in range(2, table.num_rows):
        formula = table.formula(row)
        for number, colour in enumerate(COLOURS):
            after = progress(formula, {colour})
            role = {FALSE: "fails", TRUE: "finishes", formula: "neutral"}.get(after, "progresses")
            assert [*told[row, number]] == [float(role == one) for one in ROLES], (formula, colour)


def test_merged_lidars_know_no_names():
    """What fails the task is one lidar, wherever it comes from; colours that change places change nothing."""
    encoder = make_state_encoder(MergedConfig(), LIDARS, CONFIG)
    obs = jnp.arange(14.0)  # one number of its own, four lidars, and another number of its own
    role = np.zeros((5, 4), np.float32)
    role[[0, 1, 2, 3], [0, 2, 0, 3]] = 1  # colours 0 and 2 fail, 1 progresses, 3 is neutral
    merged = encoder.apply({}, obs, jnp.asarray(role.reshape(-1)))
    np.testing.assert_array_equal(merged, [0, 13, *(4, 5, 6), *(0, 0, 0), *(7, 8, 9), *(10, 11, 12)])
    order = [1, 3, 0, 2]  # colour k is called order[k], in the task and in the lidars
    renamed = np.zeros_like(role)
    renamed[order] = role[:4]
    other = Objects(LIDARS.numbers, tuple(order[p] for p in LIDARS.proposition))
    again = make_state_encoder(MergedConfig(), other, CONFIG).apply({}, obs, jnp.asarray(renamed.reshape(-1)))
    np.testing.assert_array_equal(again, merged)
    assert MergedConfig().left_of(jnp.zeros((2, CONFIG.code_size)), CONFIG).shape == (2, 0)


def test_more_colours_give_as_many_features():
    sizes = set()
    for colours in (2, 4, 8):
        reader = LookaheadConfig(propositions=8, steps=2)
        objects = Objects.blocks(range(1, 1 + 3 * colours, 3), 3, range(colours))
        encoder = make_state_encoder(MergedConfig(), objects, reader)
        sizes.add(jax.eval_shape(encoder.apply, {}, jnp.zeros(2 + 3 * colours), jnp.zeros(reader.code_size)).shape)
    assert sizes == {(2 + 4 * 3,)}


def test_what_cannot_be_merged_is_refused():
    with pytest.raises(ValueError, match=r"places cannot be merged.*place=2\); use network.state=objects with"):
        MergedConfig().check(Objects.blocks([0], 4, [0], place=2), CONFIG)
    with pytest.raises(ValueError, match=r"network\.state=merged needs an environment that says"):
        MergedConfig().check(None, CONFIG)
    table = compile_tasks("F Blue", COLOURS, "at_most_one")
    with pytest.raises(ValueError, match=r"room for 3 propositions .* the 4 .* task_encoder.propositions to 4 or more"):
        RolesTaskEncoder(RolesConfig(3)).apply({}, table)
