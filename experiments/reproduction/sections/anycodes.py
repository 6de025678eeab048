"""Which code of a task generalises: agents of the open ZoneEnv with different codes, at levels of formulas."""

from collections.abc import Mapping, Sequence
from math import comb
from typing import Any

import numpy as np

from experiments.reproduction.anytask import met, suites
from experiments.reproduction.cells import COST, cost, share
from experiments.reproduction.claims import differences
from experiments.reproduction.page import table
from experiments.reproduction.sections.anytask import SAMPLED, Bar, figures, over_tasks, own_family, state_of, verdicts
from experiments.reproduction.stored import Stored

PRETRAINED = "any-pretraining-"
"""What the names of runs begin with that train codes in the world of a single state."""

LONGER = [(f"any-zones-{reader}-long", f"any-zones-{reader}") for reader in ("transformer", "gru")]
"""Agents that read the same text for different numbers of frames."""

TAUGHT_MORE = [
    (f"any-pretraining-transformer-more{again}", "any-pretraining-transformer") for again in ("", "-again", "-third")
]
"""Pre-trainings of one code: on more formulas, at a learning rate that falls, and on fewer, at one that does not."""

NARROW = "any-zones-narrow"

BESIDE = [("any-zones-transformer-more", "any-zones-transformer-long")]
"""Agents that read codes of these pre-trainings, trained for as many frames."""

WIDER = [
    ("any-zones-transformer-wide", "any-zones-transformer-more"),
    ("any-zones-gru-wide", "any-zones-gru-long"),
]
"""Agents with wider layers, a larger step size that falls to 0 and more frames, and those before them."""

WELL_READ = 0.99
"""A formula that a code reads alone with this success is read."""

READERS = {
    "any-zones-transformer": "any-pretraining-transformer",
    "any-zones-transformer-long": "any-pretraining-transformer",
    "any-zones-transformer-more": "any-pretraining-transformer-more-again",
    "any-zones-transformer-wide": "any-pretraining-transformer-more-third",
    "any-zones-gru": "any-pretraining-gru",
    "any-zones-gru-long": "any-pretraining-gru-again",
    "any-zones-gru-wide": "any-pretraining-gru-third",
}
"""Agents that know of the task by its text alone, and the runs that trained their codes, seed by seed."""

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
    """Success of every code at every level, what longer training changes, what was read before, and what each cost."""
    rows, costs = [], []
    for name, run in runs.items():
        if name.startswith(PRETRAINED):
            continue
        of, cells = figures(run), []
        for tasks in LEVELS.values():
            there = set(tasks) <= of.keys()
            cells.append(over_tasks(of, tasks, SAMPLED, "success_rate").text(2) if there else "-")
        label = name.removeprefix("any-zones-") if name != "any-zones" else "the agent above"
        rows.append((label, state_of(run), share(run.end("success_rate")), share(own_family(run)), *cells))
        costs.append((label, str(len(run.seeds)), *cost(run)))
    said = (
        "Success of the sampled policy. Intervals of levels are over seeds and tasks, both as samples. Codes compare "
        "only where state, budget, layers, step size and family are the same, and what pre-training met, below. The "
        "agent above, narrow and the wide ones have others than the rest. Merged lidars are most of what "
        "lookahead-merged gains over lookahead."
    )
    if NARROW in runs:
        said += (
            " narrow is the agent above as it was before: narrower layers, a smaller step size, less to avoid in its "
            "tasks, fewer frames, other seeds."
        )
    if NARROW in runs and (runs[NARROW].path / "params.npz").is_file():
        above = runs.get("any-zones")
        said += " Its parameters are stored" + (
            "." if above is None or (above.path / "params.npz").is_file() else "; those of the agent above are not."
        )
    return "\n\n".join(
        part
        for part in (
            table(("code", "state", "training", "same family", *LEVELS), rows),
            said if rows else "",
            longer_training(runs),
            read_alone(runs),
            text_alone(runs),
            table(("code", "seeds", *COST), costs),
        )
        if part
    )


def _of_each_seed(run: Stored) -> dict[int, float]:
    """Success of each seed, the mean of z1 to z6; nothing of a run that was not tested on them."""
    of = figures(run)
    if not set(suites.ZONE_Z) <= of.keys():
        return {}
    means = np.mean([of[task][SAMPLED]["success_rate"] for task in suites.ZONE_Z], axis=0)
    return dict(zip(run.seeds, means.tolist(), strict=True))


def longer_training(runs: Mapping[str, Stored]) -> str:
    """What more frames change for an agent that reads text; '' unless both trainings are there."""
    there = [pair for pair in LONGER if {*pair} <= runs.keys()]
    if not there:
        return ""
    tested_on = {name: _of_each_seed(runs[name]) for pair in there for name in pair}
    found = differences(runs, LONGER, tested_on, "success, mean of z1 to z6")
    pairs = min(len(runs[shorter].seeds) for _, shorter in there)
    said = (
        f"The longer training has the same seeds and maps, and codes of the same pre-training, but gru-long: its codes "
        f"are of one that was made again by the same settings (gru-again) and does not read quite the same, so that "
        f"its difference is of both. A permutation of {pairs} pairs cannot give a p under {2 / 2**pairs:.3g}."
    )
    return f"{found}\n\n{said}" if found else ""


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
        rows.append((name.removeprefix(PRETRAINED), share(run.end("success_rate")), *cells, kept_out, *met_of))
    heading = (
        *("code", "success in its pre-training", "z1 to z6, read alone", "harder, read alone", "kept out of its pools"),
        *("rows of z1 to z6 met, up to names", "of harder", "of wider"),
    )
    said = (
        "Codes are learned before, in the world of a single state, where an action is a proposition and nothing is to "
        "be done but to read."
    )
    if any(kept_out == "nothing" for _, _, _, _, kept_out, *_ in rows):
        said += (
            " Where nothing was kept out of that, the codes of whole test formulas were learned there, up to names, "
            "and their lines above do not tell of unseen formulas as the others do."
        )
    known = {name: _of_each_seed(run) for name, run in runs.items() if name.startswith(PRETRAINED)}
    taught = differences(runs, TAUGHT_MORE, known, "success, mean of z1 to z6, read alone")
    if taught:
        there = [pair for pair in TAUGHT_MORE if {*pair} <= runs.keys()]
        more, fewer = (len(runs[name].seeds) for name in there[0])
        twice = (
            "transformer-more and transformer-more-again have the same settings and seeds, which a GPU does not repeat "
            "exactly; transformer-more-third has yet other seeds. Beside the robot transformer-more reads codes of "
            "transformer-more-again, and transformer-wide those of transformer-more-third. "
        )
        taught += (
            "\n\nThe first of each pair had more frames, so more formulas, a learning rate that begins at half and "
            "falls to 0, and other seeds; it was set up after results of the second on these very formulas had been "
            "seen. What of it helps is not taken apart, and what it changes for the harder ones is in the table above. "
            f"{twice if len(there) > 1 else ''}So few seeds cannot give a p under "
            f"{2 / comb(more + fewer, more):.3g}, before it is corrected."
        )
    return "\n\n".join(part for part in (said, table(heading, rows), taught) if part) if rows else ""


def text_alone(runs: Mapping[str, Stored]) -> str:
    """What agents come to that read text, by formula and seed, beside what their codes come to read alone."""
    rows: dict[tuple[str, str], tuple[str, ...]] = {}
    merged: dict[str, Any] = {}
    bars, said, families, acting = [], [], [], []
    for agent, reader in READERS.items():
        if not {agent, reader} <= runs.keys():
            continue
        done, read = figures(runs[agent]), figures(runs[reader])
        if not set(suites.ZONE_Z) <= done.keys() & read.keys() or runs[agent].seeds != runs[reader].seeds:
            continue
        code, name = reader.removeprefix(PRETRAINED), agent.removeprefix("any-zones-")
        alone, beside = (np.stack([of[task][SAMPLED]["success_rate"] for task in suites.ZONE_Z]) for of in (read, done))
        rows[code, "read alone"], rows[name, "beside the robot"] = _by_seed(alone), _by_seed(beside)
        tasks = tuple(f"{task} ({name})" for task in suites.ZONE_Z)
        merged |= {of: done[task] for of, task in zip(tasks, suites.ZONE_Z, strict=True)}
        bars.append(Bar(f"success, mean of z1 to z6, by text alone: {name}", tasks, least=0.95))
        others = np.arange(alone.size) != alone.argmin()
        without = _correlation(alone.ravel()[others], beside.ravel()[others])
        said.append(f"{name} {_correlation(alone, beside)}, {without}")
        well = alone >= WELL_READ
        if well.any():
            acting.append(f"{name} {beside[well].mean():.2f} ({well.sum()} of {well.size})")
        own = own_family(runs[agent])
        if own:
            trained = np.mean(list(runs[agent].end("success_rate").values()))
            families.append(f"{name} {trained:.2f}, {np.mean(list(own.values())):.2f}, {beside.mean():.2f}")
    if not rows:
        return ""
    explained = (
        "Agents that know of the task by its text alone, by seed: what their codes read where nothing is to be done "
        "but to read, and what they carry out beside the robot. A formula that is not carried out even alone is not "
        "read well enough; one that is, and is missed beside the robot, is lost there. Correlation of the two "
        "(Pearson), over formulas and seeds, and without the one point that is read worst, on which it may rest: "
        f"{'; '.join(said)}."
    )
    if acting:
        explained += (
            f" Mean success beside the robot of those formulas and seeds that are read alone in {WELL_READ} and more, "
            f"and how many they are: {'; '.join(acting)}."
        )
    if families:
        explained += (
            " Success in training, on formulas of the same family that they had not met, and on z1 to z6: "
            f"{'; '.join(families)}. An agent that comes to as little in training as on z1 to z6 does not stay behind "
            "because these are unlike its training."
        )
    shown = [(*of, *cells) for of, cells in rows.items()]
    pairs = [*BESIDE, *WIDER]
    tested_on = {name: _of_each_seed(run) for name, run in runs.items() if any(name in pair for pair in pairs)}
    taught = differences(runs, pairs, tested_on, "success, mean of z1 to z6, beside the robot")
    if taught:
        taught += (
            "\n\nThe first of each pair was set up after results on these very formulas had been seen, and has other "
            "seeds. transformer-more has codes of the longer pre-training, at another learning rate. Wide ones have "
            "wider layers, a larger step size that falls to 0, and 1.5 times the frames; their codes were pre-trained "
            "anew, by the same settings as the second of their pair. These settings were the best of seven by four "
            "formulas that are no tests, tried with codes of a GRU, 3 seeds and 40 million frames, and are not stored."
        )
    parts = (explained, table(("code", "where", *suites.ZONE_Z), shown), verdicts(merged, bars), taught)
    return "\n\n".join(part for part in parts if part)


def _by_seed(values: np.ndarray) -> tuple[str, ...]:
    """A cell for each formula, of values [formulas, seeds]."""
    return tuple(", ".join(f"{value:.2f}" for value in of) for of in values)


def _correlation(one: np.ndarray, other: np.ndarray) -> str:
    """A dash where either hardly differs: what is left is the chance of 500 episodes."""
    known = min(np.ptp(one), np.ptp(other)) > 0.02
    return f"{np.corrcoef(one.ravel(), other.ravel())[0, 1]:.2f}" if known else "-"


def _rows_met(shares: Mapping[str, Mapping[str, str]], tasks: Sequence[str]) -> str:
    """Of all open rows of some tasks together, how many a training met up to renaming of propositions."""
    found = [shares["renamed"][task].split("/") for task in tasks if task in shares["renamed"]]
    return f"{sum(int(met) for met, _ in found)}/{sum(int(of) for _, of in found)}" if found else "-"
