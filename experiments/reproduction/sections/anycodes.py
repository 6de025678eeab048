"""Which code of a task generalises: agents of the open ZoneEnv with different codes, at levels of formulas."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from experiments.reproduction.anytask import met, suites
from experiments.reproduction.anytask.runs import LEARNED
from experiments.reproduction.cells import COST, cost, share
from experiments.reproduction.claims import differences
from experiments.reproduction.page import table
from experiments.reproduction.sections.anytask import SAMPLED, Bar, figures, over_tasks, own_family, state_of, verdicts
from experiments.reproduction.stored import Stored

PRETRAINED = "any-pretraining-"
"""What the names of runs begin with that train codes in the world of a single state."""

BROAD = "any-zones-broad-"
"""What the names of agents begin with that were trained on the broad family, all in one way but for their codes."""

WELL_READ = 0.99
"""A formula that a code reads alone with this success is read."""

READERS = {f"{BROAD}{code}": f"{PRETRAINED}broad-{code}" for code in ("transformer", "gru", "rgcn", "automaton")}
"""Agents whose codes were learned, and the runs that trained these, seed by seed."""

FROM_TABLE = f"{BROAD}automaton"
"""The one of them whose code is made of the table's transitions; the others know of the task by its formula alone."""

AGAINST_TABLE = [(f"{BROAD}lookahead", f"{BROAD}{code}") for code in LEARNED]
"""A code that is read off the table, and those that were learned."""

LEVELS: dict[str, tuple[str, ...]] = {
    "z1 to z6": suites.ZONE_Z,
    "deeper": suites.ZONE_DEEP,
    "wider": suites.ZONE_WIDE,
    "new combinations": suites.ZONE_NEW,
    "harder": suites.ZONE_HARD,
    **{f"{suite.name}": tuple(f"{task} ({suite.name})" for task in suites.SIX) for suite in suites.MORE_COLOURS},
    "texts exchanged": tuple(f"{task} ({suites.EXCHANGED.name})" for task in suites.EXCHANGED.tasks),
}
"""How far from the training: tasks of each level."""


def levels(runs: Mapping[str, Stored]) -> str:
    """Success of every code at every level, what was read before, and what each cost: agents that were trained on the
    broad family, then those before them."""
    agents = {name: run for name, run in runs.items() if not name.startswith(PRETRAINED)}
    broad = {name: run for name, run in agents.items() if name.startswith(BROAD)}
    others = {name: run for name, run in agents.items() if name not in broad}
    costs = [(_label(name), str(len(run.seeds)), *cost(run)) for name, run in agents.items()]
    parts = (
        _levels_table(broad),
        BROAD_SAYS if broad else "",
        against_table(broad),
        text_alone(runs),
        _levels_table(others),
        OTHERS_SAY if others else "",
        read_alone(runs),
        table(("code", "seeds", *COST), costs),
    )
    return "\n\n".join(part for part in parts if part)


BROAD_SAYS = (
    "Success of the sampled policy. Intervals of levels are over seeds and tasks, both as samples. All of these "
    "agents have one family, network, number of frames, seeds and maps, and differ in their codes; merged ones in "
    "what reads the lidars too. Codes with parameters are trained before, the Transformer's for more frames than the "
    "others' (below), and frozen. Gated: one linear layer reads weights of the colours off the code, and lidars are "
    "summed by them. Merged: they are summed by what the colours are to the task, which the code says in so many "
    "numbers. names is a random vector for every text, which tells rows apart and no more, as one-hot codes do in a "
    "single table; nothing tells nothing; where texts are exchanged, the open rows of a task show each other's. What "
    "codes with parameters met in their pre-training is told below. The family has chains, conjunctions and "
    "disjunctions of them, LTL2Action's, and, two fifths, formulas by a small grammar (`t2tl_jax/ltl/grammar.py`), "
    "which was written with the shapes of the tests in view: a condition such as that of z6 and of long is one of its "
    "rules. The tests themselves are kept out of all pools, under whatever names of propositions. Family, offers, "
    "gates and schedules were chosen on seeds 100 to 102 in two rounds, of 12 pre-trainings and 18 agents, by six "
    "formulas that are no tests but were made like z1 to z6, and were kept out of the pools of the second round; "
    "results of the agents further below, and of some between these two tables that are no longer kept and stayed "
    "below the aim, as the Transformer and the GRU further below do, had been seen before. These trials are not "
    "stored. The Transformer's schedule was not tried before as it is."
)

OTHERS_SAY = (
    "The agent above (any-zones), and codes as they were before: a narrower family, the observation as it is (flat) or "
    "merged, fewer frames, other seeds, and pre-training in which every proposition can be chosen at any step. What of "
    "all this makes the difference to the agents of the broad family is not taken apart here. Codes compare where "
    "state, budget, layers, step size and family are the same, so the agent above stands by itself."
)


def _levels_table(runs: Mapping[str, Stored]) -> str:
    rows = []
    for name, run in runs.items():
        of, cells = figures(run), []
        for tasks in LEVELS.values():
            there = set(tasks) <= of.keys()
            cells.append(over_tasks(of, tasks, SAMPLED, "success_rate").text(2) if there else "-")
        rows.append((_label(name), state_of(run), share(run.end("success_rate")), share(own_family(run)), *cells))
    return table(("code", "state", "training", "same family", *LEVELS), rows)


def _label(name: str) -> str:
    return name.removeprefix("any-zones-") if name != "any-zones" else "the agent above"


def against_table(runs: Mapping[str, Stored]) -> str:
    """The code that is read off the table against those that were learned: on z1 to z6, and on harder formulas."""
    found = []
    for called, tasks in (("z1 to z6", suites.ZONE_Z), ("g1 to s8", suites.ZONE_HARD)):
        values = {name: _of_each_seed(run, tasks) for name, run in runs.items()}
        found.append(differences(runs, AGAINST_TABLE, values, f"success, mean of {called}"))
    return "\n\n".join(part for part in found if part)


def _of_each_seed(run: Stored, tasks: Sequence[str]) -> dict[int, float]:
    """Success of each seed, the mean of some tasks; nothing of a run that was not tested on them."""
    of = figures(run)
    if not set(tasks) <= of.keys():
        return {}
    means = np.mean([of[task][SAMPLED]["success_rate"] for task in tasks], axis=0)
    return dict(zip(run.seeds, means.tolist(), strict=True))


def read_alone(runs: Mapping[str, Stored]) -> str:
    """What the codes that were trained before can be read for, where nothing is to be done but to read."""
    rows = []
    for name, run in runs.items():
        if not name.startswith(PRETRAINED):
            continue
        of, shares = figures(run), met.read(run.path)
        cells = [
            over_tasks(of, tasks, SAMPLED, "success_rate").text(2) if set(tasks) <= of.keys() else "not measured yet"
            for tasks in (suites.ZONE_Z, suites.ZONE_HARD)
        ]
        met_of = [_rows_met(shares, tasks) for tasks in (suites.ZONE_Z, suites.ZONE_HARD, suites.ZONE_WIDE)]
        kept_out = "all tests" if run.config.pool.unseen else "nothing"
        code, pool = name.removeprefix(PRETRAINED), run.config.pool
        drawn = f"{-(-run.config.iterations // pool.period) * pool.size:,}"
        rows.append((code, drawn, share(run.end("success_rate")), *cells, kept_out, *met_of))
    heading = (
        *("code", "places in its pools", "success in its pre-training"),
        *("z1 to z6, read alone", "harder, read alone", "kept out of its pools"),
        *("rows of z1 to z6 met, up to names", "of harder", "of wider"),
    )
    said = (
        "Codes are learned before, in the world of a single state, where an action is a proposition and nothing is to "
        "be done but to read."
    )
    if any(kept_out == "nothing" for *_, kept_out, _, _, _ in rows):
        said += (
            " Where nothing was kept out of that, the codes of whole test formulas were learned there, up to names, "
            "and their lines above do not tell of unseen formulas as the others do."
        )
    if any("broad-" in code for code, *_ in rows):
        said += (
            " Codes of the broad family learned with two propositions offered at a step, or none taken, so that they "
            "also have to tell what to leave, and read alone likewise; the others could choose any."
        )
    return "\n\n".join((said, table(heading, rows))) if rows else ""


def text_alone(runs: Mapping[str, Stored]) -> str:
    """What agents come to whose codes were learned, by formula, beside what the codes come to read alone."""
    asked = (*suites.ZONE_Z, *suites.ZONE_HARD)
    rows: list[tuple[str, ...]] = []
    renamed: dict[str, Any] = {}
    bars, families, acting = [], [], []
    for agent, reader in READERS.items():
        if not {agent, reader} <= runs.keys():
            continue
        done, read = figures(runs[agent]), figures(runs[reader])
        if not set(asked) <= done.keys() & read.keys() or runs[agent].seeds != runs[reader].seeds:
            continue
        name = agent.removeprefix(BROAD)
        alone, beside = (np.stack([of[task][SAMPLED]["success_rate"] for task in asked]) for of in (read, done))
        steps = (f"{np.nanmean(read[task][SAMPLED]['success_length']):.1f}" for task in asked)
        rows += [(name, "read alone", *_worst(alone)), (name, "read alone, steps", *steps)]
        rows.append((name, "beside the robot", *_worst(beside)))
        tasks = tuple(f"{task} ({name})" for task in suites.ZONE_Z)
        renamed |= {of: done[task] for of, task in zip(tasks, suites.ZONE_Z, strict=True)}
        if agent != FROM_TABLE:
            bars.append(Bar(f"success, mean of z1 to z6, by its formula alone: {name}", tasks, least=0.95))
        if (well := alone >= WELL_READ).any():
            acting.append(f"{name} {beside[well].mean():.3f} ({well.sum()} of {well.size})")
        if own := own_family(runs[agent]):
            trained = np.mean(list(runs[agent].end("success_rate").values()))
            families.append(f"{name} {trained:.3f}, {np.mean(list(own.values())):.3f}")
    if not rows:
        return ""
    explained = (
        "Agents whose codes were learned, from the formula alone but for the automaton's: what the codes read where "
        "nothing is to be done but to read, and what the agents carry out beside the robot; means over seeds, and the "
        "worst seed. To be carried out alone is little: there a detour costs nothing but steps, so that a code which "
        "leads astray at first also comes to success. More steps than the automaton's code takes are a sign of that; "
        "what is missed beside the robot may be lost in reading or in acting."
    )
    if acting:
        explained += (
            f" Mean success beside the robot of those formulas and seeds that are read alone in {WELL_READ} and more, "
            f"and how many they are: {'; '.join(acting)}."
        )
    if families:
        explained += (
            f" Success in training, and on formulas of the same family that they had not met: {'; '.join(families)}."
        )
    return "\n\n".join((explained, table(("code", "where", *asked), rows), verdicts(renamed, bars)))


def _worst(values: np.ndarray) -> tuple[str, ...]:
    """A cell for each formula, of values [formulas, seeds]: the mean, and the worst seed."""
    return tuple(f"{of.mean():.2f} ({of.min():.2f})" for of in values)


def _rows_met(shares: Mapping[str, Mapping[str, str]], tasks: Sequence[str]) -> str:
    """Of all open rows of some tasks together, how many a training met up to renaming of propositions."""
    found = [shares["renamed"][task].split("/") for task in tasks if task in shares["renamed"]]
    return f"{sum(int(met) for met, _ in found)}/{sum(int(of) for _, of in found)}" if found else "-"
