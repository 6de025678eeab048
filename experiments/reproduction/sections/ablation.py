"""Runs that differ in one thing, side by side: how fast they learn, where they end, and what that took."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

import numpy as np

from experiments.reproduction.cells import COST, cost, median_frames, share, solved, text
from experiments.reproduction.claims import differences
from experiments.reproduction.measures import delayed, frames_before, frames_to
from experiments.reproduction.page import commit, paragraph, table
from experiments.reproduction.runs import MADE_AGAIN, ZONE_FRAMES, again_name
from experiments.reproduction.sections.settings import chosen, settings
from experiments.reproduction.stored import Stored
from t2tl_jax.evaluation.comparisons import Pairs

Unit = Literal["success_rate", "discounted_return"]

WORDS = {"success_rate": "success", "discounted_return": "return"}

CODES_NOTE = """Movement of codes: how far the open rows' codes are from where the target network has them, over their
own size. Target lag: by how much the target network's values differ from the online ones. Both are means over steps."""

EVERY = "-every-step"
"""Ending of the names of runs with a gradient step after every step."""

TOO_HIGH = " So it probably values too highly what it does not reach, until steps are small."

PRETRAINING_NOTE = """With pre-training on the axis, its frames count like those of the world though they are of a world
of one state: nothing succeeds in them, and as many frames are cut off at the end."""


def ablation(
    pairs: Pairs, unit: Unit, claims: Pairs = (), codes: bool = False, pretraining: bool = False
) -> Callable[[Mapping[str, Stored]], str]:
    """A section of runs side by side, and of pairs of them by the mean of `unit` over training.

    Args:
        pairs: names of two runs each, all that are planned.
        unit: what is compared: the area under its curve.
        claims: those of the pairs of which the paper says that the first run is better.
        codes: whether to show what says why an encoder that learns may stay behind.
        pretraining: whether to compare again with the frames of pre-training on the axis.
    """

    def section(runs: Mapping[str, Stored]) -> str:
        if not runs:
            return ""
        areas = {name: run.area(unit) for name, run in runs.items()}
        columns = [_learning(runs, areas, unit)]
        if pretraining:
            columns.append(_with_pretraining(runs))
        if codes:
            columns.append(_codes(runs))
        columns.append((COST, [cost(run) for run in runs.values()]))
        heading = ("run", *(title for titles, _ in columns for title in titles))
        rows = [(name, *(cell for _, cells in columns for cell in cells[index])) for index, name in enumerate(runs)]
        what = f"mean {WORDS[unit]} over training"
        parts = [table(heading, rows), differences(runs, pairs, areas, what, claims)]
        parts += [settings(runs, pairs), made_again(runs), chosen(runs)]
        if codes:
            parts.append(CODES_NOTE)
        parts.append(small_batches(runs))
        if pretraining:
            late = {name: delayed(run, unit) for name, run in runs.items()}
            parts += [differences(runs, pairs, late, f"{what}, pre-training on the axis", claims), PRETRAINING_NOTE]
        return "\n\n".join(part for part in parts if part)

    return section


def made_again(runs: Mapping[str, Stored]) -> str:
    """Which of the runs are trainings of others once more that are shown elsewhere; '' for none, and for runs of
    several commits or with other budgets than the plan's."""
    again = {name: MADE_AGAIN[name] for name in runs if name in MADE_AGAIN}
    if not again or commits(runs) or any(run.config.frames != ZONE_FRAMES for run in runs.values()):
        return ""
    each = ", ".join(f"`{name}` that of `{first}`" for name, first in again.items())
    return paragraph(f"So that all of these are of one commit, some trainings were made once more: {each}.")


PRINTED_ZONE = ("prime-own", "prime-progression-paper", "prime-labels-state")
"""The default, and the printed progression and labels."""

PRINTED_WATER = ("water-t1tl", again_name("water-t1tl"), "water-t1tl-labels-state")
"""The default, trained twice, and the labels as printed."""


def printed_water(runs: Mapping[str, Stored]) -> str:
    """The labels as printed in WaterWorld, against both trainings of the default, and which commits made them."""
    *defaults, printed = PRINTED_WATER
    compared = ablation([(default, printed) for default in defaults], "success_rate")(runs)
    once = (
        f"{printed} was trained once, so that the two differences are not independent of each other."
        if commits(runs)
        else ""
    )
    return "\n\n".join(part for part in (compared, " ".join((commits(runs), once)).strip()) if part)


def printed_zone(runs: Mapping[str, Stored]) -> str:
    """`printed-zone`: the printed progression and labels beside the default, and the commits that made the runs."""
    default, *printed = PRINTED_ZONE
    compared = ablation([(default, one) for one in printed], "discounted_return")(runs)
    return "\n\n".join(part for part in (compared, commits(runs)) if part)


def commits(runs: Mapping[str, Stored]) -> str:
    """Which commit made each run; '' where it is the same."""
    made = {name: commit(run.versions) for name, run in runs.items()}
    if len(set(made.values())) < 2:
        return ""
    each = ", ".join(f"{name} of {of}" for name, of in made.items())
    return (
        f"These runs are not of one commit: {each}. What the program changed "
        "between the commits is in the differences too, and is not told apart from what is compared."
    )


def small_batches(runs: Mapping[str, Stored]) -> str:
    """What one gradient step after every step of the world does to the values learned; '' where it is not compared."""

    def known(*names: str) -> bool:
        return all("q" in runs[name].metrics for name in names)

    pairs = [(name, f"{name.removesuffix(EVERY)}-per-16") for name in runs if name.endswith(EVERY)]
    return "\n".join(
        _small_batches(runs, small, large) for small, large in pairs if large in runs and known(small, large)
    )


def _small_batches(runs: Mapping[str, Stored], small: str, large: str) -> str:
    def halfway_and_late(name: str, metric: str) -> list[float]:
        values = runs[name].metrics[metric].mean(axis=0)
        return [float(part.mean()) for part in np.array_split(values, 8)[3::4]]  # up to one half, and up to the end

    (q, late_q), (success, late) = (halfway_and_late(small, metric) for metric in ("q", "success_rate"))
    usual, reached = (halfway_and_late(large, metric)[0] for metric in ("q", "success_rate"))
    rates = {runs[name].config.learner.learning_rate for name in (small, large)}  # type: ignore[attr-defined]
    same = "at the same step size" if len(rates) == 1 else "at another step size"
    return (
        f"`{small}` learns from as many samples as `{large}`, in smaller batches, with targets as old in steps of the "
        f"world and {same}; the step size was not searched for. In the eighth before half of the training the values "
        f"of the actions in its batches average {q:.2f} over all open rows, and it succeeds in {success:.2f} of its "
        f"episodes (the other: {usual:.2f} and {reached:.2f}); in the last eighth, where the step size falls to 0, "
        f"{late_q:.2f} and {late:.2f}." + (TOO_HIGH if q > usual and success < min(reached, late) else "")
    )


Columns = tuple[tuple[str, ...], Sequence[tuple[str, ...]]]
"""Titles, and the cells of each run."""


def _learning(runs: Mapping[str, Stored], areas: Mapping[str, Mapping[int, float]], unit: Unit) -> Columns:
    show = share if unit == "success_rate" else text
    titles = (
        "solved",
        f"mean {WORDS[unit]} over training",
        f"{WORDS[unit]} at the end",
        "violations at the end",
        "seeds that stay over 95 %",
        "frames to 95 %, median",
    )
    cells = []
    for name, run in runs.items():
        reached = list(frames_to(run).values())
        cells.append(
            (
                solved(run),
                show(areas[name]),
                show(run.end(unit)),
                share(run.end("violation_rate")),
                f"{sum(np.isfinite(reached))}/{len(reached)}",
                median_frames(reached),
            )
        )
    return titles, cells


def _codes(runs: Mapping[str, Stored]) -> Columns:
    """How much the codes move under the learner, how old its targets are, and how fast the encoder learns."""
    titles = (
        "encoder's learning rate",
        "movement of codes, training",
        "at the end",
        "target lag, training",
        "at the end",
    )

    def mean(run: Stored, name: str, ending: bool) -> str:
        if name not in run.metrics:
            return "-"
        return text(run.end(name) if ending else run.area(name))

    return titles, [
        (
            encoder_rate(run),
            mean(run, "code_change_relative", False),
            mean(run, "code_change_relative", True),
            mean(run, "target_lag", False),
            mean(run, "target_lag", True),
        )
        for run in runs.values()
    ]


def encoder_rate(run: Stored) -> str:
    """The learning rate of a run's task encoder at the start, or why it has none."""
    learner: Any = run.config.learner  # both learners of the paper have what is read here
    encoder = learner.task_encoder
    if encoder is None or not encoder.learned:
        return "nothing to learn"
    if learner.network.freeze_task_encoder:
        return "frozen"
    own, rest = learner.task_encoder_learning_rate, learner.learning_rate
    return f"{rest:g}, as the rest" if own is None or own == rest else f"{own:g}, the rest {rest:g}"


def _with_pretraining(runs: Mapping[str, Stored]) -> Columns:
    cells = []
    for run in runs.values():
        before = frames_before(run)
        reached = [] if before is None else [before + frames for frames in frames_to(run).values()]
        cells.append((median_frames(reached),))
    return ("the same with those of pre-training",), cells
