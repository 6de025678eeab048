"""``--space FIELD=RANGE``: the fields that a search varies, and between what.

``0.9..0.99`` is a range, ``log:1e-5..1e-3`` one on a logarithmic scale, and ``gelu,relu`` are values to choose from.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from experiments.cli import grid, request
from t2tl_jax.errors import UserError
from t2tl_jax.runs.config import Config

LOG = "log:"
"""Before a range on a logarithmic scale."""

DIGITS = 4
"""Of numbers that are searched: more would say nothing, and would have to be copied."""

HINT = "FIELD=1e-5..1e-3, FIELD=log:1e-5..1e-3 or FIELD=VALUE,VALUE"


@dataclass(frozen=True)
class Dimension:
    """One ``--space`` option."""

    axis: grid.Axis
    """The field; its values are those to choose from, or the two ends of a range."""
    is_range: bool
    """Whether everything between the two values is allowed, too."""
    log: bool = False
    """Whether the range is on a logarithmic scale."""
    whole: bool = False
    """Whether the range has whole numbers alone, as its field does; known from `check` on."""

    @property
    def field(self) -> str:
        """The path of the field."""
        return self.axis.field

    @property
    def text(self) -> str:
        """As it may be written."""
        values = self.axis.values
        return f"{self.axis.flag}={LOG * self.log}{'..'.join(values) if self.is_range else ','.join(values)}"

    @property
    def ends(self) -> tuple[float, float]:
        """Of a range."""
        low, high = self.axis.values
        return float(low), float(high)

    def in_words(self, value: Any) -> str:
        """A value of this dimension as the text of a flag.

        Raises:
            UserError: for a value that does not lie in it.
        """
        if not self.is_range:
            allowed = value in self.axis.values
        else:
            low, high = self.ends
            allowed = isinstance(value, int | float) and low <= value <= high
        if not allowed:
            raise UserError(f"--space {self.text}: {value!r} lies outside of it")
        if not self.is_range or self.whole:
            return str(value)
        return repr(min(max(float(f"{value:.{DIGITS}g}"), low), high))


def read(texts: Sequence[str]) -> tuple[Dimension, ...]:
    """What the ``--space`` options say.

    Raises:
        UserError: for what is no range and no choice, for fields that come twice, and where there is no range at all.
    """
    found: list[Dimension] = []
    for text in texts:
        field, equals, values = text.partition("=")
        low, dots, high = values.removeprefix(LOG).partition("..")
        if not dots:
            axis = grid.read_axes([text])[0] if equals else None
            if axis is None or len(axis.values) < 2 or values.startswith(LOG):
                raise UserError(f"--space takes {HINT}, got {text!r}")
            found.append(Dimension(axis, is_range=False))
        else:
            axis = grid.Axis(field.removeprefix("--").replace("-", "_"), (low.strip(), high.strip()))
            found.append(Dimension(axis, is_range=True, log=values.startswith(LOG)))
            _check_range(found[-1], text)
    fields = [dimension.field for dimension in found]
    for field in fields:
        if fields.count(field) > 1:
            raise UserError(f"--space: {field.replace('_', '-')} is given twice")
    if not any(dimension.is_range for dimension in found):
        raise UserError(f"a search needs a range, as in --space {HINT}; a product of values is a --grid")
    return tuple(found)


def point(
    dimensions: Sequence[Dimension], texts: Mapping[str, str], seeds: str, asked: request.Request, prog: str
) -> grid.Point:
    """One setting of the space.

    Args:
        dimensions: of the space.
        texts: the values as texts of flags, by field.
        seeds: those that a search trains on.
        asked: what the other flags ask for.
        prog: the command, for messages.

    Raises:
        UserError: for values that do not fit.
    """
    axes = [dataclasses.replace(dimension.axis, values=(texts[dimension.field],)) for dimension in dimensions]
    (found,) = grid.points(axes, asked, prog)
    return dataclasses.replace(found, config=dataclasses.replace(found.config, seeds=seeds))


def check(dimensions: Sequence[Dimension], seeds: str, asked: request.Request, prog: str) -> tuple[Dimension, ...]:
    """Try the ends of all ranges and every choice: mistakes are told before anything is trained.

    Returns:
        The dimensions, with which of them are whole numbers.

    Raises:
        UserError: for fields that cannot be searched and values that do not fit.
    """
    methods = next((d.axis.values for d in dimensions if d.field == grid.METHOD), ("",))
    found: tuple[Dimension, ...] = ()
    for method in methods:
        given = {grid.METHOD: method} if method else {}
        first, last = ({d.field: d.axis.values[end] for d in dimensions} | given for end in (0, -1))
        between = [first | {d.field: value} for d in dimensions for value in d.axis.values[1:-1]]
        for texts in (first, last, *(texts | given for texts in between)):
            config = point(dimensions, texts, seeds, asked, prog).config
            found = tuple(_typed(dimension, config) for dimension in dimensions)
    return found


def _check_range(dimension: Dimension, text: str) -> None:
    try:
        low, high = dimension.ends
    except ValueError:
        low = high = math.nan
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise UserError(f"--space {text}: a range has two numbers, the lower one first, such as 1e-5..1e-3")
    if dimension.log and low <= 0:
        raise UserError(f"--space {text}: a logarithmic range begins above 0")


def _typed(dimension: Dimension, config: Config) -> Dimension:
    """The dimension with whether its field is a whole number; UserError for a range of what is no number."""
    if not dimension.is_range:
        return dimension
    value: Any = None if dimension.field == grid.METHOD else config
    for name in dimension.field.split(".") if value is not None else ():
        value = getattr(value, name)
    if type(value) not in (int, float):
        raise UserError(f"--space {dimension.text}: this field is no number; give its values, as in FIELD=VALUE,VALUE")
    return dataclasses.replace(dimension, whole=isinstance(value, int))
