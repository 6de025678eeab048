"""The codes of tasks in a gradient step: of a small table every row is encoded, of a large one those of the minibatch.

A minibatch of fewer samples than the table has rows has the row of each sample encoded. Of a large table and a large
minibatch, cost and memory follow the distinct rows of the minibatch, some of which are encoded at once. Nothing is left
out, so values and gradients are those of the whole table to rounding. All shapes are fixed; what varies is how many
rounds a loop makes.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from t2tl_jax.ltl import TaskTable
from t2tl_jax.networks.task_encoder import TaskEncoderConfig
from t2tl_jax.training.types import Params

ROWS_AT_ONCE = 512
"""Rows that are encoded together."""

LARGE = 1024
"""A table of more rows than this is large; smaller ones are encoded as a whole, once per gradient step."""

Encode = Callable[[Params, TaskTable], jax.Array]
"""(params, table) -> float32[rows, dim]."""

EncodeRows = Callable[[Params, TaskTable, jax.Array, jax.Array | None], jax.Array]
"""(params, table, rows int32[k], their codes with earlier parameters [k, dim] or None) -> float32[k, dim]."""


class Codes(NamedTuple):
    """What `make_codes` makes.

    every(params, table) -> float32[rows, dim]: the code of every row.
    of(params, table, known, rows) -> float32[..., dim]: those of `rows` int32[...] in a gradient step; `known`
        float32[rows, dim] are the codes of every row with the parameters before the update.
    """

    every: Encode
    of: Callable[[Params, TaskTable, jax.Array, jax.Array], jax.Array]


def make_codes(reader: TaskEncoderConfig, frozen: bool, encode: Encode, encode_rows: EncodeRows) -> Codes:
    """How a learner gets the codes of tasks.

    Args:
        reader: configuration of the task encoder.
        frozen: whether it is kept as it is.
        encode: all rows of a table.
        encode_rows: some of them; called only if the reader's `rows_apart` holds.
    """
    lookup = make_lookup(encode_rows)

    def every(params: Params, table: TaskTable) -> jax.Array:
        if reader.rows_apart and table.num_rows > LARGE:
            return every_code(encode_rows, params, table)
        return encode(params, table)

    def of(params: Params, table: TaskTable, known: jax.Array, rows: jax.Array) -> jax.Array:
        large = table.num_rows > LARGE
        if not reader.learned or (frozen and large):
            return known[rows]
        if reader.rows_apart and rows.size <= min(ROWS_AT_ONCE, table.num_rows // 2):
            row = rows.reshape(-1)
            return encode_rows(params, table, row, known[row]).reshape(*rows.shape, -1)
        if reader.rows_apart and large:
            return lookup(params, table, known, rows)
        # Each distinct formula is encoded once; the gather's gradient sums over the samples of a row.
        return encode(params, table)[rows]

    return Codes(every, of)


def every_code(encode: EncodeRows, params: Params, table: TaskTable) -> jax.Array:
    """The code of every row, float32[rows, dim], with no more memory than some rows take; without gradient."""
    count = table.num_rows
    rows = jnp.arange(-(-count // ROWS_AT_ONCE) * ROWS_AT_ONCE).reshape(-1, ROWS_AT_ONCE) % count
    codes = jax.lax.map(lambda some: encode(params, table, some, None), rows)
    return codes.reshape(-1, codes.shape[-1])[:count]


def distinct_rows(rows: jax.Array, count: int) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Each row once, in ascending order: int32[k], where row 1, which is false, fills the places that are left over.

    Args:
        rows: int32[...], B of them.
        count: rows of the table.

    Returns:
        The distinct rows, k being the lesser of B and `count`, rounded up to a multiple of `ROWS_AT_ONCE`; the place
        of each of `rows` among them, int32[...]; how many they are, int32.
    """
    room = -(-min(rows.size, count) // ROWS_AT_ONCE) * ROWS_AT_ONCE
    there = jnp.zeros(count, bool).at[rows.reshape(-1)].set(True)
    (distinct,) = jnp.nonzero(there, size=room, fill_value=1)
    return distinct, (jnp.cumsum(there) - 1)[rows], there.sum()


def make_lookup(encode: EncodeRows) -> Callable[[Params, TaskTable, jax.Array, jax.Array], jax.Array]:
    """A function of (params, table, known float32[rows, dim], rows int32[...]) that gives codes [..., dim].

    Its gradient is that of the parameters alone. `known` are the codes with earlier parameters. Codes are computed once
    more on the way back, instead of keeping all that is between them and the tokens.
    """

    def rounds(count: jax.Array) -> jax.Array:
        return -(-count // ROWS_AT_ONCE)

    def part(x: jax.Array, number: jax.Array) -> jax.Array:
        return jax.lax.dynamic_slice_in_dim(x, number * ROWS_AT_ONCE, ROWS_AT_ONCE)

    def forward(params: Params, table: TaskTable, known: jax.Array, rows: jax.Array) -> tuple[jax.Array, Any]:
        distinct, place, count = distinct_rows(rows, table.num_rows)

        def one_round(number: jax.Array, codes: jax.Array) -> jax.Array:
            some = part(distinct, number)
            new = encode(params, table, some, known[some])
            return jax.lax.dynamic_update_slice_in_dim(codes, new, number * ROWS_AT_ONCE, 0)

        codes = jnp.zeros((len(distinct), known.shape[-1]), known.dtype)
        codes = jax.lax.fori_loop(0, rounds(count), one_round, codes)
        return codes[place], (params, table, known, distinct, place, count)

    def backward(kept: Any, gradient: jax.Array) -> tuple[Params, None, None, None]:
        params, table, known, distinct, place, count = kept
        of_codes = jnp.zeros((len(distinct), known.shape[-1]), gradient.dtype).at[place].add(gradient)

        def one_round(number: jax.Array, total: Params) -> Params:
            some = part(distinct, number)
            _, pull = jax.vjp(lambda params: encode(params, table, some, known[some]), params)
            return jax.tree.map(jnp.add, total, pull(part(of_codes, number))[0])

        return jax.lax.fori_loop(0, rounds(count), one_round, jax.tree.map(jnp.zeros_like, params)), None, None, None

    @jax.custom_vjp
    def lookup(params: Params, table: TaskTable, known: jax.Array, rows: jax.Array) -> jax.Array:
        return forward(params, table, known, rows)[0]

    lookup.defvjp(forward, backward)
    return lookup
