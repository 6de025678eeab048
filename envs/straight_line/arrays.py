"""What JAX's operations do with arrays whose entries are numbers: they move them about, or combine them.

An array is one of numpy, of objects, whose entries are known or computed. Every rule takes the operation's parameters
and arrays and returns an array.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import product
from typing import Any, TypeAlias

import numpy as np
from jax.lax import GatherScatterMode

from envs.straight_line.numbers import CALLS, Number, Numbers

Array: TypeAlias = Any
"""An array of numpy, of objects, each an `Entry`; numpy has no type for that."""

LONG = 24
"""Along an axis of so many entries or more, an operation is one on rows instead of one for every entry."""


def entries(x: Any) -> Array:
    """A known array as one of entries."""
    x = np.asarray(x)
    out = np.empty(x.shape, object)
    for at in np.ndindex(x.shape):
        out[at] = x[at]
    return out


def singles(numbers: Numbers, x: Array) -> Array:
    """The same entries, each by itself."""
    out = np.empty(x.shape, object)
    for at in np.ndindex(x.shape):
        out[at] = numbers.single(x[at])
    return out


def known(x: Array, dtype: Any) -> np.ndarray:
    """An array of entries that all must be known, as an ordinary one.

    Raises:
        NotImplementedError: if one of them is computed.
    """
    if not all(isinstance(entry, np.generic) for entry in x.flat):
        raise NotImplementedError("a position that is computed: only slices of computed starts can be taken apart")
    return np.array(x.tolist(), dtype).reshape(x.shape)


def each(numbers: Numbers, name: str, apply: Callable[..., Any], dtype: Any, *given: Array) -> Array:
    """What an operation makes of the entries of arrays that are broadcast against each other.

    Along a long axis this is one operation on rows.
    """
    given = tuple(np.broadcast_arrays(*given))
    out = np.empty(given[0].shape, object)
    axis = next((axis for axis, size in enumerate(out.shape) if size >= LONG), None)
    if axis is None:
        for at in np.ndindex(out.shape):
            out[at] = numbers.operation(name, apply, dtype, *(numbers.single(x[at]) for x in given))
        return out
    rows, out = [np.moveaxis(x, axis, -1) for x in given], np.moveaxis(out, axis, -1)
    for at in np.ndindex(out.shape[:-1]):
        made = numbers.operation(name, apply, dtype, *(numbers.row(x[at]) for x in rows))
        out[at] = _as_objects(numbers.entries(made, out.shape[-1]))
    return np.moveaxis(out, -1, axis)


def call(numbers: Numbers, name: str, *given: Array, dtype: Any = None) -> Array:
    """`each` with one of the operations that rules are made of; `dtype` is of the result, by default of the last."""
    if dtype is None:
        dtype = bool if name in ("lt", "ne") else next((x.dtype for x in given[-1].flat), np.float32)
    return each(numbers, name, CALLS[name], dtype, *given)


def fold(numbers: Numbers, name: str, x: Array, axes: tuple[int, ...], start: np.generic) -> Array:
    """The entries along axes combined: by one operation along a long axis, else from the first to the last."""
    for axis in sorted(map(int, axes), reverse=True):
        x = np.moveaxis(x, axis, -1)
        size = x.shape[-1]
        if size >= LONG:
            out = np.empty(x.shape[:-1], object)
            for at in np.ndindex(out.shape):
                out[at] = numbers.reduced(name, numbers.row(x[at]), size)
            x = out
        elif size:
            total = x[..., 0]
            for i in range(1, size):
                total = call(numbers, name, total, x[..., i])
            x = total
        elif name == "add":
            x = entries(np.full(x.shape[:-1], start))
        else:
            raise NotImplementedError(f"{name} over an axis of length 0")
    return x


def _only(x: Array, rank: int, name: str) -> None:
    if x.ndim != rank:
        raise NotImplementedError(f"{name} of an array of rank {x.ndim}")


def _as_objects(x: Sequence[Any]) -> Array:
    out = np.empty(len(x), object)
    out[:] = x
    return out


def broadcast_in_dim(x: Array, shape: tuple[int, ...], broadcast_dimensions: tuple[int, ...]) -> Array:
    """As `jax.lax.broadcast_in_dim`."""
    sizes = [1] * len(shape)
    for size, axis in zip(x.shape, broadcast_dimensions, strict=True):
        sizes[axis] = size
    return np.broadcast_to(x.reshape(sizes), shape)


def dot(numbers: Numbers, x: Array, y: Array, dimension_numbers: Any) -> Array:
    """As `jax.lax.dot_general`."""
    (over_x, over_y), (batch_x, batch_y) = dimension_numbers
    free_x = [axis for axis in range(x.ndim) if axis not in (*over_x, *batch_x)]
    free_y = [axis for axis in range(y.ndim) if axis not in (*over_y, *batch_y)]
    batch = tuple(x.shape[axis] for axis in batch_x)
    count = math.prod(x.shape[axis] for axis in over_x)
    left, right = tuple(x.shape[axis] for axis in free_x), tuple(y.shape[axis] for axis in free_y)
    x = x.transpose(*batch_x, *free_x, *over_x).reshape(*batch, *left, *[1] * len(right), count)
    y = y.transpose(*batch_y, *free_y, *over_y).reshape(*batch, *[1] * len(left), *right, count)
    terms = call(numbers, "mul", x, y)
    return fold(numbers, "add", terms, (terms.ndim - 1,), np.float32(0))


def cholesky(numbers: Numbers, a: Array) -> Array:
    """The lower triangle L of a = L L^T, of one matrix."""
    _only(a, 2, "cholesky")
    call, size, a = numbers.call, len(a), singles(numbers, a)
    out = entries(np.zeros(a.shape, np.float32))
    for j, i in product(range(size), range(size)):
        if i < j:
            continue
        rest = a[i, j]
        for k in range(j):
            rest = call("sub", rest, call("mul", out[i, k], out[j, k]))
        out[i, j] = call("sqrt", rest) if i == j else call("div", rest, out[j, j])
    return out


def triangular_solve(
    numbers: Numbers, a: Array, b: Array, left_side: bool, lower: bool, transpose_a: bool, unit_diagonal: bool
) -> Array:
    """x of op(a) x = b by substitution; only with a on the left."""
    if not left_side:
        raise NotImplementedError("triangular_solve with the matrix on the right")
    _only(a, 2, "triangular_solve")
    call, size, a, b = numbers.call, len(a), singles(numbers, a), singles(numbers, b)
    a, lower = (a.T, not lower) if transpose_a else (a, lower)
    out = np.empty(b.shape, object)
    for column in range(b.shape[1]):
        for i in range(size) if lower else reversed(range(size)):
            rest = b[i, column]
            for k in range(i) if lower else range(i + 1, size):
                rest = call("sub", rest, call("mul", a[i, k], out[k, column]))
            out[i, column] = rest if unit_diagonal else call("div", rest, a[i, i])
    return out


def argmin(numbers: Numbers, x: Array, index_dtype: Any) -> Array:
    """The place of the first least entry of a vector, or of the first that is not a number."""
    _only(x, 1, "argmin")
    x = singles(numbers, x)
    call, least, place = numbers.call, x[0], index_dtype.type(0)
    for i, entry in enumerate(x[1:], 1):
        new = call("or", call("lt", entry, least), call("ne", entry, entry))
        least, place = call("select_n", new, least, entry), call("select_n", new, place, index_dtype.type(i))
    return _as_objects([place]).reshape(())


def dynamic_slice(numbers: Numbers, x: Array, starts: Sequence[Number | np.generic], sizes: tuple[int, ...]) -> Array:
    """As `jax.lax.dynamic_slice`: one of all possible slices, chosen by comparisons where the start is computed."""
    for axis, (start, size) in enumerate(zip(starts, sizes, strict=True)):
        last = x.shape[axis] - size
        slices = [x.take(range(first, first + size), axis) for first in range(last + 1)]
        if not isinstance(start, Number):
            x = slices[min(max(start.item(), 0), last)]
            continue
        x = slices[0]
        for first in range(1, last + 1):  # as there, a start before the first or behind the last is moved
            reached = numbers.call("lt", start.dtype.type(first - 1), start)
            x = call(numbers, "select_n", _as_objects([reached]).reshape(()), x, slices[first])
    return x


def gather(x: Array, indices: np.ndarray, numbers: Any, slice_sizes: tuple[int, ...], mode: Any) -> Array:
    """As `jax.lax.gather` with known indices; `numbers` are its dimension numbers."""
    batch = indices.shape[:-1]
    dropped = (*numbers.collapsed_slice_dims, *numbers.operand_batching_dims)
    pairs = tuple(zip(numbers.operand_batching_dims, numbers.start_indices_batching_dims, strict=True))
    window = tuple(size for axis, size in enumerate(slice_sizes) if axis not in dropped)
    out = np.empty((*batch, *window), object)
    for at, start in _starts(indices, x.ndim, numbers.start_index_map, pairs):
        last = np.array(x.shape) - slice_sizes
        if mode == GatherScatterMode.CLIP:
            start = np.clip(start, 0, last)
        if (start < 0).any() or (start > last).any():
            raise NotImplementedError("gather from outside of an array")
        part = x[tuple(slice(a, a + size) for a, size in zip(start, slice_sizes, strict=True))]
        out[at] = part.reshape(window) if window else part.item()
    offsets = numbers.offset_dims
    return np.moveaxis(out, range(len(batch), out.ndim), offsets) if offsets else out


def scatter(
    combine: Callable[[Any, Any], Any], x: Array, indices: np.ndarray, updates: Array, numbers: Any, mode: Any
) -> Array:
    """As the scatter operations with known indices; `numbers` are their dimension numbers."""
    inserted = (*numbers.inserted_window_dims, *numbers.operand_batching_dims)
    pairs = tuple(zip(numbers.operand_batching_dims, numbers.scatter_indices_batching_dims, strict=True))
    axes = [axis for axis in range(x.ndim) if axis not in inserted]  # of the window, in the operand
    updates = np.moveaxis(updates, numbers.update_window_dims, range(indices.ndim - 1, updates.ndim))
    window, out = updates.shape[indices.ndim - 1 :], x.copy()
    sizes = np.ones(x.ndim, int)
    sizes[axes] = window
    for at, start in _starts(indices, x.ndim, numbers.scatter_dims_to_operand_dims, pairs):
        if (start < 0).any() or (start + sizes > x.shape).any():
            if mode != GatherScatterMode.FILL_OR_DROP:
                raise NotImplementedError(f"scatter to outside of an array in the mode {mode}")
            continue
        for inside in np.ndindex(window):
            place = start.copy()
            place[axes] += np.array(inside, int)
            out[tuple(place)] = combine(out[tuple(place)], updates[(*at, *inside)])
    return out


def _starts(
    indices: np.ndarray, rank: int, axes: tuple[int, ...], batching: tuple[tuple[int, int], ...]
) -> Iterator[tuple[tuple[int, ...], np.ndarray]]:
    """Every place in the leading axes of `indices`, and where in an operand of that rank it points."""
    for at in np.ndindex(indices.shape[:-1]):
        start = np.zeros(rank, int)
        start[list(axes)] = indices[at]
        for axis, of_indices in batching:
            start[axis] = at[of_indices]
        yield at, start
