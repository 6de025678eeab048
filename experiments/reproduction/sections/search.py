"""One and the same search for every method that is compared, and what the orders are with its results."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from experiments import tuning
from experiments.reproduction import rates
from experiments.reproduction.cells import cost_line, text
from experiments.reproduction.claims import differences
from experiments.reproduction.page import paragraph, table
from experiments.reproduction.runs import SEARCH_METHODS as WORLDS
from experiments.reproduction.sections import figures, safe, ten_tasks
from experiments.reproduction.stored import LAST, Stored
from experiments.reproduction.tables import methods
from experiments.sweeps.search import worth
from t2tl_jax.evaluation.comparisons import Pairs

CRITERION = "discounted_return"
"""What a search maximises at the end of training."""

TITLES = {
    "zone": "ZoneEnv, `phi_zone`",
    "water": "WaterWorld, `phi_water`",
    "safe": "ZoneEnv, `phi_safe`",
    "rm": "The reward-machine benchmark, ten tasks",
}
CLAIMS: dict[str, Pairs] = {
    "zone": figures.ZONE_CLAIMS,
    "water": figures.WATER_CLAIMS,
    "safe": safe.PAIRS,
    "rm": ten_tasks.CLAIMS,
}
ORDERS = {
    "zone": figures.zone_order,
    "water": figures.water_order,
    "safe": safe.safe_order,
    "rm": ten_tasks.order,
}
CLAIMED = {
    "zone": "The orderings that the paper claims",
    "water": "The orderings that the paper claims",
    "rm": "The orderings that the paper of reward machines claims",
}
"""Of the others pairs are compared of which nothing is claimed."""

NOTES = f"""The search is the same for every method: the learning rate at a third of the usual one, which all methods
of a world share (in the reward-machine benchmark crm and ql have one each, shaped or not), at that one, and at three
times it, and nothing else. Budget and schedule are those of the main runs, but in ZoneEnv 3 million frames instead of
10 and in the benchmark 400,000 instead of 2 million, over which learning rates fall to 0; the noise fades over the same
1.5 million frames as in the main runs in ZoneEnv, and random actions over the same share of the frames in the
benchmark; encoders are pre-trained as for the main runs, on the seeds of the search. The best rate has the highest mean
over seeds of the discounted return over the last {100 * LAST:g} % of training, which is what `experiments.sweep
--search` maximises (a seed in which no episode ended there counts -1); the usual rate is kept where no other mean is
above its. That is a plain maximum of few seeds, so that another rate may be taken by chance: what it is worth is
measured on the seeds that are reported. A better rate may lie between or beyond the three, what is best after fewer
frames need not be best after all, and no other setting was searched for by method."""

STAYS = "The usual rate is best for every method, so that nothing is trained again."


ON_FRESH_SEEDS = """A difference whose interval holds 0 does not say that the rate which was taken on four seeds is
better on the reported ones, nor that it is worse; one whose interval lies below 0 says that it is worse there. The two
runs of a method may be of different commits: what the program changed between them is in the difference too. They may
have shared a GPU or not: their seconds do not compare."""


def planned() -> tuple[str, ...]:
    """The runs of the item: the search, and in a world where it found another rate all that its claims compare."""
    tried = [
        rates.search_name(world, method, which)
        for world, names in WORLDS.items()
        for method in names
        for which in rates.RATES
    ]
    compared = [
        name
        for world, names in WORLDS.items()
        if rates.OWN_RATE.get(world)
        for method in names
        for name in dict.fromkeys((f"{world}-{method}", rates.at_its_best(f"{world}-{method}")))
    ]
    return (*tried, *compared)


def search(runs: Mapping[str, Stored]) -> str:
    """By world every method at every rate, the best one marked; then the runs at their own rates beside those at the
    usual one, and the claims once more."""
    parts = [part for world in WORLDS for part in (_tried(runs, world), _again(runs, world)) if part]
    return "\n\n".join([*parts, paragraph(NOTES)]) if parts else ""


def best(runs: Mapping[str, Stored], world: str, method: str) -> str | None:
    """The best of the rates for a method, the usual one if none is above it; None until all of them are there."""
    tried = {which: runs.get(rates.search_name(world, method, which)) for which in rates.RATES}
    known = {which: worth(np.array(list(_ends(run).values()))) for which, run in tried.items() if run is not None}
    if len(known) < len(tried):
        return None
    return max(known, key=lambda which: (known[which], which == rates.SHARED))


def own_rates(runs: Mapping[str, Stored], world: str) -> dict[str, str] | None:
    """What `rates.OWN_RATE` has to say of a world: the methods whose best rate is another one; None until the search is
    there in full."""
    found = {method: best(runs, world, method) for method in WORLDS[world]}
    if None in found.values():
        return None
    return {method: which for method, which in found.items() if which is not None and which != rates.SHARED}


def _ends(run: Stored) -> dict[int, float]:
    return run.end(CRITERION)


def _by_criterion(runs: Mapping[str, Stored], pairs: Pairs) -> str:
    """The same by what the search maximised, where orders are judged by something else."""
    return differences(runs, pairs, {name: _ends(run) for name, run in runs.items()}, "return at the end")


def _tried(runs: Mapping[str, Stored], world: str) -> str:
    """A row for each method, the best cell marked; '' without runs."""
    names = {method: [rates.search_name(world, method, which) for which in rates.RATES] for method in WORLDS[world]}
    there = {name: runs[name] for own in names.values() for name in own if name in runs}
    rows = []
    for method, own in names.items():
        if there.keys().isdisjoint(own):
            continue
        taken = best(runs, world, method)
        cells = [text(_ends(there[name])) if name in there else "-" for name in own]
        marked = [f"**{cell}**" if which == taken else cell for which, cell in zip(rates.RATES, cells, strict=True)]
        rows.append((method, *marked, "not known yet" if taken is None else rates.WORDS[taken]))
    if not rows:
        return ""
    at = {which: {method: rates.search_name(world, method, which) for method in names} for which in rates.RATES}
    known = {which: {method: there[name] for method, name in of.items() if name in there} for which, of in at.items()}
    heading = ("method", *(_column(of, which) for which, of in known.items()), "best")
    seeds = sorted({seed for run in there.values() for seed in run.seeds})
    said = (
        f"{TITLES[world]}: return at the end of training, on seeds {tuning.in_words(seeds)}, which are kept for "
        f"tuning. {cost_line(there)}"
    )
    return f"{paragraph(said)}\n\n{table(heading, rows)}"


def _column(methods: Mapping[str, Stored], which: str) -> str:
    """One of the rates in words, and as a number where there is a run, by method; of several numbers, whose each is."""
    found: dict[float, list[str]] = {}
    for method, run in methods.items():
        learner: Any = run.config.learner
        found.setdefault(learner.learning_rate, []).append(method)
    each = [f"{number:g}" + (f" ({', '.join(whose)})" if len(found) > 1 else "") for number, whose in found.items()]
    return ", ".join([rates.WORDS[which], *each])


def _again(runs: Mapping[str, Stored], world: str) -> str:
    """Methods with a rate of their own beside the usual one, on the seeds that are reported, and the claims with each
    method at the rate that the search took; '' until the search is there."""
    own, runs = rates.OWN_RATE.get(world), {name: run for name, run in runs.items() if name.startswith(f"{world}-")}
    if own is None:
        return ""
    if not own:
        return STAYS
    names = [f"{world}-{method}" for method in own]
    pairs = [(rates.own_name(name), name) for name in names]
    shown = [name for pair in pairs for name in pair if name in runs]
    if not any(first in runs for first, _ in pairs):
        return ""
    claims = [(rates.at_its_best(better), rates.at_its_best(worse)) for better, worse in CLAIMS[world]]
    order = ORDERS[world]
    judged = order(runs, claims, claims) if world in CLAIMED else order(runs, claims)
    parts = (
        f"{TITLES[world]}: the rate that the search took beside the usual one, on the seeds of the main runs.",
        methods({name: runs[name] for name in shown}, {name: name for name in shown}),
        order(runs, pairs),
        _by_criterion(runs, pairs) if world != "zone" else "",
        paragraph(ON_FRESH_SEEDS),
        f"{CLAIMED.get(world, 'The comparisons of its section')}, each method at the rate that the search took:",
        judged or "None can be made yet.",
    )
    return "\n\n".join(part for part in parts if part)
