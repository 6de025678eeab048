"""The learning curves of the six methods in ZoneEnv and WaterWorld, and those of the published program."""

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from experiments.paper import published_water, published_widths
from experiments.paper.published_curves import ZONE_CURVES
from experiments.reproduction import below, published_runs
from experiments.reproduction import runs as named
from experiments.reproduction.cells import cost_line, share, text
from experiments.reproduction.claims import differences
from experiments.reproduction.page import paragraph, table
from experiments.reproduction.sections.ablation import ablation
from experiments.reproduction.sections.settings import settings, what_differs
from experiments.reproduction.sections.water_windows import by_window, short_windows
from experiments.reproduction.stored import Stored, last_ones
from experiments.reproduction.tables import (
    MEAN_AT_EPISODES,
    curves_by_episode,
    curves_by_frames,
    mean_return_at,
    methods,
)
from t2tl_jax.evaluation.comparisons import Pairs
from t2tl_jax.networks.actor_critic import MINIMUM_STD

ZONE_MARKS = tuple(1e6 * x for x in (0.5, 1, 1.5, 2, 2.5, 3, 4, 5, 6, 7, 8, 9, 10))

ZONE_LABELS = {f"zone-{method}": method for method in named.ZONE_METHODS}
WATER_LABELS = {f"water-{method}": method for method in (*named.WATER_METHODS, "rm-6")}

ZONE_PUBLISHED = {
    f"zone-{method}": ZONE_CURVES[f"{name} (published)"]
    for method, name in (
        ("t2tl", "T2TL_pre"),
        ("t1tl", "T1TL_pre"),
        ("gnn", "GNN_pre"),
        ("dfa_number", "DFA"),
        ("dfa_cont", "DFA_cont"),
    )
}
"""The paper's curve "DFA" is that of the automaton's state as one number."""

ZONE_CLAIMS = [
    (f"zone-{better}", f"zone-{worse}")
    for better, others in (
        ("t2tl", ("t1tl", "gnn", "dfa_number", "dfa_cont")),
        ("t1tl", ("gnn", "dfa_number", "dfa_cont")),
        ("gnn", ("dfa_number", "dfa_cont")),
    )
    for worse in others
]
"""T2TL above T1TL above GNN above both DFAs, every two of them; between the two DFAs the curves cross."""

WATER_CLAIMS = [
    *(
        (f"water-{reader}", f"water-{state}")
        for reader in ("t2tl", "t1tl", "gnn")
        for state in ("rm-6", "dfa", "dfa_cont")
    ),
    ("water-t2tl", "water-gnn"),
    ("water-t1tl", "water-gnn"),
    ("water-rm-6", "water-dfa"),
    ("water-rm-6", "water-dfa_cont"),
]
"""RM has six numbers, as published. Who reads the formula above who does not, Transformers above the graph network,
and, as the text says, who learns all sub-tasks at once above who does not."""


WATER_PUBLISHED = {
    f"water-{method}": published_water.PHI_WATER[curve]
    for method, curve in (
        ("t2tl", "T2TL_pre"),
        ("t1tl", "T1TL_pre"),
        ("gnn", "GNN_pre"),
        ("rm-6", "RM"),
        ("dfa", "DFA"),
        ("dfa_cont", "DFA_cont"),
    )
}
SOONER_PUBLISHED = {name: published_water.PHI_WATER["T1TL_pre" if "t1tl" in name else "RM"] for name in named.BEGINNING}
"""The published curve of the same method."""

RM_NOTE = """The published RM is the curve of a code of 6 numbers, rm-6; rm has 16, which is ours, and nothing is
claimed of it. Early episodes are looked into below (`--only water-beginning`)."""

BEGINNING_NOTE = """The default makes one gradient step after every 128 steps of its environments and `per-16` one after
16, but they differ in more than that, see above; which of it makes `per-16` learn sooner is not taken apart. It has the
settings of `waterworld_dqn` before its present ones, and on which maps those were chosen is not recorded.
`short-exploration` differs from `per-16` in one thing: random actions fade over the first 1 % of the frames instead of
5 %. How many updates and how much exploration the published curves had is not published, nor are the balls' radius and
speed."""

OTHER_BEGINNINGS = """**Other methods.** Trained with the settings of `short-exploration` too: {}. Their usual runs
differ from these as `t1tl` does."""

OTHER_CURVES = {"t2tl": "T2TL_pre", "gnn": "GNN_pre", "dfa": "DFA", "dfa_cont": "DFA_cont"}
"""The published curve of each of them."""


def zone_figure(runs: Mapping[str, Stored]) -> str:
    """Final figures, curves by frames, and the order of the published curves at their end and over all of training."""
    return _joined(
        methods(runs, ZONE_LABELS, {name: curve[1][-1] for name, curve in ZONE_PUBLISHED.items()}),
        what_differs(runs, ZONE_LABELS, "zone"),
        curves_by_frames(runs, ZONE_LABELS, ZONE_MARKS, ZONE_PUBLISHED),
        below.by_frames(runs, ZONE_PUBLISHED, ZONE_MARKS),
        zone_order(runs, ZONE_CLAIMS, ZONE_CLAIMS),
    )


def zone_order(runs: Mapping[str, Stored], pairs: Pairs, claims: Pairs = ()) -> str:
    """Differences between runs in ZoneEnv as its figure judges them, at the end and over all of training."""
    ends = {name: run.end("discounted_return") for name, run in runs.items()}
    means = {name: run.area("discounted_return") for name, run in runs.items()}
    return _joined(
        differences(runs, pairs, ends, "return at the end", claims),
        differences(runs, pairs, means, "mean return over training", claims),
    )


def water_figure(runs: Mapping[str, Stored]) -> str:
    """Final figures, curves by episode, and their order by the mean return at the published episodes."""
    marks = published_water.EPISODES
    return _joined(
        methods(runs, WATER_LABELS),
        what_differs(runs, WATER_LABELS, "water"),
        curves_by_episode(runs, WATER_LABELS, marks, published_water.PHI_WATER),
        water_order(runs, WATER_CLAIMS, WATER_CLAIMS),
        below.by_episode(runs, WATER_PUBLISHED, marks),
        RM_NOTE if "water-rm" in runs else "",
    )


def water_order(runs: Mapping[str, Stored], pairs: Pairs, claims: Pairs = ()) -> str:
    """Differences between runs in WaterWorld as its figure judges them, by the mean over the published episodes."""
    means = {name: mean_return_at(run, published_water.EPISODES) for name, run in runs.items()}
    return differences(runs, pairs, means, MEAN_AT_EPISODES, claims)


def water_beginning(runs: Mapping[str, Stored]) -> str:
    """Curves by episode of runs that learn more from each step and explore for less long, beside the published ones."""
    if not runs:
        return ""
    marks = [mark for mark in published_water.EPISODES if mark <= 3000]
    means = {name: mean_return_at(run, marks) for name, run in runs.items()}
    pairs = [
        (f"water-{name}{more}", f"water-{name}{less}")
        for name in ("t1tl", "rm")
        for less, more in itertools.pairwise(named.SOONER)
    ]
    return _joined(
        curves_by_episode(runs, {name: name.removeprefix("water-") for name in runs}, marks, published_water.PHI_WATER),
        differences(runs, pairs, means, MEAN_AT_EPISODES, ()),
        settings(runs, pairs),
        below.by_episode(runs, SOONER_PUBLISHED, marks),
        BEGINNING_NOTE,
        by_window(runs, SOONER_PUBLISHED),
        cost_line(runs),
    )


def other_beginnings(runs: Mapping[str, Stored]) -> str:
    """The same of the other methods of which there are such runs, beside their usual ones."""
    there = [_method(name) for name in runs if name in named.SHORTLY.values()]
    if not there:
        return ""
    runs = {name: run for name, run in runs.items() if _method(name) in there}
    marks = [mark for mark in published_water.EPISODES if mark <= 3000]
    published = {name: published_water.PHI_WATER[OTHER_CURVES[_method(name)]] for name in runs}
    means = {name: mean_return_at(run, marks) for name, run in runs.items()}
    pairs = [(short, usual) for usual, short in named.SHORTLY.items()]
    return _joined(
        paragraph(OTHER_BEGINNINGS.format(", ".join(there))),
        *(_beginning_of(method, runs, marks) for method in there),
        differences(runs, pairs, means, MEAN_AT_EPISODES, ()),
        below.by_episode(runs, published, marks),
        short_windows(runs, published),
        cost_line({name: runs[name] for name in named.SHORTLY.values() if name in runs}),
    )


def _beginning_of(method: str, runs: Mapping[str, Stored], marks: Sequence[int]) -> str:
    """The curves of one method, usual and with short exploration, beside the published one."""
    labels = {name: name.removeprefix("water-") for name in runs if _method(name) == method}
    curve = OTHER_CURVES[method]
    return curves_by_episode(runs, labels, marks, {curve: published_water.PHI_WATER[curve]})


def _method(name: str) -> str:
    """Of a run in WaterWorld, as it is or with short exploration."""
    return name.removeprefix("water-").removesuffix(named.SOONER[-1])


def published_program(runs: Mapping[str, Stored]) -> str:
    """The published program beside the curve that it is said to have made, and its seeds by whether they learn."""
    labels = {"zone-published": "t2tl as published"}
    published = {"zone-published": ZONE_CURVES["T2TL_pre (published)"]}
    return _joined(
        methods(runs, labels, {name: curve[1][-1] for name, curve in published.items()}),
        curves_by_frames(runs, labels, ZONE_MARKS, published),
        below.by_frames(runs, published, ZONE_MARKS),
        *(found_or_not(run) for run in runs.values()),
    )


BASE = "zone-published-t1tl"
PUBLISHED_PIECES = tuple(name for name in published_runs.published_pieces() if name != BASE)
NO_END, OF_TWO = f"{BASE}-timeouts-no-end", (f"{BASE}-timeouts-correlated", f"{BASE}-timeouts-normalised")
"""One choice, and two runs with another one beside it."""
FEW_ENVIRONMENTS = 16
"""Of the published program. Where there are many more, all of them time out in the same few iterations, and between
these only successes end, which a curve by frames cannot be read off."""


def published_pieces(runs: Mapping[str, Stored]) -> str:
    """The published program for T1TL beside its curve, with one choice after another as it is by default here, and with
    pairs of them."""
    if not runs:
        return ""
    pairs = [(name, BASE) for name in PUBLISHED_PIECES] + [(name, NO_END) for name in OF_TWO]
    labels = {name: name.removeprefix(f"{BASE}-") for name in PUBLISHED_PIECES} | {BASE: "t1tl as published"}
    curve = {BASE: (published_widths.FRAMES, published_widths.ZONE["T1TL 16"])}
    few = {name: run for name, run in runs.items() if _environments(run) <= FEW_ENVIRONMENTS}
    left_out = [labels[name] for name in runs if name not in few]
    more = (
        f"Not in this table: {', '.join(left_out)}, where all environments time out at once, every few iterations, and "
        "between these only successes end. They count too much in its mean over training and in the difference, too."
    )
    return _joined(
        ablation(pairs, "discounted_return")(runs),
        WIDE_INTERVALS if len(runs) > 1 else "",
        SAME_SEEDS,
        TWO_CHOICES if {NO_END, *OF_TWO} <= runs.keys() else "",
        noise_of_pieces(runs),
        curves_by_frames(few, labels, published_widths.FRAMES, curve) if few else "",
        below.by_frames(few, dict.fromkeys(few, curve[BASE]), published_widths.FRAMES),
        more if left_out else "",
    )


TWO_CHOICES = """timeouts-correlated and timeouts-normalised have correlated noise and normalised advantages beside
time-outs that are no end. They were chosen after the results of the single choices on these seeds had been seen."""

WIDE_INTERVALS = """A difference whose interval holds 0 is not shown to be none: a seed finds the task or does not, so
that intervals are wide. Where all of them do, it is open which choice keeps the program from its curve."""

SAME_SEEDS = """All are on seeds 24 to 35, of which few begin with a critic whose values are below 0. The section that
follows looks at how that goes with who solves the task. On other seeds these runs may come out otherwise."""


def _environments(run: Stored) -> int:
    learner: Any = run.config.learner
    return int(learner.num_envs)


def noise_of_pieces(runs: Mapping[str, Stored]) -> str:
    """Whether the policies' noise is at its limit at the end, and ever was; '' where nothing is known of it."""
    rows, never = [], []
    for name, run in runs.items():
        if "entropy" not in run.metrics:
            continue
        most = MOST_ENTROPY - NEAR
        last = run.metrics["entropy"][:, -last_ones(run.metrics["entropy"].shape[1]) :].mean(axis=1)
        ever = (run.metrics["entropy"] > most).any(axis=1)
        solved = [rate > 0.95 for rate in run.by_seed("success_rate").values()]
        spreads = []
        for kind in (True, False):
            some = [float(entropy) for entropy, done in zip(last, solved, strict=True) if done is kind]
            spreads.append(f"{min(some):.2f} to {max(some):.2f}" if some else "-")
        count = len(run.seeds)
        rows.append(
            (name, f"{sum(solved)}/{count}", f"{ever.sum()}/{count}", f"{(last > most).sum()}/{count}", *spreads)
        )
        if not ever.any():
            never.append(f"{name.removeprefix(f'{BASE}-')} solves {sum(solved)} of {count}")
    if not rows:
        return ""
    heading = (
        *("run", "solved", "seeds whose noise was ever at its limit", "at the end"),
        *("entropy a dimension at the end, solved seeds", "others"),
    )
    said = (
        f"The limit of the noise is an entropy of {MOST_ENTROPY:.3f}, within {NEAR}, as above. Which comes first, "
        "noise that grows or a task that is not found, these figures do not tell."
    )
    if never:
        said += (
            f" Below the limit in every seed: {'; '.join(never)}. So a program may keep its noise from the limit and "
            "still miss the task; in seeds that miss it the noise may grow nearly as far."
        )
    return f"{table(heading, rows)}\n\n{said}"


FOUND = 0.5
"""Success in some iteration of training by which a seed counts as one that has found the task."""


def found_or_not(run: Stored) -> str:
    """How the seeds that have found the task in training end, and what the others do."""
    ends = run.end("discounted_return")
    best = dict(zip(run.seeds, np.nanmax(run.metrics["success_rate"], axis=1).tolist(), strict=True))
    found = [seed for seed in run.seeds if best[seed] > FOUND]
    others = [seed for seed in run.seeds if seed not in found]
    rows = [
        (
            said,
            str(len(seeds)),
            text({seed: ends[seed] for seed in seeds}),
            share({seed: best[seed] for seed in seeds}),
        )
        for said, seeds in ((f"more than {FOUND:.0%} in some iteration", found), ("never that much", others))
        if seeds
    ]
    heading = ("success in training", "seeds", "return at the end", "best success in training")
    said = (
        "Seeds are split by how they came out, so that neither line compares with the published mean; some find the "
        "task late, and others might with more frames. Why they find it so late or not at all is not settled: the next "
        "section changes one choice at a time, and two pairs, of T1TL without pre-training, and the one behind it "
        "(`--only published-more`) looks at the critic that seeds begin with. [Methods](methods.md) lists what of the "
        f"published code is left out{_without_token(run)}."
    )
    return _joined(table(heading, rows), said, noise(run))


def _without_token(run: Stored) -> str:
    """That a run is from before the first token of the window, which the published program has now."""
    learner: Any = run.config.learner
    context = getattr(learner.network, "context", None)
    late = context is not None and context.first_token == "none"
    return ", and this run is also without the first token of the window, which came later" if late else ""


MOST_STD = math.log1p(math.e) + MINIMUM_STD
"""The largest standard deviation that the published policy can have."""

MOST_ENTROPY = 0.5 * math.log(2 * math.pi * math.e) + math.log(MOST_STD)
"""Its entropy, of one dimension of the action."""

NEAR = 0.01
"""So far from the largest entropy counts as being there."""


def noise(run: Stored) -> str:
    """Successes until a seed has found the task, while its policy's noise was at its limit and while it was not.

    '' for a run whose entropy is not known.
    """
    if "entropy" not in run.metrics:
        return ""
    rows, totals = [], np.zeros(4)
    for index, seed in enumerate(run.seeds):
        names = ("success_rate", "episodes", "entropy")
        success, episodes, entropy = (np.nan_to_num(run.metrics[name][index]) for name in names)
        found = np.flatnonzero(success > FOUND)
        before = np.arange(len(success)) < (found[0] if len(found) else len(success))
        most = entropy > MOST_ENTROPY - NEAR
        counts = [float(of[before & there].sum()) for there in (~most, most) for of in (episodes, success * episodes)]
        when = f"{run.metrics['frames'][index, found[0]] / 1e6:.1f} M" if len(found) else "never"
        rows.append((str(seed), when, *_of(*counts[:2]), *_of(*counts[2:])))
        totals += counts if not len(found) else 0
    heading = ("seed", "finds it", "noise below its limit: episodes", "that succeed", "at it: episodes", "that succeed")
    (below, lucky), (at, late) = _of(*totals[:2]), _of(*totals[2:])
    said = (
        f"The policy's standard deviation is at most {MOST_STD:.3f} (entropy {MOST_ENTROPY:.3f} a dimension; within "
        f"{NEAR} of that is called its limit). Counted are episodes before a seed has found the task. In the seeds "
        f"that never do, {lucky} of {below} episodes succeeded with less noise and {late} of {at} at the limit. What "
        "may drive the noise there is looked into below (`--only published-more`)."
    )
    return f"{table(heading, rows)}\n\n{said}"


def _of(episodes: float, successes: float) -> tuple[str, str]:
    return f"{episodes:,.0f}", f"{successes:,.0f}"


def _joined(*parts: str) -> str:
    return "\n\n".join(part for part in parts if part)
