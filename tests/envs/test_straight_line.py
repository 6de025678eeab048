"""Straight-line arithmetic: the numbers of the function it was made of, by fewer operations, or a refusal."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from envs.straight_line import layout as layouts
from envs.straight_line import program, straight_line
from envs.zones import point_mjx
from envs.zones.point_mjx import MjxPoint
from tests.four_devices import run_on_four_devices
from tests.operations import operations

MATRIX, VECTOR = jax.ShapeDtypeStruct((3, 3), jnp.float32), jax.ShapeDtypeStruct((3,), jnp.float32)
LONG = 48


def moved(m, v):
    v = v.at[jnp.array([2, 0])].set(v[jnp.array([0, 1])]).at[1].add(m[0, 1]).at[0].multiply(2.0)
    return jnp.cumsum(v), m[:, jnp.array([2, 2, 0])].T.reshape(9)[::2], jnp.tile(v, 2)[1:5]


def factored(m, v):
    h = jax.scipy.linalg.cho_factor(m @ m.T + 3.0 * jnp.eye(3))
    return jax.scipy.linalg.cho_solve(h, v), jnp.linalg.norm(m, axis=1)


def chosen(m, v):
    best = jnp.argmin(jnp.where(v > 0, v, jnp.inf))
    v = jax.lax.cond(v.sum() > 0, lambda v: v + 1.0, lambda v: v * 2.0, v)
    v, seen = jax.lax.scan(lambda v, row: (v * row + m[0], v.max()), v, m)
    total, _ = jax.lax.scan(lambda total, x: (total + x.reshape(1)[0], None), v[0], v)
    seen = seen + total
    return m[best], v, seen, (v > 0).any(), v.astype(jnp.int32)


def rows(m, v):
    """Forty-eight numbers, most of them made of the same three."""
    long = jnp.tile(v, LONG // 3) * jnp.arange(LONG) + jnp.repeat(m[0], LONG // 3)
    jacobian = jnp.stack([long, jnp.ones(LONG), jnp.zeros(LONG)], axis=1)
    active = (long < 0).at[:5].set(True)
    return (jacobian.T * active) @ jacobian, long[7], jnp.square(long).max(), jnp.where(active, long, 1.0)


LAYOUTS = {"rows-first": (0, math.inf), "cut": (0, 0), "rows-last": (math.inf, 0)}
"""Up to how many environments rows are last, and up to how many they are whole before a batch."""


def use_layout(monkeypatch, name):
    """Whatever the device and the batch."""
    last_up_to, whole_up_to = LAYOUTS[name]
    monkeypatch.setitem(layouts.ROWS_LAST_UP_TO, jax.default_backend(), last_up_to)
    monkeypatch.setattr(layouts, "ROWS_WHOLE_UP_TO", whole_up_to)


@pytest.mark.slow
@pytest.mark.parametrize("function", [moved, factored, chosen, rows], ids=lambda function: function.__name__)
@pytest.mark.parametrize("layout", LAYOUTS)
def test_numbers_are_those_of_the_function_batched_or_not(function, layout, monkeypatch):
    use_layout(monkeypatch, layout)
    same, rng = straight_line(function, MATRIX, VECTOR), np.random.default_rng(0)
    m, v = (jnp.asarray(rng.normal(size=(4, 2, *x.shape)), jnp.float32) for x in (MATRIX, VECTOR))

    def compare(wrap, *given):
        for one, other in zip(*(jax.jit(wrap(f))(*given) for f in (same, function)), strict=True):
            assert one.dtype == other.dtype
            np.testing.assert_allclose(one, other, rtol=2e-5, atol=2e-5)

    compare(lambda f: f, m[0, 0], v[0, 0])
    compare(lambda f: jax.vmap(jax.vmap(f)), m, v)
    compare(lambda f: jax.vmap(jax.vmap(f, in_axes=(0, None))), m, v[:, 0])
    compare(lambda f: jax.vmap(jax.vmap(f), in_axes=(0, None)), m[:1], v[0])


def equations(batch):
    """What a batch of `rows` is made by, for a result without any of forty-eight entries."""
    same = straight_line(lambda m, v: rows(m, v)[0], MATRIX, VECTOR)
    for _ in batch:
        same = jax.vmap(same)
    traced = jax.make_jaxpr(same)(jnp.ones((*batch, 3, 3)), jnp.ones((*batch, 3)))
    called = [x.params["call"].jaxpr for x in traced.eqns if x.primitive.name == "custom_vmap_call"]
    return [equation for jaxpr in (traced.jaxpr, *called) for equation in jaxpr.eqns]


def row_shapes(batch):
    """Shapes of the arrays of forty-eight entries that it makes."""
    shapes = {x.aval.shape for equation in equations(batch) for x in equation.outvars}
    return {shape for shape in shapes if LONG in shape}


def test_rows_are_last_in_a_batch_that_is_short_for_its_device(monkeypatch):
    last, first = {(1, 1, LONG), (2, 5, LONG)}, {(LONG, 1, 1), (LONG, 2, 5)}
    assert row_shapes((2, 5)) == last
    for longest, expected in ((10, last), (9, first)):
        monkeypatch.setattr(layouts, "ROWS_LAST_UP_TO", {"gpu": longest})
        assert row_shapes((2, 5)) == expected


def test_rows_before_a_batch_that_is_long_for_its_device_are_cut_into_parts(monkeypatch):
    def summed(longest, whole_up_to):
        monkeypatch.setattr(layouts, "ROWS_LAST_UP_TO", {"gpu": longest})
        monkeypatch.setattr(layouts, "ROWS_WHOLE_UP_TO", whole_up_to)
        return {x.invars[0].aval.shape for x in equations((2, 5)) if x.primitive.name == "reduce_sum"}

    assert summed(9, 9) == {(LONG // layouts.PARTS, 2, 5)}
    assert summed(9, 10) == {(LONG, 2, 5)}
    assert summed(10, 9) == {(2, 5, LONG)}


@pytest.mark.parametrize("size", [3, 4])
def test_rows_that_parts_do_not_shorten_are_left_whole(size):
    row = jnp.arange(size)
    assert layouts.shortened(row, "add", layouts.Layout(axis=0, parts=3)) is row


def test_a_batch_of_one_is_no_axis(monkeypatch):
    """As that of a training's only seed. Between entries and environments it makes XLA lay the entries of one
    environment side by side in a GPU's memory, where a step of random play took up to 1.6 times as long."""
    monkeypatch.setattr(layouts, "ROWS_LAST_UP_TO", {"gpu": 0})
    assert row_shapes((2, 5)) == {(LONG, 1, 1), (LONG, 2, 5)}
    assert row_shapes((1, 5)) == row_shapes((5, 1)) == row_shapes((5,)) == {(LONG, 1), (LONG, 5)}


ONE_EACH = """
import itertools
import jax, jax.numpy as jnp, numpy as np
from jax.sharding import AxisType, Mesh, NamedSharding, PartitionSpec
from envs.straight_line import layout, straight_line
from tests.envs.test_straight_line import LONG, MATRIX, VECTOR, row_shapes, rows

layout.ROWS_LAST_UP_TO = {"gpu": 4}
assert row_shapes((4, 5)) == {(LONG, 1, 1), (LONG, 4, 5)}
expected = jax.vmap(jax.vmap(rows))
same = jax.vmap(jax.vmap(straight_line(rows, MATRIX, VECTOR)))
rng = np.random.default_rng(0)
given = [jnp.asarray(rng.normal(size=(4, 5, *x.shape)), jnp.float32) for x in (MATRIX, VECTOR)]
for shape, longest in itertools.product(((4, 1), (2, 2)), (4, 5)):  # of five environments on each device
    mesh = Mesh(np.array(jax.devices()).reshape(shape), ("seeds", "envs"), axis_types=(AxisType.Auto,) * 2)
    spread = NamedSharding(mesh, PartitionSpec("seeds"))
    layout.ROWS_LAST_UP_TO = {"gpu": longest}
    batches = [(1,), (20,)] if shape == (4, 1) else [(1, 1), (4, 5)]  # joined if every device has one seed
    with jax.set_mesh(mesh):
        assert row_shapes((4, 5)) == {(*x, LONG) if longest == 5 else (LONG, *x) for x in batches}, (shape, longest)
        for whole_up_to, parts in ((5, 1), (4, layout.PARTS)):
            layout.ROWS_WHOLE_UP_TO = whole_up_to
            assert longest == 5 or layout.layout_for((4, 5)).parts == parts
        compiled = jax.jit(same, in_shardings=spread, out_shardings=spread).lower(*given).compile()
    text = compiled.as_text()
    assert not any(word in text for word in ("all-gather", "all-reduce", "all-to-all", "collective-permute")), shape
    for one, other in zip(compiled(*jax.device_put(given, spread)), jax.jit(expected)(*given), strict=True):
        np.testing.assert_allclose(one, other, rtol=2e-5, atol=2e-5)
"""


@pytest.mark.slow
def test_neither_is_a_batch_of_which_every_device_has_one():
    """As seeds over as many devices: each sees an axis of length 1. Devices tell each other nothing."""
    run_on_four_devices(ONE_EACH)


def test_what_is_known_or_the_same_is_not_computed_again():
    def wasteful(v):
        turned = jnp.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]) @ v
        return turned, jnp.sin(v[0]) + jnp.sin(v[0]), jnp.sqrt(jnp.full(3, 4.0))

    found = operations(straight_line(wasteful, VECTOR), jnp.ones(3))
    assert (found["mul"], found["neg"], found["sin"], found["sqrt"], found["dot_general"]) == (0, 1, 1, 0, 0)


def test_what_has_no_rule_is_refused():
    with pytest.raises(NotImplementedError, match="no rule for while"):
        straight_line(lambda v: jax.lax.while_loop(lambda v: v.sum() < 9, lambda v: 2 * v, v), VECTOR)
    with pytest.raises(NotImplementedError, match="a position that is computed"):
        straight_line(lambda v: v[v.astype(int)], VECTOR)
    for wrong in (
        lambda v: jnp.argmin(v[None], axis=1),
        lambda v: v[:0].max(initial=-jnp.inf),
        lambda v: (v[:0] > 0).all(),
        lambda v: jnp.linalg.cholesky(jnp.stack([jnp.diag(jnp.exp(v))] * 2)),
    ):
        with pytest.raises(NotImplementedError):
            straight_line(wrong, VECTOR)


def test_a_rule_that_does_not_fit_is_a_refusal_too(monkeypatch):
    monkeypatch.setattr(program, "_loop_arguments", lambda params, given: params["not there"])
    with pytest.raises(NotImplementedError, match="does not fit: KeyError"):
        straight_line(lambda v: jax.lax.scan(lambda c, x: (c + x, c), v.sum(), v), VECTOR)


def test_a_program_for_several_devices_holds_the_same_arithmetic():
    """JAX then places every array that is put together, for which there is no rule and need be none."""

    def put_together(v):
        return jnp.zeros(6).at[jnp.array([2, 0, 1])].add(v)

    given = jnp.ones(3)
    with jax.set_mesh(jax.sharding.Mesh(np.array(jax.devices()), ("seeds",))):
        assert "reshard" in str(jax.make_jaxpr(put_together)(given))
        spread = operations(straight_line(put_together, VECTOR), given)
    assert spread == operations(straight_line(put_together, VECTOR), given)


@pytest.mark.slow
def test_mujoco_in_a_straight_line_moves_the_robot_as_mjx_does_whatever_the_layout(monkeypatch):
    point, rng, count = MjxPoint(), np.random.default_rng(0), 512
    limits = np.array([2.45, 2.45, 4.0, 1.0, 1.0, 5.0, 1.0, 1.0])  # many of them in a wall
    given = jnp.asarray(rng.uniform(-limits, limits, (count, 8)).T, jnp.float32)
    plain = np.stack(jax.jit(jax.vmap(point.mujoco_substep))(*given))
    scale = np.abs(plain).max(axis=1, keepdims=True)
    assert (np.abs(plain[6:8]).max(axis=1) > 100).all()  # some of them are pushed back
    for layout in LAYOUTS:
        use_layout(monkeypatch, layout)
        straight = jax.jit(jax.vmap(lambda *numbers: point._substep(*numbers)))(*given)
        np.testing.assert_allclose(np.stack(straight) / scale, plain / scale, atol=1e-5, err_msg=layout)

    before, after = (operations(f, *given[:, 0]).total() for f in (point.mujoco_substep, point._substep))
    assert after < 0.5 * before


def test_where_an_operation_has_no_rule_mujoco_moves_the_robot_itself_and_says_so(monkeypatch):
    def refuse(*_):
        raise NotImplementedError("there is no rule for twist")

    monkeypatch.setattr(point_mjx, "straight_line", refuse)
    point = MjxPoint(walls=False)
    with pytest.warns(UserWarning, match="no rule for twist"):
        assert point._written_out() == point.mujoco_substep
