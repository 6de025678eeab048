"""ql in the published form, plain and shaped: trainings that were cut shortly before their end."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from experiments.paper import published_water
from experiments.reproduction import stored
from experiments.reproduction.cells import text
from experiments.reproduction.claims import differences
from experiments.reproduction.page import made_by, paragraph, table
from experiments.reproduction.sections import ten_tasks
from experiments.reproduction.stored import Stored

CUT = {f"rm-{kind}{ten_tasks.FORM}": f"rm_{kind}_published_cut" for kind in ("ql", "ql_shaped")}
"""By the name of the whole run the folder of the cut one, among those of WaterWorld."""

NOTE = """Both were cut when the time on their machine was up, after {}. Nothing was evaluated. Nothing but the
share of random actions follows a schedule in this form, and that has fallen to its end after 200,000 steps, so that up
to the cut the curves are those of whole trainings. Scores are normalised with the best episodes of these runs and of
the four usual ones, so that they can differ a little from those of [the benchmark](#the-reward-machine-benchmark)."""


def published_ql(results: Path) -> str:
    """Their curves beside the published ones, and beside ql with our settings."""
    cut = {name: Stored(results / "water_h200" / folder) for name, folder in CUT.items()}
    usual = {name: run for name, run in stored.load(results / "paper").items() if name in ten_tasks.TEN}
    curves = ten_tasks.scores(usual | cut)
    own = {name: curves[name] for name in cut}
    reached = int(np.isfinite(np.mean([list(of.values()) for of in own.values()], axis=(0, 1))).sum())
    marks = published_water.STEPS[:reached]
    rows = [(name, *_cells(of, reached)) for name, of in own.items()]
    for name in cut:
        kind = ten_tasks.KINDS[name]
        every = zip(*(of[:reached] for of in published_water.SCORES[kind]), strict=True)
        rows.append((f"{kind}, published", *(f"{mean:.2f} ± {deviation:.2f}" for mean, deviation in every)))
    means = {name: {seed: float(curve[:reached].mean()) for seed, curve in of.items()} for name, of in curves.items()}
    pairs = [(name, name.removesuffix(ten_tasks.FORM)) for name in cut]
    where = " and ".join(f"{int(run.columns['frames'].max()):,}" for run in cut.values())
    asked = next(iter(cut.values())).config.frames
    parts = (
        paragraph(NOTE.format(f"{where} of {asked:,} steps")),
        table(["ten tasks: normalised score", *(f"{mark // 1000:,} k" for mark in marks)], rows),
        paragraph(f"{ten_tasks.behind(own)} {_gaps(own, reached)}".replace("\n", " ")),
        differences(usual | cut, pairs, means, "mean normalised score at these steps"),
        made_by([*cut.values()]),
    )
    return "\n\n".join(part for part in parts if part)


def _cells(curves: Mapping[int, np.ndarray], reached: int) -> list[str]:
    return [text(at.tolist(), 2) for at in np.transpose(list(curves.values()))[:reached]]


def _gaps(own: Mapping[str, Mapping[int, np.ndarray]], reached: int) -> str:
    """How far the means are from the published ones, above and below."""
    said = []
    for name, of in own.items():
        published = np.array(published_water.SCORES[ten_tasks.KINDS[name]][0])[:reached]
        gaps = np.mean(list(of.values()), axis=0)[:reached] - published
        said.append(f"{name} from {gaps.min():+.3f} to {gaps.max():+.3f}")
    return f"These means differ from the published ones: {'; '.join(said)}."
