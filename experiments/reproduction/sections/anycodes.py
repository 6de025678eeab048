"""Which code of a task generalises: agents of the open ZoneEnv with different codes, at levels of formulas."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from experiments.reproduction.anytask import met, suites
from experiments.reproduction.anytask.runs import FIFTH_SEED, HEADLINE_SEEDS, LEARNED, SOLVED_RATES, TEXTS
from experiments.reproduction.cells import COST, cost, share
from experiments.reproduction.claims import differences
from experiments.reproduction.page import table
from experiments.reproduction.sections import anyends, anyunread
from experiments.reproduction.sections.anytask import (
    OWN,
    SAMPLED,
    Bar,
    figures,
    over_tasks,
    own_family,
    state_of,
    verdicts,
)
from experiments.reproduction.stored import Stored
from t2tl_jax.agents.dp_config import DPConfig

PRETRAINED = "any-pretraining-"
"""What the names of runs begin with that train codes in the world of a single state."""

BROAD = "any-zones-broad-"
"""What the names of agents begin with that were trained on the broad family, all in one way but for their codes."""

SOLVED = "any-zones-solved-"
"""What the names of agents begin with that are as those, but for other seeds and codes that learned by dynamic
programming."""

ALMOST_ALL = 0.9
"""Of a level with this share of its rows met, nearly all were met."""

WELL_READ = 0.99
"""A formula that a code reads alone with this success is read."""

READERS = {
    **{f"{BROAD}{code}": f"{PRETRAINED}broad-{code}" for code in ("transformer", "gru", "rgcn", "automaton")},
    **{f"{SOLVED}{code}": f"{PRETRAINED}solved-{code}" for code in TEXTS},
}
"""Agents whose codes were learned, and the runs that trained these, seed by seed."""

FROM_TABLE = f"{BROAD}automaton"
"""The one of them whose code is made of the table's transitions; the others know of the task by its formula alone."""

AGAINST_TABLE = [(f"{BROAD}lookahead", f"{BROAD}{code}") for code in LEARNED]
"""A code that is read off the table, and those that were learned."""

AGAINST_PLAYED = [
    pair for code in TEXTS for pair in ((f"{SOLVED}{code}", f"{BROAD}{code}"), (f"{BROAD}lookahead", f"{SOLVED}{code}"))
]
"""A code that learned by dynamic programming against the same reader that learned by playing, and against the table."""

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
    solved = {name: run for name, run in agents.items() if name.startswith(SOLVED)}
    others = {name: run for name, run in agents.items() if name not in broad | solved}
    costs = [(_label(name), str(len(run.seeds)), *cost(run)) for name, run in agents.items()]
    parts = (
        _levels_table(broad, solved),
        _ends_table({**broad, **solved}),
        anyunread.say({_label(name): run for name, run in (broad | solved | others).items()}, LEVELS),
        solved_say(solved),
        rows_met_say(broad | solved),
        BROAD_SAYS if broad else "",
        compared(broad, AGAINST_TABLE),
        compared(broad | solved, AGAINST_PLAYED) if solved else "",
        text_alone(runs),
        _levels_table(others),
        _ends_table(others),
        rows_met_say(others),
        OTHERS_SAY if others else "",
        read_alone(runs),
        table(("code", "seeds", *COST), costs),
    )
    return "\n\n".join(part for part in parts if part)


BROAD_SAYS = (
    "Success of the sampled policy. Intervals of levels are over seeds and tasks, both as samples. The broad agents "
    "have one family, network, number of frames, seeds and maps, and differ in their codes; merged ones in "
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


def solved_say(runs: Mapping[str, Stored]) -> str:
    """What is to be known of agents whose codes learned by dynamic programming; '' where there are none."""
    if not runs:
        return ""
    rates = ", ".join(f"{rate:g} of {code}" for code, rate in SOLVED_RATES.items())
    return (
        "By dynamic programming: agents with the same family, network and number of frames, on other seeds (beginning "
        f"with {FIFTH_SEED}), so that they are not paired with the others. Their codes learned in the world of a "
        "single state too, but from its solution: nothing was played there, and a frame is a row that a gradient step "
        f"read. The learning rates ({rates}) were chosen on seeds 100 to 102. R-GCN and automaton were not trained "
        "so: these lines do not tell what they would come to. Against the same readers that learned by playing, "
        "the learner, its step size, the number of formulas (below) and the seeds all differ, and what of it makes the "
        "difference is not taken apart; the share of the tests' rows that was met is the same. The two tables of "
        "differences of these agents are corrected each by itself, and not for those of the broad agents. An interval "
        "is over seeds as they are spread, a p by exchanging them, so that one outlier widens the first alone."
    )


def _levels_table(runs: Mapping[str, Stored], solved: Mapping[str, Stored] | None = None) -> str:
    """A line for each code, those that learned by dynamic programming apart, and then what was met of each level."""
    rows = [_levels_row(name, run) for name, run in runs.items()]
    if solved:
        seeds = f"seeds {FIFTH_SEED} to {FIFTH_SEED + int(HEADLINE_SEEDS) - 1}"
        rows.append((f"**codes by dynamic programming, {seeds}**", *("" for _ in (*LEVELS, 0, 0, 0))))
        rows += [_levels_row(name, run) for name, run in solved.items()]
    groups = _rows_of_levels({**runs, **(solved or {})})
    most = max((len(names) for names, _ in groups), default=0)
    for names, shares in groups:
        whom = "all" if len(groups) == 1 else "others" if len(names) == most > 1 else ", ".join(map(_label, names))
        cells = [_as_share(shares.get(level)) for level in (OWN, *LEVELS)]
        rows.append((f"**rows met, up to names: {whom}**", "", "", *cells))
    return table(("code", "state", "training", "same family", *LEVELS), rows)


def _levels_row(name: str, run: Stored) -> tuple[str, ...]:
    of, cells = figures(run), []
    for level, tasks in LEVELS.items():
        there = set(tasks) <= of.keys()
        cells.append(over_tasks(of, tasks, SAMPLED, "success_rate").text(2) if there else anyunread.cell(run, level))
    return (_label(name), state_of(run), share(run.end("success_rate")), share(own_family(run)), *cells)


def _ends_table(runs: Mapping[str, Stored]) -> str:
    """How the other episodes of the same codes end, at the same levels."""
    rows = []
    for name, run in runs.items():
        of = figures(run)
        cells = [anyends.cell(of, tasks, anyunread.cell(run, level)) for level, tasks in LEVELS.items()]
        rows.append((_label(name), anyends.of_training(run), anyends.cell(of, (OWN,)), *cells))
    return table((f"code: {anyends.CALLED}", "training", "same family", *LEVELS), rows)


Levels = dict[str, tuple[int, int]]
"""By level, how many rows were met, and of how many."""


def _rows_of_levels(runs: Mapping[str, Stored]) -> list[tuple[list[str], Levels]]:
    """What trainings met of every level, up to renaming, and which of them met so much; of trainings with one family
    and one number of pools that is the same, be they tested on all levels or not."""
    found: list[tuple[list[str], Levels]] = []
    for name, run in runs.items():
        shares = met.read(run.path)
        each = {OWN: (OWN,), **LEVELS}
        own = {level: counted for level, tasks in each.items() if (counted := _counted(shares, tasks))}
        if not own:
            continue
        for names, known in found:
            if all(known[level] == own[level] for level in known.keys() & own.keys()):
                names.append(name)
                known |= own
                break
        else:
            found.append(([name], own))
    return found


def rows_met_say(runs: Mapping[str, Stored]) -> str:
    """Of which levels nearly all rows were met, and what the others had of them; '' where there is no such level."""
    said = []
    for names, known in _rows_of_levels(runs):
        counts = {level: counted for level, counted in known.items() if level != OWN}
        nearly = [level for level, (some, rows) in counts.items() if some >= ALMOST_ALL * rows]
        rest = sorted((level for level in counts if level not in nearly), key=lambda level: _part(counts[level]))
        if not nearly:
            continue
        whom = "these agents" if len(names) == len(runs) else ", ".join(map(_label, names))
        of_these, of_those = (
            ", ".join(f"{level} ({_as_share(counts[level])})" for level in levels) for levels in (nearly, rest)
        )
        said.append(
            f"The training of {whom} had met nearly every open row of {of_these}: success there is hardly "
            f"generalisation to new rows. Of the other levels, fewest first: {of_those}. Rows are counted up to "
            "renaming of propositions, and whole test formulas were kept out."
        )
    return " ".join(said)


def _part(counted: tuple[int, int]) -> float:
    return counted[0] / max(counted[1], 1)


def _as_share(counted: tuple[int, int] | None) -> str:
    return "-" if counted is None else f"{counted[0]}/{counted[1]}"


def _label(name: str) -> str:
    return name.removeprefix("any-zones-") if name != "any-zones" else "the agent above"


def compared(runs: Mapping[str, Stored], pairs: Sequence[tuple[str, str]]) -> str:
    """Agents with one code against those with another one: on z1 to z6, and on harder formulas."""
    found = []
    for called, tasks in (("z1 to z6", suites.ZONE_Z), ("g1 to s8", suites.ZONE_HARD)):
        values = {name: _of_each_seed(run, tasks) for name, run in runs.items()}
        found.append(differences(runs, pairs, values, f"success, mean of {called}"))
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
        ends = [anyends.cell(of, tasks) for tasks in (suites.ZONE_Z, suites.ZONE_HARD)]
        met_of = [rows_met(shares, tasks) for tasks in (suites.ZONE_Z, suites.ZONE_HARD, suites.ZONE_WIDE)]
        kept_out = "all tests" if run.config.pool.unseen else "nothing"
        code, pool = name.removeprefix(PRETRAINED), run.config.pool
        drawn = f"{-(-run.config.iterations // pool.period) * pool.size:,}"
        different = shares["rows"].get("exactly")
        counted = "-" if different is None else f"{different:,}"
        rows.append((code, drawn, counted, _learned(run), *cells, *ends, kept_out, *met_of))
    heading = (
        *("code", "places in its pools", "different open rows there", "success in its pre-training"),
        *("z1 to z6, read alone", "harder, read alone"),
        *(f"{level}: {anyends.CALLED}" for level in ("z1 to z6", "harder")),
        "kept out of its pools",
        *("rows of z1 to z6 met, up to names", "of harder", "of wider"),
    )
    said = (
        "Codes are learned before, in the world of a single state, where an action is a proposition and nothing is to "
        "be done but to read."
    )
    if any(kept_out == "nothing" for *_, kept_out, _, _, _ in rows):
        said += (
            " Where nothing was kept out of that, the codes of whole test formulas were learned there, up to names, "
            "and their lines above do not tell of formulas that are new to them as the others do."
        )
    if any(_is_solved(run) for name, run in runs.items() if name.startswith(PRETRAINED)):
        said += (
            " By dynamic programming there are no episodes, and so no success: agreement is the share of rows, those "
            "read over the last part of the training, in which the policy's best choice is one of the best of the "
            "solution."
        )
    if any(code.startswith(("broad-", "solved-")) for code, *_ in rows):
        said += (
            " Codes of the broad family (broad and solved) learned with two propositions offered at a step, or none "
            "taken, so that they also have to tell what to leave, and read alone likewise; the others could choose any."
        )
    return "\n\n".join((said, table(heading, rows))) if rows else ""


def _is_solved(run: Stored) -> bool:
    """Whether it learned by dynamic programming, without episodes."""
    return isinstance(run.config.learner, DPConfig)


def _learned(run: Stored) -> str:
    """What a pre-training came to at its end."""
    if not _is_solved(run):
        return share(run.end("success_rate"))
    if "agreement" not in run.metrics:
        return "-"
    rounded = {seed: round(value, 6) for seed, value in run.end("agreement").items()}  # a sum can come to a hair over 1
    return f"agreement {share(rounded)}"


def text_alone(runs: Mapping[str, Stored]) -> str:
    """What agents come to whose codes were learned, by formula, beside what the codes come to read alone."""
    asked = (*suites.ZONE_Z, *suites.ZONE_HARD)
    rows: list[tuple[str, ...]] = []
    ends: list[tuple[str, ...]] = []
    shares: dict[str, dict[str, Mapping[str, str]]] = {"code": {}, "agent": {}}
    renamed: dict[str, Any] = {}
    bars, families, acting = [], [], []
    for agent, reader in READERS.items():
        if not {agent, reader} <= runs.keys():
            continue
        done, read = figures(runs[agent]), figures(runs[reader])
        if not set(asked) <= done.keys() & read.keys() or runs[agent].seeds != runs[reader].seeds:
            continue
        name = _label(agent.replace(BROAD, "any-zones-"))
        alone, beside = (np.stack([of[task][SAMPLED]["success_rate"] for task in asked]) for of in (read, done))
        steps = (f"{np.nanmean(read[task][SAMPLED]['success_length']):.1f}" for task in asked)
        rows += [(name, "read alone", *_worst(alone)), (name, "read alone, steps", *steps)]
        rows.append((name, "beside the robot", *_worst(beside)))
        for where, of in (("read alone", read), ("beside the robot", done)):
            ends.append((name, where, *(anyends.cell(of, (task,)) for task in asked)))
        shares["code"][name] = met.read(runs[reader].path)["renamed"]
        shares["agent"][name] = met.read(runs[agent].path)["renamed"]
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
            " Success in training, and on formulas of the same family that were not trained on under their own names: "
            f"{'; '.join(families)}."
        )
    rows += [line for whose, of in shares.items() for line in _met_lines(whose, of, asked)]
    heading = ("where", *asked)
    parts = (
        explained,
        table(("code", *heading), rows),
        table((f"code: {anyends.CALLED}", *heading), ends),
        verdicts(renamed, bars),
    )
    return "\n\n".join(parts)


def _met_lines(whose: str, shares: Mapping[str, Mapping[str, str]], asked: Sequence[str]) -> list[tuple[str, ...]]:
    """What trainings of codes, or of agents, met of every formula up to renaming; a line for all that met so much."""
    names: dict[tuple[str, ...], list[str]] = {}
    for name, of in shares.items():
        names.setdefault(tuple(of.get(task, "-") for task in asked), []).append(name)
    labels = ("all" if len(names) == 1 else ", ".join(alike) for alike in names.values())
    return [
        ("**rows met, up to names**", f"training of the {whose}: {label}", *cells)
        for label, cells in zip(labels, names, strict=True)
    ]


def _worst(values: np.ndarray) -> tuple[str, ...]:
    """A cell for each formula, of values [formulas, seeds]: the mean, and the worst seed."""
    return tuple(f"{of.mean():.2f} ({of.min():.2f})" for of in values)


def rows_met(shares: Mapping[str, Mapping[str, str]], tasks: Sequence[str]) -> str:
    """Of all open rows of some tasks together, how many a training met up to renaming of propositions."""
    return _as_share(_counted(shares, [task for task in tasks if task in shares["renamed"]]))


def _counted(shares: Mapping[str, Mapping[str, str]], tasks: Sequence[str]) -> tuple[int, int] | None:
    """The same as numbers; None where it is not known of all tasks, or where there are none."""
    if not tasks or not set(tasks) <= shares["renamed"].keys():
        return None
    found = [shares["renamed"][task].split("/") for task in tasks]
    return sum(int(some) for some, _ in found), sum(int(rows) for _, rows in found)
