"""The tables of steps: how long an episode takes until its task is carried out, in worlds of growing difficulty."""

from collections.abc import Mapping

from experiments.paper import step_tables
from experiments.reproduction import runs as named
from experiments.reproduction.cells import cost_line, share, text
from experiments.reproduction.claims import differences
from experiments.reproduction.page import table
from experiments.reproduction.sections.settings import what_differs
from experiments.reproduction.stored import Stored
from t2tl_jax.evaluation.comparisons import Pairs

LIMIT = max(step_tables.LIMITS)
"""The time limit whose steps are compared: published means lie above the other one."""

ORDER = (("t1tl", "gnn"), ("gnn", "rm"), ("t1tl", "rm"))
"""Who takes fewer steps than whom in every published cell."""

NOTE = f"""Final parameters, sampled policy. Steps to complete are those of every episode, where one that does not
succeed, whether it violates the task or runs out of time, counts as long as the limit: an average over successes alone
would favour who succeeds on easy maps only. The order is that of these steps within {LIMIT:,}, fewer being better;
steps on success stand beside them. Which limit and which episodes the published averages have is not published. RM has
16 numbers here; how many the published one has in these tables is not known."""


def steps(runs: Mapping[str, Stored]) -> str:
    """Steps within each limit beside the rate of success, and the published order in every world of every table."""
    parts = []
    for title, cells, same_maps in (
        ("Sub-goals", step_tables.BY_GOALS, False),
        ("Obstacles", step_tables.BY_OBSTACLES, False),
        ("Size of the obstacles", step_tables.BY_SIZE, True),
    ):
        rows = [_row(runs, cell, same_maps, method) for cell in cells for method in named.STEP_METHODS]
        heading = ["world", "method"]
        for limit in step_tables.LIMITS:
            heading += [f"steps to complete, {limit:,}", f"steps on success, {limit:,}", f"success, {limit:,}"]
        if any(rows):
            pairs = claims(cells, same_maps)
            taken = {name: completion(runs[name], LIMIT) for pair in pairs for name in pair if name in runs}
            parts += [
                f"**{title}**",
                table([*heading, "published"], [row for row in rows if row]),
                differences(runs, pairs, taken, f"steps to complete, {LIMIT:,}", pairs, less=True),
            ]
    return "\n\n".join(part for part in [NOTE, *parts, _what_differs(runs), cost_line(runs)] if part) if parts else ""


def _what_differs(runs: Mapping[str, Stored]) -> str:
    """Between the methods, in the first world that is there: it is the same in all."""
    for cell in step_tables.BY_GOALS:
        labels = {named.step_name(cell, False, method): method for method in named.STEP_METHODS}
        if labels.keys() <= runs.keys():
            return what_differs(runs, labels, "steps")
    return ""


def completion(run: Stored, limit: int) -> dict[int, float]:
    """Mean steps of each seed until the task is carried out, `limit` for an episode in which it is not."""
    rates = run.by_seed("success_rate", limit=limit)
    on_success = run.by_seed("success_length", limit=limit)  # lacks seeds that never succeed
    return {seed: rate * on_success.get(seed, limit) + (1 - rate) * limit for seed, rate in rates.items()}


_MAPS = ", on maps of 2.5x"
"""Of worlds that differ in the size of the obstacles alone: their maps have room for the largest."""


def claims(cells: tuple[step_tables.Cell, ...], same_maps: bool) -> Pairs:
    """The published order in each of these worlds."""
    return [
        (named.step_name(cell, same_maps, fewer), named.step_name(cell, same_maps, more))
        for cell in cells
        for fewer, more in ORDER
    ]


def _row(runs: Mapping[str, Stored], cell: step_tables.Cell, same_maps: bool, method: str) -> list[str]:
    run = runs.get(named.step_name(cell, same_maps, method))
    if run is None:
        return []
    mean, spread = cell.published[method]
    row = [f"{cell.goals} goals, {cell.obstacles} obstacles, {cell.size:g}x{_MAPS if same_maps else ''}", method]
    for limit in step_tables.LIMITS:
        row += [
            text(completion(run, limit), 1),
            text(run.by_seed("success_length", limit=limit), 1),
            share(run.by_seed("success_rate", limit=limit)),
        ]
    return [*row, f"{mean:.1f} ± {spread:.1f}"]
