"""Single numbers that are known or computed, without computing one twice.

A number is known (a scalar of numpy) or a `Number`, an operation of JAX on others. Equal operations on the same numbers
are one `Number`.
"""

import functools
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np


class Number:
    """Something computed: one float32, int32 or bool, or a row of so many, by an operation of that name.

    Given ones have no name.
    """

    __slots__ = ("apply", "dtype", "name", "of", "size")

    def __init__(self, name: str, apply: Callable[..., Any], of: tuple[Any, ...], dtype: Any, size: int = 0) -> None:
        """`apply` makes it of what `of` stands for; `size` is that of a row, and 0 for a single number."""
        self.name, self.apply, self.of, self.dtype, self.size = name, apply, of, np.dtype(dtype), size

    @property
    def along(self) -> bool:
        """Whether a row is put together or taken apart; `apply` is then told the `axis` of its entries."""
        return (self.size > 0) != any(map(size_of, self.of))

    @property
    def combines_row(self) -> bool:
        """Whether it is the entries of a row, combined by one of `REDUCTIONS`."""
        return self.along and self.name in REDUCTIONS


class InRow:
    """One entry of a row."""

    __slots__ = ("dtype", "index", "row")

    def __init__(self, row: Number, index: int) -> None:
        self.row, self.index, self.dtype = row, index, row.dtype


Entry: TypeAlias = Number | InRow | np.generic
"""A single number: computed, by itself or in a row, or known."""

Operand: TypeAlias = Number | np.ndarray | np.generic
"""A row or a single number, computed or known."""


def _trunc_divide(a: Any, b: Any) -> Any:
    return a / b if np.issubdtype(a.dtype, np.floating) else np.trunc(a / b).astype(a.dtype)


KNOWN: dict[str, Callable[..., Any]] = {
    "abs": np.abs,
    "add": np.add,
    "and": np.bitwise_and,
    "ceil": np.ceil,
    "cos": np.cos,
    "div": _trunc_divide,
    "eq": np.equal,
    "exp": np.exp,
    "floor": np.floor,
    "ge": np.greater_equal,
    "gt": np.greater,
    "is_finite": np.isfinite,
    "le": np.less_equal,
    "log": np.log,
    "lt": np.less,
    "max": np.maximum,
    "min": np.minimum,
    "mul": np.multiply,
    "ne": np.not_equal,
    "neg": np.negative,
    "not": np.invert,
    "or": np.bitwise_or,
    "pow": np.power,
    "rem": np.fmod,
    "sign": np.sign,
    "sin": np.sin,
    "sqrt": np.sqrt,
    "square": np.square,
    "sub": np.subtract,
    "tan": np.tan,
    "convert_element_type": lambda x: x,  # the result is converted in any case
    "select_n": lambda which, *cases: np.choose(which.astype(int), cases),
}
"""Operations entry by entry: what they make of arrays of numpy."""


class Numbers:
    """Makes numbers, and remembers those that it made."""

    def __init__(self) -> None:
        self.made: list[Number] = []  # every one behind those that it is made of
        self._by_key: dict[Any, Number] = {}

    def given(self, dtype: Any) -> Number:
        """A number that comes from outside."""
        return self._add(Number("", lambda: None, (), dtype))

    def operation(self, name: str, apply: Callable[..., Any], dtype: Any, *of: Operand) -> Operand:
        """What an operation of `KNOWN` makes of numbers and rows; `apply` does it in JAX."""
        if not any(isinstance(x, Number) for x in of):
            with np.errstate(all="ignore"):
                return np.asarray(KNOWN[name](*of)).astype(dtype)[()]
        simple = self._simpler(name, dtype, of)
        if simple is not None:
            return simple
        keys = [_key(x) for x in of]
        size = max(size_of(x) for x in of)
        return self._once(
            (name, str(dtype), *(sorted(keys) if name in COMMUTES else keys)), name, apply, of, dtype, size
        )

    def call(self, name: str, *of: Operand) -> Operand:
        """One of `CALLS`, by its name."""
        return self.operation(name, CALLS[name], bool if name in ("lt", "ne") else of[-1].dtype, *of)

    def reduced(self, name: str, x: Operand, size: int) -> Operand:
        """The entries of a row of that size combined, or a single number with itself so many times."""
        if isinstance(x, Number) and x.size:
            return self._once((name, "row", id(x)), name, REDUCTIONS[name], (x,), x.dtype, 0)
        whole = [x] * size if isinstance(x, Number) else list(np.broadcast_to(x, size))
        return functools.reduce(partial(self.call, name), whole)

    def single(self, x: Entry) -> Number | np.generic:
        """An entry by itself."""
        if not isinstance(x, InRow):
            return x
        take = partial(jax.lax.index_in_dim, index=x.index, keepdims=False)
        return self._once(("entry", x.index, id(x.row)), "entry", take, (x.row,), x.dtype, 0)

    def row(self, entries: Sequence[Entry]) -> Operand:
        """Entries side by side; a single number if they are all the same."""
        first = entries[0]
        if all(isinstance(x, np.generic) for x in entries):
            known = np.array(list(entries))
            return known[0] if (known == known[0]).all() else known
        places = [(x.row, x.index) if isinstance(x, InRow) else None for x in entries]
        if isinstance(first, InRow) and places == [(first.row, i) for i in range(first.row.size)]:
            return first.row
        of = tuple(self.single(x) for x in entries)
        keys = [_key(x) for x in of]
        if len(set(keys)) == 1:
            return of[0]
        return self._once(("row", *keys), "row", _stacked, of, first.dtype, len(of))

    def entries(self, x: Operand, size: int) -> list[Entry]:
        """What stands in a row of that size, or a single number so many times."""
        if isinstance(x, Number):
            return [InRow(x, i) for i in range(size)] if x.size else [x] * size
        return list(np.broadcast_to(x, size))

    def _once(
        self, key: tuple[Any, ...], name: str, apply: Callable[..., Any], of: tuple[Any, ...], dtype: Any, size: int
    ) -> Number:
        if key not in self._by_key:
            self._by_key[key] = self._add(Number(name, apply, of, dtype, size))
        return self._by_key[key]

    def _add(self, number: Number) -> Number:
        self.made.append(number)
        return number

    def _simpler(self, name: str, dtype: Any, of: tuple[Any, ...]) -> Operand | None:
        """The same number by less, where there is a rule: exact ones, but for 0 times what is not finite."""
        one, other = (*of, None)[:2]
        match name:
            case "mul":
                for x, y in ((one, other), (other, one)):
                    if _is(x, 0):
                        return x
                    if _is(x, 1):
                        return y
                    if _is(x, -1):
                        return self.call("neg", y)
                    if _negated(x):
                        return self.call("neg", self.call("mul", x.of[0], y))
            case "add":
                for x, y in ((one, other), (other, one)):
                    if _is(x, 0):
                        return y
                    if _negated(x):
                        return self.call("sub", y, x.of[0])
            case "sub":
                if _is(other, 0):
                    return one
                if _is(one, 0):
                    return self.call("neg", other)
                if _negated(other):
                    return self.call("add", one, other.of[0])
            case "div" if _is(other, 1):
                return one
            case "neg" if _negated(one):
                return one.of[0]
            case "square":
                return self.call("mul", one, one)
            case "pow" if _is(other, 1):
                return one
            case "pow" if _is(other, 2):
                return self.call("mul", one, one)
            case "and" | "or" if np.dtype(dtype) == bool:
                for x, y in ((one, other), (other, one)):
                    if _is(x, name == "and"):
                        return y
                    if _is(x, name == "or"):
                        return x
            case "not" if isinstance(one, Number) and one.name == "not":
                return one.of[0]
            case "convert_element_type" if one.dtype == dtype:
                return one
            case "select_n":
                if isinstance(one, np.generic):
                    return of[1 + int(one)]
                if len({_key(x) for x in of[1:]}) == 1:
                    return other
        return None


def _stacked(*entries: jax.Array, axis: int) -> jax.Array:
    return jnp.stack(entries, axis)


def _is(x: Operand | None, value: float) -> bool:
    return isinstance(x, np.ndarray | np.generic) and bool(np.all(x == value))


def _negated(x: Operand | None) -> bool:
    return isinstance(x, Number) and x.name == "neg"


def size_of(x: Operand) -> int:
    """How many a row holds; 0 for a single number."""
    return x.size if isinstance(x, Number) else x.size if x.ndim else 0


def _key(x: Operand) -> tuple[str, Any]:
    return ("", id(x)) if isinstance(x, Number) else (f"{x.dtype}{x.shape}", x.tobytes())


REDUCTIONS: dict[str, Callable[..., Any]] = {
    "add": jnp.sum,
    "max": jnp.max,
    "min": jnp.min,
    "and": jnp.all,
    "or": jnp.any,
}
"""What combines a row, by what combines two of its entries."""

COMMUTES = frozenset({"add", "and", "eq", "max", "min", "mul", "ne", "or"})
CALLS: dict[str, Callable[..., Any]] = {
    "add": jax.lax.add,
    "and": jax.lax.bitwise_and,
    "div": jax.lax.div,
    "lt": jax.lax.lt,
    "max": jax.lax.max,
    "min": jax.lax.min,
    "mul": jax.lax.mul,
    "ne": jax.lax.ne,
    "neg": jax.lax.neg,
    "or": jax.lax.bitwise_or,
    "select_n": jax.lax.select_n,
    "sqrt": jax.lax.sqrt,
    "sub": jax.lax.sub,
}
"""The operations that rules are made of."""
