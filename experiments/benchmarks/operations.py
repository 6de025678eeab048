"""What a traced program has to do at the least, by the named scopes of its source: arithmetic, and bytes in and out.

Operations are counted as they are traced, loops with all of their rounds. Bytes are those of the arrays that a part
gets from others or gives to them, each once a round, as if everything inside of a part stayed in registers; of arrays
that are read or written at some places, those places. Random bits and comparisons of keys count nothing.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from jax.extend.core import ClosedJaxpr, Jaxpr, Literal

SHAPED = ("broadcast_in_dim", "reshape", "squeeze", "expand_dims", "transpose", "rev", "concatenate", "split", "pad")
PLACED = ("slice", "dynamic_slice", "dynamic_update_slice", "gather", "scatter", "select_n")
COPIED = ("copy", "convert_element_type", "stop_gradient", "device_put", "sharding_constraint", "iota")
FREE = frozenset((*SHAPED, *PLACED, *COPIED, "random_wrap", "random_unwrap"))
"""Operations that move numbers, and compute none."""

READ_AT = frozenset(("gather", "dynamic_slice"))
"""Operations that read of their first array only what they give."""

WRITTEN_AT = {"dynamic_update_slice": 1, "scatter": 2, "scatter-add": 2, "scatter_add": 2}
"""Operations that change their first array in its place, and which of their inputs is what they write."""

CALLS = ("jaxpr", "call_jaxpr", "fun_jaxpr", "call")
"""Parameters of operations that are calls of another program, once."""


@dataclass
class Work:
    """Of one part of a program."""

    flop: float = 0.0
    """Additions, multiplications and functions of single numbers."""
    bytes: float = 0.0
    """In and out."""


@dataclass(frozen=True)
class _Operation:
    name: str
    part: str
    inputs: tuple[Any, ...]
    outputs: tuple[Any, ...]
    flop: float
    moved: float  # bytes, of arrays that are read or written at places


@dataclass
class _Region:
    """Operations that are done together, `rounds` times: the program, or the body of a loop."""

    rounds: float
    operations: list[_Operation] = field(default_factory=list)
    results: tuple[Any, ...] = ()
    inner: list["_Region"] = field(default_factory=list)


def count(program: ClosedJaxpr, part_of: Callable[[str], str]) -> dict[str, Work]:
    """The least work of every part of a program; `part_of` gives the part for a path of named scopes.

    The body of a loop whose rounds are not known counts once, and so does the first branch of a choice.
    """
    found: dict[str, Work] = {}
    for region in _all(_region(program.jaxpr, 1.0, "", part_of)):
        _add(found, region)
    return found


def _region(jaxpr: Jaxpr, rounds: float, path: str, part_of: Callable[[str], str]) -> _Region:
    region = _Region(rounds)
    known: dict[Any, Any] = {}
    _flatten(jaxpr, known, region, path, part_of)
    region.results = tuple(_name(known, x) for x in jaxpr.outvars)
    return region


def _flatten(jaxpr: Jaxpr, known: dict[Any, Any], region: _Region, path: str, part_of: Callable[[str], str]) -> None:
    """Add the operations of `jaxpr`; calls are replaced by what they call, loops become regions of their own."""
    for equation in jaxpr.eqns:
        inside = "/".join(part for part in (path, str(equation.source_info.name_stack)) if part)
        name, params = equation.primitive.name, equation.params
        if name in ("scan", "while", "cond"):
            for body, times in _bodies(name, params):
                region.inner.append(_region(body, region.rounds * times, inside, part_of))
            continue
        called = next((params[key] for key in CALLS if key in params), None)
        if called is not None:
            body = getattr(called, "jaxpr", called)
            given = [_name(known, x) for x in equation.invars]
            there = dict(zip(body.invars, given[len(given) - len(body.invars) :], strict=True))
            _flatten(body, there, region, inside, part_of)
            known |= {x: _name(there, y) for x, y in zip(equation.outvars, body.outvars, strict=True)}
            continue
        region.operations.append(_operation(name, part_of(inside), known, equation))


def _operation(name: str, part: str, known: Mapping[Any, Any], equation: Any) -> _Operation:
    given, outputs, moved = list(equation.invars), tuple(equation.outvars), 0.0
    if name in READ_AT:
        given, moved = given[1:], _size(equation.outvars[0])
    if name in WRITTEN_AT:
        given, outputs, moved = given[1:], (), _size(given[WRITTEN_AT[name]])
    inputs = tuple(x for x in (_name(known, y) for y in given) if not isinstance(x, Literal))
    return _Operation(name, part, inputs, outputs, _flop(name, equation), moved)


def _bodies(name: str, params: Mapping[str, Any]) -> list[tuple[Jaxpr, float]]:
    if name == "scan":
        return [(params["jaxpr"].jaxpr, float(params["length"]))]
    if name == "while":
        return [(params["body_jaxpr"].jaxpr, 1.0)]
    return [(params["branches"][0].jaxpr, 1.0)]


def _name(known: Mapping[Any, Any], x: Any) -> Any:
    return x if isinstance(x, Literal) else known.get(x, x)


def _all(region: _Region) -> Iterator[_Region]:
    yield region
    for inner in region.inner:
        yield from _all(inner)


def _add(found: dict[str, Work], region: _Region) -> None:
    made_by = {x: one.part for one in region.operations for x in one.outputs}
    read: set[tuple[Any, str]] = set()
    for one in region.operations:
        work = found.setdefault(one.part, Work())
        work.flop += region.rounds * one.flop
        work.bytes += region.rounds * one.moved
        read |= {(x, one.part) for x in one.inputs if made_by.get(x) != one.part}
    used_outside = {x for x, _ in read} | {x for x in region.results if not isinstance(x, Literal)}
    for x, part in read:
        found[part].bytes += region.rounds * _size(x)
    for x, part in made_by.items():
        if x in used_outside:
            found[part].bytes += region.rounds * _size(x)


def _flop(name: str, equation: Any) -> float:
    if name in FREE or name.startswith(("random_", "threefry")):
        return 0.0
    if name == "dot_general":
        (contracted, _), _ = equation.params["dimension_numbers"]
        sizes = _shape(equation.invars[0])
        return 2.0 * math.prod(_shape(equation.outvars[0])) * math.prod(sizes[k] for k in contracted)
    counted: Sequence[Any] = equation.invars if name.startswith(("reduce", "cum", "arg")) else equation.outvars
    return float(max((math.prod(_shape(x)) for x in counted), default=0))


def _shape(x: Any) -> tuple[int, ...]:
    return tuple(getattr(x.aval, "shape", ()))


def _size(x: Any) -> float:
    """Bytes; a random key has those of its two words."""
    return float(math.prod(_shape(x)) * getattr(getattr(x.aval, "dtype", None), "itemsize", 0))
