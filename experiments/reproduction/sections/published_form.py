"""The published form of crm's single task, whose training was cut, beside the runs that it is to explain."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from experiments.paper import published_water
from experiments.reproduction.page import fitting, made_by, paragraph
from experiments.reproduction.sections.benchmark import (
    FORM,
    FORM_NOTE,
    SLOW,
    greatest_scores,
    recent,
    rewarded,
    scored,
    settings,
)
from experiments.reproduction.stored import Stored

CUT = "rm_single_crm_published_cut"
"""Its folder, among those of WaterWorld."""

USUAL = "rm-single-crm"


def published_form(results: Path) -> str:
    """What it came to until it was cut, at the published steps."""
    cut = Stored(results / "water_h200" / CUT)
    others = {name: Stored(results / "paper" / name) for name in (USUAL, f"{USUAL}{SLOW}")}
    runs = {f"{USUAL}{FORM}": cut, **others}
    reached, asked = int(cut.columns["frames"].max()), cut.config.frames
    note = f"""
        This run is missing from the tables of the benchmark, since it did not end: its machine was lost after
        {reached:,} of {asked:,} steps on each map. So nothing is known of its end, and nothing was evaluated. A dash
        stands for steps that it did not reach."""
    tables = (fitting(text) for text in (scored(runs), rewarded(runs)))
    parts = (paragraph(note), *tables, paragraph(at_the_last_step(runs)), paragraph(FORM_NOTE), fitting(settings(runs)))
    return "\n\n".join((*parts, made_by(list(runs.values()))))


def at_the_last_step(runs: Mapping[str, Stored]) -> str:
    """Score and paid episodes at the last step that all runs reached and of which both are published."""
    steps, marks = list(published_water.STEPS), list(published_water.SINGLE_STEPS)
    scores = {name: greatest_scores(run) for name, run in runs.items()}
    paid = {name: recent(run, marks, "total_reward") for name, run in runs.items()}
    mark = max(
        mark
        for mark in {*steps} & {*marks}
        if all(np.isfinite(of[:, steps.index(mark)]).all() for of in scores.values())
    )
    k, at = steps.index(mark), marks.index(mark)
    each = [f"{scores[name][:, k].mean():.2f} and {paid[name][:, at].mean():.3f} ({name})" for name in runs]
    published = published_water.SINGLE_SCORES["crm"][0][k], published_water.SINGLE_REWARDED["crm"][at]
    return f"""
        Greatest possible score and share of episodes that pay after {mark:,} steps: {", ".join(each)}; published
        {published[0]:.2f} and {published[1]:.3f}. How much of what is missing the published form makes up for, and by
        which of its parts, ten maps and a cut run do not tell."""
