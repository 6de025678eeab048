"""The ten tasks of the reward-machine benchmark: normalised scores beside the published ones."""

from collections.abc import Mapping, Sequence

import numpy as np

from experiments import tuning
from experiments.paper import published_water
from experiments.reproduction import below
from experiments.reproduction.cells import text
from experiments.reproduction.claims import differences
from experiments.reproduction.page import paragraph, table
from experiments.reproduction.sections.settings import again_searched
from experiments.reproduction.stored import Stored
from t2tl_jax.evaluation.comparisons import Pairs
from t2tl_jax.evaluation.scores import best_scores, normalised_scores

TEN = {"rm-ql": "ql", "rm-crm": "crm", "rm-ql_shaped": "ql-rs", "rm-crm_shaped": "crm-rs"}
"""Runs by the published names; rs is reward shaping."""

CLAIMS = [("rm-crm", "rm-ql"), ("rm-crm_shaped", "rm-ql_shaped")]
"""Learning every state's experience is better, as the paper of reward machines has it."""

PAIRS = [
    *CLAIMS,
    ("rm-crm", "rm-crm_shaped"),
    ("rm-ql", "rm-ql_shaped"),
    ("rm-ql-published", "rm-ql"),
    ("rm-ql_shaped-published", "rm-ql_shaped"),
]

FORM = "-published"
"""Ending of the name of a run that has the published network, learning rate and clipping."""

KINDS = TEN | {f"rm-ql{FORM}": "ql", f"rm-ql_shaped{FORM}": "ql-rs"}
"""All runs of the ten tasks by the published ones that they stand beside."""

SEARCHED = """Learning rates were first not searched for alike: ql's was chosen among four on maps {}, which are
reported too; crm's was there before, and on which maps it was chosen is not recorded; neither was searched again for
shaped rewards. {} Without the maps of ql's first search:"""

OTHERWISE = """Width, head, learning rate and clipping of ql and ql_shaped are not the published ones (see below)."""

CUT = """Both were trained in the published form too, nearly to the end:
[below](#ql-in-the-published-form-as-far-as-it-went)."""


def is_one(run: Stored) -> bool:
    """Whether it learned the ten tasks, whose scores are recorded."""
    return "best_score_10" in run.columns


def ten_tasks(runs: Mapping[str, Stored]) -> list[str]:
    """Scores at the published steps, where and how far they are below, and the orders; nothing without runs."""
    if not runs:
        return []
    marks, curves = published_water.STEPS, scores(runs)
    rows = [[name, *(text(at.tolist(), 2) for at in np.transpose(list(of.values())))] for name, of in curves.items()]
    for published in TEN.values():
        each = zip(*published_water.SCORES[published], strict=True)
        rows.append([f"{published}, published", *(f"{mean:.2f} ± {deviation:.2f}" for mean, deviation in each)])
    return [
        table(["ten tasks: normalised score", *thousands(marks)], rows),
        behind(curves),
        how_far_behind(curves),
        order(runs, PAIRS, CLAIMS),
        _on_other_maps(runs, _means(curves)),
    ]


def _on_other_maps(runs: Mapping[str, Stored], means: Mapping[str, Mapping[int, float]]) -> str:
    """The same on the maps that no search is known to have had, since ql's learning rate was chosen on some of them."""
    searched = tuning.TUNED["rm_water_ql"].seeds
    others = {name: {seed: of[seed] for seed in of if seed not in searched} for name, of in means.items()}
    found = differences(runs, PAIRS, others, "the same, on maps without ql's search", CLAIMS)
    said = paragraph(
        SEARCHED.format(tuning.in_words(searched), again_searched("rm", "All runs whose names have no ending"))
    )
    return f"{said}\n\n{found}" if found else ""


def scores(runs: Mapping[str, Stored]) -> dict[str, dict[int, np.ndarray]]:
    """Normalised score at the published steps, ``float[steps]`` by run and map; NaN after the end of a training.

    The best episode of any method, published or here, counts as 1. Maps without published scores are left out.
    """
    best = {number: 1.0 / np.array(steps) for number, steps in published_water.BEST_STEPS.items()}
    for run in runs.values():
        for seed, own in best_scores(run.columns, 10).items():
            if seed in best:
                best[seed] = np.maximum(best[seed], own)
    found: dict[str, dict[int, np.ndarray]] = {name: {} for name in runs}
    for name, run in runs.items():
        for seed in run.seeds:
            if seed in best:
                steps, curve = normalised_scores(run.columns, seed, best[seed])
                found[name][seed] = np.interp(published_water.STEPS, steps, curve, right=np.nan)
    return {name: curves for name, curves in found.items() if curves}


def behind(curves: Mapping[str, Mapping[int, np.ndarray]], kinds: Mapping[str, str] = KINDS) -> str:
    """Where a mean of `scores` is below the published one, and whether that lies in its interval; '' for nowhere.

    Args:
        curves: see `scores`.
        kinds: runs by the published ones that they stand beside.
    """
    return below.listed(
        {
            name: below.marks(np.array(list(curves[name].values())), published_water.STEPS, *means[:1])
            for name, means in ((name, published_water.SCORES[published]) for name, published in kinds.items())
            if name in curves
        },
        "after {} steps",
    )


def order(runs: Mapping[str, Stored], pairs: Pairs, claims: Pairs = ()) -> str:
    """Differences between runs of the ten tasks by the mean of their scores at the published steps."""
    runs = {name: run for name, run in runs.items() if is_one(run)}
    return differences(runs, pairs, _means(scores(runs)), "mean normalised score at these steps", claims)


def _means(curves: Mapping[str, Mapping[int, np.ndarray]]) -> dict[str, dict[int, float]]:
    return {name: {seed: float(curve.mean()) for seed, curve in of.items()} for name, of in curves.items()}


def how_far_behind(curves: Mapping[str, Mapping[int, np.ndarray]]) -> str:
    """By how much the means of ql are below the published ones at these steps, from the least to the most."""
    each = []
    for name, published in KINDS.items():
        if name in curves and "ql" in name:
            gaps = np.array(published_water.SCORES[published][0]) - np.mean(list(curves[name].values()), axis=0)
            under = gaps[gaps > 0]
            each += [f"{name} {under.min():.3f} to {under.max():.3f}"] if under.size else []
    whole = {f"rm-{kind}{FORM}" for kind in ("ql", "ql_shaped")} <= curves.keys()
    said = f"{OTHERWISE} {'' if whole else CUT}"
    return f"These means are below by: {'; '.join(each)}. {' '.join(said.split())}" if each else ""


def thousands(steps: Sequence[int]) -> list[str]:
    """Numbers of steps for a heading."""
    return [f"{step // 1000:,} k" for step in steps]
