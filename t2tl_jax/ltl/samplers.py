"""Random families of tasks, with the names and distributions of LTL2Action's samplers."""

import random
import re
from collections.abc import Callable, Sequence
from functools import reduce

from t2tl_jax.ltl.errors import LTLError, UnknownTaskError, nearest
from t2tl_jax.ltl.formula import Formula, eventually, prop, until

Sampler = Callable[[random.Random], Formula]
"""Draws one task."""

_SHAPES = {
    "Default": "Default",
    "Until": "Until_<min levels>_<max levels>_<min conjuncts>_<max conjuncts>",
    "Sequence": "Sequence_<min length>_<max length>",
    "Eventually": "Eventually_<min length>_<max length>_<min conjuncts>_<max conjuncts>",
    "Adversarial": "Adversarial",
    "Super": "Super",
}
_EXAMPLES = ("Default", "Until_1_2_1_1", "Until_1_3_1_2", "Sequence_2_4", "Eventually_1_5_1_4", "Adversarial", "Super")
_JOINED = "X_OR_Y"
_NUMBERS = {"Default": 0, "Until": 4, "Sequence": 2, "Eventually": 4, "Adversarial": 0, "Super": 0}


def sample(name: str, propositions: Sequence[str], seed: int) -> Formula:
    """Draw one task of a family; equal arguments give equal tasks."""
    return make_sampler(name, propositions)(random.Random(seed))


def is_family(text: str, propositions: Sequence[str] = ()) -> bool:
    """Whether a text names a family of tasks, maybe misspelt (`Untl_1_2_1_1`): one word that is no proposition."""
    word = text.strip()
    if word in propositions or not word.isidentifier():
        return False
    return word.split("_")[0] in _NUMBERS or re.fullmatch(r"[A-Za-z]+(_\d+)+", word) is not None


def make_sampler(name: str, propositions: Sequence[str]) -> Sampler:
    """Return the sampler of a family.

    Families: `Default`, `Until_a_b_c_d`, `Sequence_a_b`, `Eventually_a_b_c_d`, `Adversarial`, `Super`, and any two of
    them as `X_OR_Y`. Both ends of a range can be drawn.

    Args:
        name: for example `Until_1_3_1_2`.
        propositions: what the tasks may speak of.

    Raises:
        UnknownTaskError: no such family; names the nearest valid one.
        LTLError: wrong parameters, or too few propositions.
    """
    if "_OR_" in name:
        first, second = name.split("_OR_", 1)
        left, right = make_sampler(first, propositions), make_sampler(second, propositions)
        return lambda rng: left(rng) | right(rng)
    family, *parameters = name.split("_")
    if family not in _NUMBERS:
        raise UnknownTaskError(f'unknown task family "{name}"; known: {_families()}{nearest(name, _EXAMPLES)}')
    if len(parameters) != _NUMBERS[family] or not all(re.fullmatch(r"[1-9]\d{0,3}", p) for p in parameters):
        example = next(e for e in _EXAMPLES if e.startswith(family))
        raise UnknownTaskError(
            f'"{name}" needs {_NUMBERS[family]} positive whole numbers: {_SHAPES[family]}; did you mean "{example}"?'
        )
    numbers = [int(p) for p in parameters]
    for low, high in zip(numbers[::2], numbers[1::2], strict=True):
        if low > high:
            raise LTLError(f'"{name}" asks for {low} to {high}, an empty range: {_SHAPES[family]}')
    names = list(propositions)
    _check_count(name, names, _needed(family, numbers))
    if family == "Super":
        members = [make_sampler(n, names) for n in ("Sequence_2_4", "Until_1_2_1_2", "Default", "Eventually_1_4_1_3")]
        return lambda rng: rng.choice(members)(rng)
    draw = _DRAW[family]
    return lambda rng: draw(rng, names, *numbers)


def _needed(family: str, numbers: list[int]) -> int:
    """Return how many propositions a family draws from at least."""
    if family == "Until":
        return 2 * numbers[1] * numbers[3]
    if family == "Eventually":
        # A disjunction takes two, and both have to differ from up to two of the position before.
        return 4 if numbers[1] > 1 else 2
    return {"Default": 4, "Sequence": 2 if numbers and numbers[1] > 1 else 1, "Adversarial": 3, "Super": 8}[family]


def _check_count(name: str, propositions: list[str], needed: int) -> None:
    if len(set(propositions)) < len(propositions):
        raise LTLError(f"a proposition is named twice: {', '.join(propositions)}")
    if len(propositions) < needed:
        given = ", ".join(propositions) or "none"
        raise LTLError(f'"{name}" needs at least {needed} propositions, got {len(propositions)}: {given}')


def _families() -> str:
    return ", ".join([*_SHAPES.values(), _JOINED])


def _default(rng: random.Random, names: list[str]) -> Formula:
    p = [prop(name) for name in rng.sample(names, 4)]
    return until(~p[0], p[1] & until(~p[2], p[3]))


def _until(
    rng: random.Random, names: list[str], min_levels: int, max_levels: int, min_conjuncts: int, max_conjuncts: int
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


def _sequence(rng: random.Random, names: list[str], min_length: int, max_length: int) -> Formula:
    chosen: list[str] = []
    for _ in range(rng.randint(min_length, max_length)):
        chosen.append(rng.choice([name for name in names if not chosen or name != chosen[-1]]))
    return _chain([prop(name) for name in chosen])


def _eventually(
    rng: random.Random, names: list[str], min_length: int, max_length: int, min_conjuncts: int, max_conjuncts: int
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


def _adversarial(rng: random.Random, names: list[str]) -> Formula:
    return _chain([prop(names[0]), prop(names[rng.choice((1, 2))])])


def _chain(goals: list[Formula]) -> Formula:
    """Return `F(g0 & F(g1 & ...))`."""
    task = eventually(goals[-1])
    for goal in reversed(goals[:-1]):
        task = eventually(goal & task)
    return task


def _conjoin(tasks: list[Formula]) -> Formula:
    """Return the conjunction with the newest task outermost, as LTL2Action builds it."""
    return reduce(lambda rest, newest: newest & rest, tasks)


_DRAW: dict[str, Callable[..., Formula]] = {
    "Default": _default,
    "Until": _until,
    "Sequence": _sequence,
    "Eventually": _eventually,
    "Adversarial": _adversarial,
}
