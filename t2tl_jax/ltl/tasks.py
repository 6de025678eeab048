"""The tasks of the paper, by name."""

from t2tl_jax.ltl.errors import UnknownTaskError, nearest
from t2tl_jax.ltl.formula import Formula
from t2tl_jax.ltl.parser import parse

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


def named_task(name: str) -> Formula:
    """Return a task of the paper.

    Raises:
        UnknownTaskError: lists the known names and the nearest.
    """
    if name not in PAPER_TASKS:
        raise UnknownTaskError(f'unknown task "{name}"; known: {", ".join(PAPER_TASKS)}{nearest(name, PAPER_TASKS)}')
    return parse(PAPER_TASKS[name])


def resolve_task(text: str) -> Formula:
    """Return the task with this name, or else the formula with this text.

    A text that begins like a task name (`phi_...`) and is one word is taken for a misspelt name.
    """
    word = text.strip()
    if word in PAPER_TASKS or (word.startswith("phi_") and word.isidentifier()):
        return named_task(word)
    return parse(text)
