"""Tasks by name: the formulas of the paper and of benchmarks, and the reward machines of the water benchmark."""

import re
from collections.abc import Iterable
from importlib.resources import files
from pathlib import Path

from t2tl_jax.ltl.benchmark_tasks import BENCHMARK_TASKS
from t2tl_jax.ltl.errors import LTLError, UnknownTaskError, check_text, nearest
from t2tl_jax.ltl.formula import Formula
from t2tl_jax.ltl.parser import parse
from t2tl_jax.ltl.reward_machine import RewardMachine, parse_machine

ZONE_PROPOSITIONS = ("Black", "White", "Red", "Yellow")
"""The zone environment's colours, in its order."""

WATER_PROPOSITIONS = ("Yellow", "Purple", "Magenta", "Orange", "Gray", "Pink", "Green", "Blue")
"""WaterWorld's colours: the goals of `phi_water` in their order, then its obstacles."""


def avoiding_chain(goals: tuple[str, ...], obstacles: tuple[str, ...]) -> str:
    """Return the text of "reach the goals in order, and touch no obstacle before the last": nested untils."""
    avoid = " & ".join(f"!{name}" for name in obstacles)
    text = f"({avoid}) U {goals[-1]}"
    for goal in reversed(goals[:-1]):
        text = f"({avoid}) U ({goal} & ({text}))"
    return text


def _water(num_goals: int, num_obstacles: int) -> str:
    """The paper fixes the colours for 5 goals and 3 obstacles only; a sixth goal is Blue, which is then no obstacle."""
    goals = (*WATER_PROPOSITIONS[:5], "Blue")[:num_goals]
    return avoiding_chain(goals, WATER_PROPOSITIONS[5 : 5 + num_obstacles])


PAPER_TASKS: dict[str, str] = {
    "phi_zone": "F(Red & F(Black & F Yellow))",
    "phi_zone_prime": "!Red U (Black & (!Yellow U White))",
    "phi_safe": avoiding_chain(("Black", "White"), ("Red", "Yellow")),
    "phi_water": _water(5, 3),
    # Sub-goals n and obstacles m of the paper's tables; six goals and three obstacles would need nine colours.
    **{f"phi_water_{n}_{m}": _water(n, m) for n in (4, 5, 6) for m in (1, 2, 3) if n + m <= 8},
}
"""Formula texts. `phi_zone*` and `phi_safe` speak of `ZONE_PROPOSITIONS`, `phi_water*` of `WATER_PROPOSITIONS`."""


NAMED_TASKS: dict[str, str] = PAPER_TASKS | BENCHMARK_TASKS
"""Every formula with a name."""


def named_task(name: str) -> Formula:
    """Return a task of `NAMED_TASKS`.

    Raises:
        UnknownTaskError: lists the known names and the nearest.
    """
    if name not in NAMED_TASKS:
        raise UnknownTaskError(f'unknown task "{name}"; known: {", ".join(NAMED_TASKS)}{nearest(name, NAMED_TASKS)}')
    return parse(NAMED_TASKS[name])


def resolve_task(text: str) -> Formula:
    """Return the task with this name, or else the formula with this text.

    A text that begins like a task name (`phi_...`) and is one word is taken for a misspelt name.

    Raises:
        UnknownTaskError: for a misspelt name.
        LTLError: for reward machines, and as the formula deserves.
    """
    check_text("a task", text)
    word = text.strip()
    if word in REWARD_MACHINES:
        raise LTLError(f"{word} is a reward machine, not a formula; compile_named takes both")
    if word in NAMED_TASKS or (word.startswith("phi_") and word.isidentifier()):
        return named_task(word)
    return parse(text)


def resolve_tasks(text: str | Iterable[str]) -> dict[str, Formula]:
    """Return the tasks of a list such as `z1,z2,F(Blue & F Green)`, in its order, by what they are called there.

    Args:
        text: names and formulas, apart by commas, or one by one.

    Raises:
        LTLError: for an empty list, an unknown name or a malformed formula.
    """
    if not isinstance(text, Iterable):
        raise LTLError(f"tasks are a list of names and formulas, got {text!r:.100}")
    given = text.split(",") if isinstance(text, str) else list(text)
    for word in given:
        check_text("a task", word)
    words = [word.strip() for word in given if word.strip()]
    if not words:
        raise LTLError("the list of tasks is empty; give names or formulas, apart by commas, such as z1,z2")
    return {word: _task_of_list(word) for word in words}


def _task_of_list(word: str) -> Formula:
    """A word that is neither a name nor a formula of more than one proposition is a misspelt name."""
    return named_task(word) if re.fullmatch(r"[a-z]+_?\d+", word) else resolve_task(word)


def _reward_machines() -> dict[str, tuple[str, ...]]:
    water = [f"t{number}" for number in range(1, 11)]
    published = [*water[:8], "t9_published", "t10_published"]
    single = {f"rm_{name}": (name,) for name in dict.fromkeys([*water, *published, "phi_water"])}
    return single | {"rm_water": tuple(water), "rm_water_published": tuple(published)}


REWARD_MACHINES: dict[str, tuple[str, ...]] = _reward_machines()
"""Per task name, the files in `reward_machines/` (without suffix) whose machines it stands for, in order.

`rm_t1` to `rm_t10` are the ten tasks of the water benchmark (Toro Icarte et al., JAIR 2022) over propositions a to f,
`rm_water` is all of them. In the published program t9 and t10 also pay 1 for a wrong touch in their last state:
`rm_t9_published`, `rm_t10_published`, `rm_water_published`. `rm_phi_water` is `phi_water` as a machine.
"""


def named_machines(name: str) -> tuple[RewardMachine, ...]:
    """Return the reward machines that a name of `REWARD_MACHINES` stands for.

    Raises:
        UnknownTaskError: lists the known names and the nearest.
    """
    if name not in REWARD_MACHINES:
        raise UnknownTaskError(
            f'unknown reward machine "{name}"; known: {", ".join(REWARD_MACHINES)}{nearest(name, REWARD_MACHINES)}'
        )
    folder = files("t2tl_jax.ltl") / "reward_machines"
    return tuple(
        parse_machine((folder / f"{stem}.rm").read_text(encoding="utf-8"), stem) for stem in REWARD_MACHINES[name]
    )


def read_machine(path: str | Path) -> RewardMachine:
    """Read a file of a reward machine; the machine's name is the file's, without suffix.

    Raises:
        UnknownTaskError: the file cannot be read as text.
        MachineSyntaxError: malformed text.
    """
    try:
        return parse_machine(Path(path).read_text(encoding="utf-8"), Path(path).stem)
    except OSError as error:
        raise UnknownTaskError(f"cannot read the reward machine {path}: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise UnknownTaskError(f"cannot read the reward machine {path}: {error}") from None


def is_machine_file(text: str) -> bool:
    """Whether a task is named by the path of a reward machine's file."""
    return text.strip().endswith(".rm")


def resolve(text: str) -> Formula | tuple[RewardMachine, ...]:
    """Return the formula or the reward machines that a text stands for.

    Args:
        text: a name of `NAMED_TASKS` or `REWARD_MACHINES`, a path that ends in `.rm`, or a formula. One word that
            begins with `phi_` or `rm_` is taken for a name.

    Raises:
        UnknownTaskError: an unknown name, or a file that cannot be read.
        LTLError: as the formula or the machine deserves.
    """
    check_text("a task", text)
    word = text.strip()
    if is_machine_file(word):
        return (read_machine(word),)
    if word.startswith("rm_") and word.isidentifier():
        return named_machines(word)
    return resolve_task(word)
