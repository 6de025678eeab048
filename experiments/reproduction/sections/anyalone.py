"""Codes read alone, in the world of a single state, and beside what agents with them carry out."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from experiments.reproduction.anytask import met, suites
from experiments.reproduction.anytask.runs import TEXTS
from experiments.reproduction.cells import share
from experiments.reproduction.page import table
from experiments.reproduction.sections import anyends
from experiments.reproduction.sections.anyaims import AIMS_HEADING, Aim, Bar
from experiments.reproduction.sections.anyaims import aims as aims_of
from experiments.reproduction.sections.anyfigures import SAMPLED, figures, over_tasks, own_family
from experiments.reproduction.stored import Stored
from t2tl_jax.agents.dp_config import DPConfig

PRETRAINED = "any-pretraining-"
"""What the names of runs begin with that train codes in the world of a single state."""

BROAD = "any-zones-broad-"
"""What the names of agents begin with that were trained on the broad family, all in one way but for their codes."""

SOLVED = "any-zones-solved-"
"""What the names of agents begin with that are as those, but for other seeds and codes that learned by dynamic
programming."""

WELL_READ = 0.99
"""A formula that a code reads alone with this success is read."""

READERS = {
    **{f"{BROAD}{code}": f"{PRETRAINED}broad-{code}" for code in ("transformer", "gru", "rgcn", "automaton")},
    **{f"{SOLVED}{code}": f"{PRETRAINED}solved-{code}" for code in TEXTS},
}
"""Agents whose codes were learned, and the runs that trained these, seed by seed."""

FROM_TABLE = f"{BROAD}automaton"
"""The one of them whose code is made of the table's transitions; the others know of the task by its formula alone."""


def label(name: str) -> str:
    """What the tables call an agent."""
    return name.removeprefix("any-zones-")


def read_alone(runs: Mapping[str, Stored]) -> str:
    """What the codes that were trained before come to when they are read alone."""
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
        met_of = [met.rows_met(shares, tasks) for tasks in (suites.ZONE_Z, suites.ZONE_HARD, suites.ZONE_WIDE)]
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
    said = "Codes are learned before the agents, in the world in which they are then read alone."
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
    families, acting = [], []
    for agent, reader in READERS.items():
        if (pair := _both(runs, agent, reader)) is None:
            continue
        done, read = pair
        name = _code(agent)
        alone, beside = (np.stack([of[task][SAMPLED]["success_rate"] for task in asked]) for of in (read, done))
        steps = (f"{np.nanmean(read[task][SAMPLED]['success_length']):.1f}" for task in asked)
        rows += [(name, "read alone", *_worst(alone)), (name, "read alone, steps", *steps)]
        rows.append((name, "beside the robot", *_worst(beside)))
        for where, of in (("read alone", read), ("beside the robot", done)):
            ends.append((name, where, *(anyends.cell(of, (task,)) for task in asked)))
        shares["code"][name] = met.read(runs[reader].path)["renamed"]
        shares["agent"][name] = met.read(runs[agent].path)["renamed"]
        if (well := alone >= WELL_READ).any():
            acting.append(f"{name} {beside[well].mean():.3f} ({well.sum()} of {well.size})")
        if own := own_family(runs[agent]):
            trained = np.mean(list(runs[agent].end("success_rate").values()))
            families.append(f"{name} {trained:.3f}, {np.mean(list(own.values())):.3f}")
    if not rows:
        return ""
    explained = (
        "Agents whose codes were learned, from the formula alone but for the automaton's: what the codes come to when "
        "they are read alone, and what the agents carry out beside the robot; means over seeds, and the worst seed. "
        "To be carried out alone is little: there a detour costs nothing but steps, so that a code which leads astray "
        "at first also comes to success. More steps than the automaton's code takes are a sign of that; what is missed "
        "beside the robot may be lost in reading or in acting."
    )
    if acting:
        explained += (
            f" Mean success beside the robot of those formulas and seeds that are read alone in {WELL_READ} and more, "
            f"and how many they are: {'; '.join(acting)}."
        )
    if families:
        explained += (
            " Success in training, and on formulas of the same family that were not trained on as they stand: "
            f"{'; '.join(families)}."
        )
    rows += [line for whose, of in shares.items() for line in _met_lines(whose, of, asked)]
    heading = ("where", *asked)
    parts = (
        explained,
        table(("code", *heading), rows),
        table((f"code: {anyends.CALLED}", *heading), ends),
        table(AIMS_HEADING, aims(runs)),
    )
    return "\n\n".join(parts)


def aims(runs: Mapping[str, Stored]) -> list[Aim]:
    """What becomes of the aim on z1 to z6 for every code that knows of the task by its formula alone."""
    found: list[Aim] = []
    for agent, reader in READERS.items():
        if agent == FROM_TABLE or (pair := _both(runs, agent, reader)) is None:
            continue
        says = f"success, mean of z1 to z6, by its formula alone: {_code(agent)}"
        found += aims_of(pair[0], [Bar(says, suites.ZONE_Z, least=0.95)])
    return found


def _both(runs: Mapping[str, Stored], agent: str, reader: str) -> tuple[dict[str, Any], dict[str, Any]] | None:
    """Figures of an agent and of its code read alone; None where a task was not played, or not by the same seeds."""
    if not {agent, reader} <= runs.keys() or runs[agent].seeds != runs[reader].seeds:
        return None
    done, read = figures(runs[agent]), figures(runs[reader])
    return (done, read) if {*suites.ZONE_Z, *suites.ZONE_HARD} <= done.keys() & read.keys() else None


def _code(agent: str) -> str:
    """What the code of an agent of `READERS` is called beside it."""
    return label(agent.replace(BROAD, "any-zones-"))


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
