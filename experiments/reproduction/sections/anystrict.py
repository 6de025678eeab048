"""Agents whose training met no row of the tests, beside those that only never began with the tests themselves."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from experiments.reproduction.anytask import met, suites, water_chains
from experiments.reproduction.anytask.runs import STRICT
from experiments.reproduction.claims import differences
from experiments.reproduction.page import paragraph, table
from experiments.reproduction.sections import anyends
from experiments.reproduction.sections.anyaims import AIMS_HEADING, Aim, Bar
from experiments.reproduction.sections.anyaims import aims as aims_of
from experiments.reproduction.sections.anyfigures import SAMPLED, figures, over_seeds, over_tasks
from experiments.reproduction.stored import Stored

CHAINS = f"{len(water_chains.CHAINS)} chains"

TESTS: dict[str, dict[str, tuple[str, ...]]] = {
    "any-zones": {"z1 to z6": suites.ZONE_Z, "g1 to s8": suites.ZONE_HARD},
    "any-letters": {"letters_1 to 5": suites.LETTERS.tasks[:5]},
    "any-flat": {"flat_1 to 5": suites.FLAT.tasks},
    "any-water": {"phi_water": suites.WATER.tasks, CHAINS: suites.WATER_CHAINS.tasks},
}
"""By agent, the tests by what they are called."""

BARS = (
    Bar("success on chains over eight colours of which training met no row", suites.WATER_CHAINS.tasks, least=0.95),
)

NOT_MEASURED = """The aim of .95 on chains over WaterWorld's colours that are unseen in this sense is **not measured**.
What any-water comes to on its own family, above, is of formulas that are new under their own names, most of which its
training met under others."""

NOT_PLAYED = (
    "Not played: the test was no part of that run. Its training's rows were counted all the same, and its first seed "
    "played these formulas for the certificates below."
)

PAIRS = tuple((f"{name}{STRICT}", name) for name in TESTS)
"""An agent, and the one whose training kept out the tests themselves alone, by the same settings but for seeds."""

NOTE = f"""Every one of the {CHAINS} ends with `{water_chains.END}`, under some names.
Success of the sampled policy, means over seeds and tasks, both as samples. Rows met: of the tests' open rows,
how many were a row of any pool of the training, whatever their propositions are called. The strict agents draw from
the same families, of which every formula is left out that is, or can become, a row of a test; so they also learn from
fewer kinds of last steps, and what they lose, if anything, is not by the tests' novelty alone. Strict agents have seeds
from 88 on, the others their own, and some were trained on another kind of GPU. In LetterWorld and FlatWorld both
succeed nearly always, so that little can be seen there. Differences are of the mean over
those tests of a world that both agents played, in WaterWorld `phi_water` alone."""


def strict(runs: Mapping[str, Stored]) -> str:
    """Success on the tests, rows met, and the differences; '' until a strict agent is there."""
    rows, values = [], {}
    for first, second in PAIRS:
        if first not in runs:
            continue
        played = {name: figures(runs[name]) for name in (first, second) if name in runs}
        for name, of in played.items():
            shares = met.read(runs[name].path)
            for called, tasks in TESTS[second].items():
                success, worst = "not played", "-"
                if set(tasks) <= of.keys():
                    success = _success(of, tasks)
                    worst = f"{min(float(np.nanmin(of[task][SAMPLED]['success_rate'])) for task in tasks):.3f}"
                rows.append((name, called, met.rows_met(shares, tasks), success, worst, *anyends.shares(of, tasks)))
            asked = [task for tasks in TESTS[second].values() for task in tasks]
            known = [task for task in asked if all(task in each for each in played.values())]
            if known:
                means = np.mean([of[task][SAMPLED]["success_rate"] for task in known], axis=0)
                values[name] = dict(zip(runs[name].seeds, means.tolist(), strict=True))
    if not rows:
        return ""
    heading = ("agent", "tests", "rows met, up to names", "success", "worst seed and task")
    shown = table((*heading, "violation", "ended by env", "time-out"), rows)
    gaps = differences({name: runs[name] for name in values}, list(PAIRS), values, "success, mean of these tests")
    aim = table(AIMS_HEADING, aims(runs)) or NOT_MEASURED
    unplayed = NOT_PLAYED if any("not played" in row for row in rows) else ""
    return "\n\n".join(part for part in (shown, unplayed, aim, gaps, paragraph(NOTE)) if part)


def _success(of: Mapping[str, Any], tasks: Sequence[str]) -> str:
    """Over seeds and tasks; of a single task over seeds."""
    if len(tasks) == 1:
        return over_seeds(of[tasks[0]][SAMPLED]["success_rate"], "success_rate").text()
    return over_tasks(of, tasks, SAMPLED, "success_rate").text()


def aims(runs: Mapping[str, Stored]) -> list[Aim]:
    """What becomes of the aim on chains of which training met no row, which only the strict agent can reach."""
    water = runs.get(f"any-water{STRICT}")
    return [] if water is None else aims_of(figures(water), BARS)
