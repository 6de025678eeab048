"""Checks of the numbers in a configuration: the error names the field, what it may be, and what it was.

Every condition is one that NaN does not meet.
"""

import dataclasses
import math
import typing
from typing import Any

import numpy as np

from t2tl_jax.names import ALIKE, nearest

COUNTER_LIMIT = 2**31 - 1
"""The largest number to which the counters of a compiled program, int32, can count."""

COUNTED = "since programs count in 32 bits"
"""Why there are no more than that."""

EPISODES_LIMIT = 1_000_000
"""Most episodes of a seed that an evaluation plays: all of them side by side."""

POOL_LIMIT = 2**26
"""Most bytes of the maps that one seed has at a time: 64 MiB, some hundred thousand maps, which take minutes."""


_NAMES = {int: "a whole number", float: "a number", str: "a text", bool: "True or False"}


def kinds(config: object) -> None:
    """Every field of a dataclass that holds a number, a text, a truth value, one of several words or a part, by its
    annotation; of parts the words too.

    Raises:
        ValueError: for the first that holds something of another kind, or a word that is none of those that it may
            hold, with the nearest.
    """
    words_of_parts(config)
    for name, hint in typing.get_type_hints(type(config)).items():
        value = getattr(config, name)
        if hint in _NAMES and not _is(value, hint):
            raise ValueError(f"{name} must be {_NAMES[hint]}, got {value!r}")
        elif isinstance(hint, type) and dataclasses.is_dataclass(hint) and not isinstance(value, hint):
            raise ValueError(f"{name} must be of type {hint.__name__}, got {value!r:.100}")


def words_of_parts(config: Any, prefix: str = "") -> None:
    """Every field that holds one of several words, of the dataclass and of its parts.

    Raises:
        ValueError: for the first that holds another one, with the nearest.
    """
    for field in dataclasses.fields(config):
        value, name = getattr(config, field.name), prefix + field.name
        if typing.get_origin(field.type) is typing.Literal:
            words = typing.get_args(field.type)
            if value not in words:
                close = nearest(str(value), map(str, words), cutoff=ALIKE)
                meant = f"; did you mean {close!r}?" if close else ""
                raise ValueError(f"{name} must be one of {', '.join(map(str, words))}, got {value!r}{meant}")
        elif dataclasses.is_dataclass(value) and not isinstance(value, type):
            words_of_parts(value, name + ".")


def _is(value: object, kind: type) -> bool:
    """Whole numbers may be given as 2e5, which other checks look at; a truth value is no number."""
    if kind is bool or isinstance(value, bool | np.bool_):
        return kind is bool and isinstance(value, bool | np.bool_)
    return isinstance(value, str if kind is str else int | float | np.number)


def whole(config: object, *names: str) -> None:
    """Fields that hold whole numbers, which may be given as 2e5 or by NumPy: they become those of Python, and files can
    hold them.

    Raises:
        ValueError: for the first that is not whole.
    """
    for name in names:
        value = getattr(config, name)
        if not isinstance(value, int):
            object.__setattr__(config, name, _whole(name, value))  # also of a frozen dataclass that is being made


def _whole(name: str, value: Any) -> int:
    number = _number(name, value, "a whole number")
    if not number.is_integer():
        raise ValueError(f"{name} must be a whole number, got {value}")
    return int(number) if isinstance(value, float) else int(value)


def _number(name: str, value: Any, what: str = "a number") -> float:
    try:
        if not isinstance(value, str):
            return float(value)
    except (TypeError, ValueError):
        pass
    raise ValueError(f"{name} must be {what}, got {value!r:.100}")


def counts(
    config: object,
    *names: str,
    least: int = 1,
    most: int = COUNTER_LIMIT,
    why: str = COUNTED,
) -> None:
    """Fields that hold whole numbers (see `whole`) from `least` to `most`, by default what a counter can hold; `why` no
    more.

    Raises:
        ValueError: for the first that does not; so do the other checks.
    """
    whole(config, *names)
    for name in names:
        count(name, getattr(config, name), least, most, why)


def count(name: str, value: Any, least: int = 1, most: int = COUNTER_LIMIT, why: str = COUNTED) -> int:
    """One such number by itself, such as an argument of a function; returns it as one of Python."""
    number = value if isinstance(value, int) else _whole(name, value)
    if number < least:
        raise ValueError(f"{name} must be at least {least}, got {number}")
    if number > most:
        raise ValueError(f"{name} must be at most {most:,}, {why}, got {number:,}")
    return number


def episodes(config: object, name: str, least: int = 1) -> None:
    """A field that says how many episodes an evaluation plays."""
    counts(config, name, least=least, most=EPISODES_LIMIT, why="since all are played side by side")


def sizes(config: object, *names: str) -> None:
    """Fields that hold the sizes of layers one after another: each at least 1. There may be none."""
    for name in names:
        value = getattr(config, name)
        if not isinstance(value, tuple | list) or not all(
            isinstance(size, int | np.integer) and size >= 1 for size in value
        ):
            raise ValueError(f"{name} are sizes of layers, each at least 1, got {value!r:.100}")


def positive(config: object, *names: str) -> None:
    """Fields that hold finite numbers above 0."""
    for name in names:
        value = _number(name, getattr(config, name))
        if not 0.0 < value < math.inf:
            raise ValueError(f"{name} must be a finite number above 0, got {value}")


def finite(config: object, *names: str) -> None:
    """Fields that hold finite numbers."""
    for name in names:
        value = _number(name, getattr(config, name))
        if not math.isfinite(value):
            raise ValueError(f"{name} must be a finite number, got {value}")


def not_negative(config: object, *names: str) -> None:
    """Fields that hold finite numbers, 0 or more."""
    for name in names:
        value = _number(name, getattr(config, name))
        if not 0.0 <= value < math.inf:
            raise ValueError(f"{name} must be a finite number, 0 or more, got {value}")


def shares(config: object, *names: str) -> None:
    """Fields that hold numbers from 0 to 1."""
    for name in names:
        value = _number(name, getattr(config, name))
        if not 0.0 <= value <= 1.0:
            raise ValueError(f"{name} must lie between 0 and 1, got {value}")


def pool(name: str, count: int, each: int) -> None:
    """A number of maps, of so many bytes each, that is made ahead and kept in memory.

    Raises:
        ValueError: for more than `POOL_LIMIT` bytes, of one or of all.
    """
    if each > POOL_LIMIT:
        raise ValueError(f"one map takes {each / 2**20:,.0f} MiB; the limit is {POOL_LIMIT // 2**20}: make it smaller")
    if count * each > POOL_LIMIT:
        raise ValueError(
            f"{name}={count:,} maps of {each:,} bytes take {count * each / 2**20:,.0f} MiB for each seed; at most "
            f"{POOL_LIMIT // each:,} of them are made at a time ({POOL_LIMIT // 2**20} MiB), and training goes on with "
            "others (map_period)"
        )
