"""Random families of tasks: what one is, a registry of functions, and LTL2Action's with their names and distributions.

A family is a function under a name (`register_family`), or data: a `TaskFamily`, which a configuration holds and a file
stores. The data families of the project are in `family_trees`.
"""

import random
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import reduce

from t2tl_jax.ltl.benchmark_tasks import BENCHMARK_TASKS
from t2tl_jax.ltl.errors import LTLError, UnknownTaskError, check_text, names_of, nearest
from t2tl_jax.ltl.formula import Formula, eventually, prop, quote, until

Sampler = Callable[[random.Random], Formula]
"""Draws one task."""

Draw = Callable[..., Formula]
"""Draws one task of a family from (`random.Random`, the propositions, the family's whole numbers in their order)."""


@dataclass(frozen=True)
class TaskFamily:
    """Base class of families that are data: frozen dataclasses whose fields say what is drawn.

    `register_task_family` gives a subclass the name that files and the command line call it.
    """

    def least(self) -> int:
        """How many propositions `draw` needs."""
        raise NotImplementedError

    def draw(self, rng: random.Random, names: Sequence[str]) -> Formula:
        """Draw one task; all randomness comes from `rng`."""
        raise NotImplementedError

    def every(self, names: Sequence[str]) -> Iterator[Formula] | None:
        """Every task of the family, some maybe in several words; None for a family that can only be drawn from."""
        return None

    def __str__(self) -> str:
        """The name under which these settings are known, or the dataclass as Python writes it."""
        return next((name for name, family in _NAMED.items() if family == self), repr(self))


_NAMED: dict[str, TaskFamily] = {}
_JOINED = "X_OR_Y"
_RESERVED = {"OR": "joins two families", "phi": "begins the names of formulas", "rm": "begins those of reward machines"}


@dataclass(frozen=True)
class _Family:
    name: str
    draw: Draw
    parameters: tuple[str, ...]
    least: int | Callable[..., int]
    example: str
    module: str
    """Which registered it."""

    @property
    def shape(self) -> str:
        """How the family is written: `Sequence_<min length>_<max length>`."""
        return "_".join([self.name, *(f"<{parameter}>" for parameter in self.parameters)])

    def ranges(self, numbers: Sequence[int]) -> list[tuple[int, int]]:
        """The two ends of each range among the parameters: of `min x` and `max x`."""
        value = dict(zip(self.parameters, numbers, strict=True))
        ends = [(name, "max " + name.removeprefix("min ")) for name in value if name.startswith("min ")]
        return [(value[low], value[high]) for low, high in ends if high in value]


_FAMILIES: dict[str, _Family] = {}


def register_family(
    name: str,
    draw: Draw,
    *,
    parameters: Sequence[str] = (),
    least: int | Callable[..., int] = 1,
    example: str | None = None,
) -> None:
    """Give a family of tasks a name that every place takes which takes the name of a family.

    With `register_family("Reach", reach, parameters=("goals",))`, the task `Reach_3` is what
    `reach(rng, propositions, 3)` returns. A family is the same in every process if `draw` takes all its randomness
    from the `random.Random` that it is given.

    Args:
        name: letters and digits, an identifier that no formula reserves.
        draw: from (`random.Random`, tuple of propositions, one positive int per parameter) to a co-safe formula.
        parameters: what the numbers behind the name mean, in their order. `min x` and `max x` are the ends of a range,
            which must not be empty.
        least: how many propositions `draw` needs; or a function of the numbers that says so.
        example: a name that error messages may suggest; by default with 1 for each number.

    Raises:
        LTLError: (a ``ValueError``) for a name that cannot be used or belongs to another function, or an example that
            does not fit. To register the same function again is fine; the last registration counts.
    """
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9]*", name) or quote(name) != name:
        raise LTLError(
            f"a family cannot be called {name!r}: its name is letters and digits, without underscore, and no word that "
            "formulas reserve"
        )
    if name in _RESERVED:
        raise LTLError(f'a family cannot be called "{name}", which {_RESERVED[name]}; choose another name')
    if isinstance(parameters, str):
        raise LTLError(f"parameters is a sequence of names, got the string {parameters!r}")
    old = _FAMILIES.get(name)
    if old is not None and old.draw != draw:
        raise LTLError(
            f'the family "{name}" is registered with another function, {_where(old.draw)}; choose another name for '
            f"{_where(draw)}"
        )
    # Of whoever calls this: `draw` may be of another module that registers nothing, or a callable without a module.
    module = sys._getframe(1).f_globals.get("__name__", "__main__")
    example = example or "_".join([name, *["1"] * len(parameters)])
    family = _Family(name, draw, tuple(parameters), least, example, module)
    if family.example.split("_")[0] != name or _numbers(family, family.example) is None:
        raise LTLError(f'the example "{family.example}" of the family "{name}" does not read {family.shape}')
    _FAMILIES[name] = family


def name_family(name: str, family: TaskFamily) -> None:
    """Give settings of a family a name that every place takes which takes the name of a family.

    Args:
        name: an identifier without capitals.
        family: the settings.

    Raises:
        LTLError: for a name that cannot be used or belongs to other settings.
    """
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name) or quote(name) != name or name.split("_")[0] in _RESERVED:
        raise LTLError(
            f"settings of a family cannot be called {name!r}: such a name has small letters, digits and underscores, "
            "and is no word that formulas reserve"
        )
    if _NAMED.get(name, family) != family:
        raise LTLError(f'"{name}" is the family {_NAMED[name]!r}; choose another name for {family!r}')
    _NAMED[name] = family


def named_families() -> dict[str, TaskFamily]:
    """The families that are data and have a name."""
    return dict(_NAMED)


def modules_of_families() -> tuple[str, ...]:
    """What registered the others; another process that imports these modules knows the families too."""
    return tuple(dict.fromkeys(family.module for family in _FAMILIES.values()))


def sample(name: str | TaskFamily, propositions: Sequence[str], seed: int) -> Formula:
    """Draw one task of a family; equal arguments give equal tasks.

    Raises:
        LTLError: as `make_sampler`, or for a seed that is no whole number.
    """
    if not isinstance(seed, int):
        raise LTLError(f"seed is a whole number, got {seed!r:.100}")
    return make_sampler(name, propositions)(random.Random(seed))


def is_family(text: str | TaskFamily, propositions: Sequence[str] = ()) -> bool:
    """Whether a text names a family of tasks, maybe misspelt (`Untl_1_2_1_1`): one word that is no proposition."""
    if isinstance(text, TaskFamily):
        return True
    word = text.strip()
    if word in propositions or word in BENCHMARK_TASKS or not word.isidentifier():
        return False
    if word.split("_OR_")[0] in _NAMED:
        return True
    return word.split("_")[0] in _FAMILIES or re.fullmatch(r"[A-Za-z]+(_\d+)+", word) is not None


def make_sampler(name: str | TaskFamily, propositions: Sequence[str]) -> Sampler:
    """Return the sampler of a family.

    Families: `Default`, `Until_a_b_c_d`, `Sequence_a_b`, `Eventually_a_b_c_d`, `Adversarial`, `Super`, those of
    `register_family` and `name_family`, and any two of them as `X_OR_Y`. Both ends of a range can be drawn.

    Args:
        name: for example `Until_1_3_1_2`; or a family that is data.
        propositions: what the tasks may speak of.

    Raises:
        UnknownTaskError: no such family; names the nearest valid one.
        LTLError: wrong parameters, or too few propositions.
    """
    if isinstance(name, TaskFamily):
        family_data, given = name, names_of(propositions)
        _check_count(str(name), given, family_data.least())
        return lambda rng: family_data.draw(rng, given)
    check_text("the name of a family", name)
    if name in _NAMED:
        return make_sampler(_NAMED[name], propositions)
    if "_OR_" in name:
        first, second = name.split("_OR_", 1)
        left, right = make_sampler(first, propositions), make_sampler(second, propositions)
        return lambda rng: left(rng) | right(rng)
    family, numbers = _read(name)
    names = names_of(propositions)
    _check_count(name, names, family.least(*numbers) if callable(family.least) else family.least)
    return lambda rng: _drawn(family, rng, names, numbers)


def check_name(name: str) -> None:
    """Refuse what only looks like the name of a family; errors as `make_sampler`, but for propositions."""
    for part in name.split("_OR_"):
        if part not in _NAMED:
            _read(part)


def _read(name: str) -> tuple[_Family, list[int]]:
    """The family that a name speaks of, and its numbers."""
    family = _FAMILIES.get(name.split("_")[0])
    if family is None:
        known = ", ".join([*_NAMED, *(each.shape for each in _FAMILIES.values()), _JOINED])
        examples = [*(each.example for each in _FAMILIES.values()), *_NAMED]
        raise UnknownTaskError(f'unknown task family "{name}"; known: {known}{nearest(name, examples)}')
    numbers = _numbers(family, name)
    if numbers is None:
        count = len(family.parameters)
        wanted = f"{count} positive whole number{'s' * (count != 1)}" if count else "no numbers"
        raise UnknownTaskError(f'"{name}" needs {wanted}: {family.shape}; did you mean "{family.example}"?')
    for low, high in family.ranges(numbers):
        if low > high:
            raise LTLError(f'"{name}" asks for {low} to {high}, an empty range: {family.shape}')
    return family, numbers


def _numbers(family: _Family, name: str) -> list[int] | None:
    """The numbers behind a family's name; None where they are not as many positive ones as it has parameters."""
    numbers = name.split("_")[1:]
    fit = len(numbers) == len(family.parameters) and all(re.fullmatch(r"[1-9]\d{0,3}", number) for number in numbers)
    return [int(number) for number in numbers] if fit else None


def _drawn(family: _Family, rng: random.Random, names: tuple[str, ...], numbers: list[int]) -> Formula:
    task = family.draw(rng, names, *numbers)
    if not isinstance(task, Formula):
        raise LTLError(
            f'the family "{family.name}" is to draw a Formula, but {_where(family.draw)} returned a '
            f"{type(task).__name__}; `parse` makes formulas of text"
        )
    return task


def _check_count(name: str, propositions: tuple[str, ...], needed: int) -> None:
    if len(set(propositions)) < len(propositions):
        raise LTLError(f"a proposition is named twice: {', '.join(propositions)}")
    if len(propositions) < needed:
        given = ", ".join(propositions) or "none"
        raise LTLError(f'"{name}" needs at least {needed} propositions, got {len(propositions)}: {given}')


def _where(draw: Draw) -> str:
    """A function by module and name; other callables as they show themselves."""
    return f"{draw.__module__}.{draw.__qualname__}" if hasattr(draw, "__qualname__") else repr(draw)


def _default(rng: random.Random, names: Sequence[str]) -> Formula:
    p = [prop(name) for name in rng.sample(names, 4)]
    return until(~p[0], p[1] & until(~p[2], p[3]))


def _until(
    rng: random.Random, names: Sequence[str], min_levels: int, max_levels: int, min_conjuncts: int, max_conjuncts: int
) -> Formula:
    count = rng.randint(min_conjuncts, max_conjuncts)
    drawn = iter([prop(name) for name in rng.sample(names, 2 * max_levels * count)])
    tasks = []
    for _ in range(count):
        task = until(~next(drawn), next(drawn))
        for _ in range(rng.randint(min_levels, max_levels) - 1):
            task = until(~next(drawn), next(drawn) & task)
        tasks.append(task)
    return _conjoin(tasks)


def _sequence(rng: random.Random, names: Sequence[str], min_length: int, max_length: int) -> Formula:
    chosen: list[str] = []
    for _ in range(rng.randint(min_length, max_length)):
        chosen.append(rng.choice([name for name in names if not chosen or name != chosen[-1]]))
    return _chain([prop(name) for name in chosen])


def _eventually(
    rng: random.Random, names: Sequence[str], min_length: int, max_length: int, min_conjuncts: int, max_conjuncts: int
) -> Formula:
    tasks = []
    for _ in range(rng.randint(min_conjuncts, max_conjuncts)):
        goals: list[Formula] = []
        previous: list[str] = []
        for _ in range(rng.randint(min_length, max_length)):
            allowed = [name for name in names if name not in previous]
            previous = rng.sample(allowed, 2 if rng.random() < 0.25 else 1)
            goals.append(reduce(Formula.__or__, [prop(name) for name in previous]))
        tasks.append(_chain(goals))
    return _conjoin(tasks)


def _adversarial(rng: random.Random, names: Sequence[str]) -> Formula:
    return _chain([prop(names[0]), prop(names[rng.choice((1, 2))])])


def _super(rng: random.Random, names: Sequence[str]) -> Formula:
    return make_sampler(rng.choice(_SUPER), names)(rng)


def _chain(goals: list[Formula]) -> Formula:
    """Return `F(g0 & F(g1 & ...))`."""
    task = eventually(goals[-1])
    for goal in reversed(goals[:-1]):
        task = eventually(goal & task)
    return task


def _conjoin(tasks: list[Formula]) -> Formula:
    """Return the conjunction with the newest task outermost, as LTL2Action builds it."""
    return reduce(lambda rest, newest: newest & rest, tasks)


_SUPER = ("Sequence_2_4", "Until_1_2_1_2", "Default", "Eventually_1_4_1_3")
_LENGTH, _LEVELS, _CONJUNCTS = ((f"min {counted}", f"max {counted}") for counted in ("length", "levels", "conjuncts"))

register_family("Default", _default, least=4)
register_family(
    "Until",
    _until,
    parameters=_LEVELS + _CONJUNCTS,
    least=lambda min_levels, max_levels, min_conjuncts, max_conjuncts: 2 * max_levels * max_conjuncts,
    example="Until_1_2_1_1",
)
register_family(
    "Sequence",
    _sequence,
    parameters=_LENGTH,
    least=lambda min_length, max_length: 2 if max_length > 1 else 1,
    example="Sequence_2_4",
)
register_family(
    "Eventually",
    _eventually,
    parameters=_LENGTH + _CONJUNCTS,
    # A disjunction takes two, and both have to differ from up to two of the position before.
    least=lambda min_length, max_length, min_conjuncts, max_conjuncts: 4 if max_length > 1 else 2,
    example="Eventually_1_5_1_4",
)
register_family("Adversarial", _adversarial, least=3)
register_family("Super", _super, least=8)
