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
from experiments.reproduction.sections.anyalone import BROAD, PRETRAINED, SOLVED, label, read_alone, text_alone
from experiments.reproduction.sections.anyfigures import OWN, SAMPLED, figures, over_tasks, own_family, state_of
from experiments.reproduction.stored import Stored

ALMOST_ALL = 0.9
"""Of a level with this share of its rows met, nearly all were met."""

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
    costs = [(label(name), str(len(run.seeds)), *cost(run)) for name, run in agents.items()]
    parts = (
        _levels_table(broad, solved),
        _ends_table({**broad, **solved}),
        _steps_table({**broad, **solved}),
        anyunread.say({label(name): run for name, run in (broad | solved | others).items()}, LEVELS),
        solved_say(solved),
        rows_met_say(broad | solved),
        BROAD_SAYS if broad else "",
        sizes_say(runs),
        controls_say(broad),
        compared(broad, AGAINST_TABLE),
        compared(broad | solved, AGAINST_PLAYED) if solved else "",
        text_alone(runs),
        _levels_table(others),
        _ends_table(others),
        _steps_table(others),
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
    "any-zones, and codes as they were before: a narrower family, the observation as it is (flat) or merged, fewer "
    "frames, other seeds, and pre-training in which every proposition can be chosen at any step. All of this sets them "
    "apart from the agents of the broad family, and we did not separate these causes. Codes compare where state, "
    "budget, layers, step size and family are the same, so any-zones stands by itself."
)


def solved_say(runs: Mapping[str, Stored]) -> str:
    """What is to be known of agents whose codes learned by dynamic programming; '' where there are none."""
    if not runs:
        return ""
    rates = ", ".join(f"{rate:g} of {code}" for code, rate in SOLVED_RATES.items())
    return (
        "By dynamic programming: agents with the same family, network and number of frames, on other seeds (beginning "
        f"with {FIFTH_SEED}), so that they are not paired with the others. Their codes learned in the same world "
        "as the others, but from its solution: nothing was played there, and a frame is a row that a gradient step "
        f"read. The learning rates ({rates}) were chosen on seeds 100 to 102. R-GCN and automaton were not trained "
        "so: these lines do not tell what they would come to. Against the same readers that learned by playing, "
        "the learner, its step size, the number of formulas (below) and the seeds all differ; we did not "
        "separate these causes. The share of the tests' rows that was met is the same. The two tables of "
        "differences of these agents are corrected separately, and not for those of the broad agents. The interval is "
        "Student's t; p is from a permutation test, which one outlier affects less."
    )


def _levels_table(runs: Mapping[str, Stored], solved: Mapping[str, Stored] | None = None) -> str:
    """A line for each code, those that learned by dynamic programming apart, and then what was met of each level."""
    rows = [_levels_row(name, run) for name, run in runs.items()]
    if solved:
        seeds = f"seeds {FIFTH_SEED} to {FIFTH_SEED + int(HEADLINE_SEEDS) - 1}"
        rows.append((f"**codes by dynamic programming, {seeds}**", *("" for _ in (*LEVELS, 0, 0, 0, 0))))
        rows += [_levels_row(name, run) for name, run in solved.items()]
    groups = _rows_of_levels({**runs, **(solved or {})})
    most = max((len(names) for names, _ in groups), default=0)
    for names, shares in groups:
        whom = "all" if len(groups) == 1 else "others" if len(names) == most > 1 else ", ".join(map(label, names))
        cells = [met.as_share(shares.get(level)) for level in (OWN, *LEVELS)]
        rows.append((f"**rows met, up to names: {whom}**", "", "", "", *cells))
    return table(("code", "state", "parameters of the code", "training", "same family", *LEVELS), rows)


def _levels_row(name: str, run: Stored) -> tuple[str, ...]:
    of, cells = figures(run), []
    for level, tasks in LEVELS.items():
        there = set(tasks) <= of.keys()
        cells.append(over_tasks(of, tasks, SAMPLED, "success_rate").text(2) if there else anyunread.cell(run, level))
    return (
        label(name),
        state_of(run),
        _parameters(run),
        share(run.end("success_rate")),
        share(own_family(run)),
        *cells,
    )


def _ends_table(runs: Mapping[str, Stored]) -> str:
    """How the other episodes of the same codes end, at the same levels."""
    rows = []
    for name, run in runs.items():
        of = figures(run)
        cells = [anyends.cell(of, tasks, anyunread.cell(run, level)) for level, tasks in LEVELS.items()]
        rows.append((label(name), anyends.of_training(run), anyends.cell(of, (OWN,)), *cells))
    return table((f"code: {anyends.CALLED}", "training", "same family", *LEVELS), rows)


def _steps_table(runs: Mapping[str, Stored]) -> str:
    """How long the episodes that succeed take, and the return of all, of the same codes at the same levels."""
    rows = []
    for name, run in runs.items():
        of = figures(run)
        played = [(OWN, (OWN,)), *LEVELS.items()]
        cells = [
            _steps_and_return(of, tasks) if set(tasks) <= of.keys() else anyunread.cell(run, level)
            for level, tasks in played
        ]
        rows.append((label(name), *cells))
    return table(("code: steps of successes / return", "same family", *LEVELS), rows)


def _steps_and_return(of: Mapping[str, Any], tasks: Sequence[str]) -> str:
    steps, gained = (over_tasks(of, tasks, SAMPLED, name).value for name in ("success_length", "discounted_return"))
    return f"{'-' if steps is None else f'{steps:.0f}'} / {'-' if gained is None else f'{gained:.2f}'}"


def _parameters(run: Stored) -> str:
    """How many parameters the code has; those of layers that read it are not among them."""
    return "-" if run.sizes is None else f"{run.sizes.encoder:,}"


def sizes_say(runs: Mapping[str, Stored]) -> str:
    """That codes are of different sizes, and what that tells of the largest; '' where few are known."""
    sizes = {code: run.sizes.encoder for code in LEARNED if (run := runs.get(f"{BROAD}{code}")) and run.sizes}
    if len(sizes) < len(LEARNED):
        return ""
    ordered = sorted(sizes, key=sizes.__getitem__)
    largest, others = ordered[-1], ordered[:-1]
    least, most = (sizes[largest] / sizes[code] for code in (others[-1], others[0]))
    said = (
        "The learned codes are not of equal size, as the comparison would ask for: "
        f"{', '.join(f'{code} {sizes[code]:,}' for code in ordered)} parameters. The largest, {largest}, has "
        f"{least:.0f} to {most:.0f} times as many as the others."
    )
    learned = {code: run for code in LEARNED if (run := runs.get(f"{PRETRAINED}{code}"))}
    ends = {code: float(np.nanmean(list(run.end("success_rate").values()))) for code, run in learned.items()}
    if ends.keys() == LEARNED.keys() and len({run.frames for run in learned.values()}) == 1:
        rest = [end for code, end in ends.items() if code != largest]
        if ends[largest] < min(rest):
            said += (
                f" It was the slowest learner all the same: in pre-trainings of one length (those of the narrower "
                f"family, below) it came to {ends[largest]:.3f}, the others to {min(rest):.3f} to {max(rest):.3f}. So "
                "a lack of parameters does not explain its place."
            )
    return f"{said} No comparison at equal size was made."


def controls_say(runs: Mapping[str, Stored]) -> str:
    """Which controls are lacking, and what those that are there do not tell."""
    if not runs:
        return ""
    ends = {
        code: float(np.nanmean(list(run.end("success_rate").values())))
        for code in UNINFORMED
        if (run := runs.get(f"{BROAD}{code}"))
    }
    said = "**Controls.** No agent was trained on the rows of the tests, which would be the upper limit."
    if ends:
        failed = " and ".join(f"{code} ({end:.2f})" for code, end in ends.items())
        said += (
            f" In training {failed} fail already, so that their gap to the others at the levels is no measure of "
            "generalisation."
        )
    return (
        f"{said} Meaning against text: a formula that says a thing twice, or negates it twice, compiles to the text of "
        "the plain one (`F Blue & F(Blue & F Green)` to `F(Blue & F Green)`; `tests/ltl/test_rewordings.py` has more), "
        "so that a code of texts reads the same. The order of operands stays, as in `F Magenta & F Yellow`: how far "
        "such another text of the same meaning shifts actions and values was not measured."
    )


UNINFORMED = ("names", "nothing")
"""Codes that tell rows apart and no more, and not even that."""


Levels = dict[str, tuple[int, int]]
"""By level, how many rows were met, and of how many."""


def _rows_of_levels(runs: Mapping[str, Stored]) -> list[tuple[list[str], Levels]]:
    """What trainings met of every level, up to renaming, and which of them met so much; of trainings with one family
    and one number of pools that is the same, be they tested on all levels or not."""
    found: list[tuple[list[str], Levels]] = []
    for name, run in runs.items():
        shares = met.read(run.path)
        each = {OWN: (OWN,), **LEVELS}
        own = {level: counted for level, tasks in each.items() if (counted := met.counted(shares, tasks))}
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
        whom = "these agents" if len(names) == len(runs) else ", ".join(map(label, names))
        of_these, of_those = (
            ", ".join(f"{level} ({met.as_share(counts[level])})" for level in levels) for levels in (nearly, rest)
        )
        said.append(
            f"The training of {whom} had met nearly every open row of {of_these}: success there is hardly "
            f"generalisation to new rows. Of the other levels, fewest first: {of_those}. Rows are counted up to "
            "renaming of propositions, and whole test formulas were kept out."
        )
    return " ".join(said)


def _part(counted: tuple[int, int]) -> float:
    return counted[0] / max(counted[1], 1)


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
