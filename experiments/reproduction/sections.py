"""What each item says: the tables of the page, made from its runs."""

from collections.abc import Callable, Mapping

import numpy as np

from experiments.paper import published_water, step_tables
from experiments.paper.published_curves import ZONE_CURVES
from experiments.reproduction import runs as named
from experiments.reproduction.page import table
from experiments.reproduction.stored import Stored
from experiments.reproduction.tables import (
    curves_by_episode,
    curves_by_frames,
    differences,
    methods,
    share,
    text,
)
from experiments.reproduction.work import READING
from t2tl_jax.evaluation.comparisons import Pairs
from t2tl_jax.evaluation.scores import best_scores, normalised_scores, return_by_episode
from t2tl_jax.evaluation.statistics import Estimate
from t2tl_jax.runs.folder import read_json
from t2tl_jax.runs.success import success_since, window

Runs = Mapping[str, Stored]

ZONE_MARKS = tuple(1e6 * x for x in (0.5, 1, 1.5, 2, 2.5, 3, 4, 5, 6, 7, 8, 9, 10))


def zone_figure(runs: Runs) -> str:
    """Final figures, curves by frames, and the order of the published curves at their end."""
    labels = {f"zone-{method}": method for method in named.ZONE_METHODS}
    published = {
        f"zone-{method}": ZONE_CURVES[f"{name} (published)"]
        for method, name in (
            ("t2tl", "T2TL_pre"),
            ("t1tl", "T1TL_pre"),
            ("gnn", "GNN_pre"),
            ("dfa_number", "DFA"),
            ("dfa_cont", "DFA_cont"),
        )
    }
    ends = {name: run.end("discounted_return") for name, run in runs.items()}
    claims = [
        ("zone-t2tl", "zone-t1tl"),
        ("zone-t1tl", "zone-gnn"),
        ("zone-gnn", "zone-dfa_number"),
        ("zone-gnn", "zone-dfa_cont"),
    ]
    return "\n\n".join(
        (
            methods(runs, labels, {name: curve[1][-1] for name, curve in published.items()}),
            curves_by_frames(runs, labels, ZONE_MARKS, published),
            differences(runs, claims, ends, "return at the end", claimed=True),
        )
    )


def water_figure(runs: Runs) -> str:
    """Final figures, curves by episode, and their order by the mean return at the published episodes."""
    labels = {f"water-{method}": method for method in named.WATER_METHODS}
    marks = published_water.EPISODES
    means = {
        name: {seed: float(np.nanmean(return_by_episode(run.columns, seed, marks))) for seed in run.seeds}
        for name, run in runs.items()
    }
    claims = [(f"water-{reader}", f"water-{state}") for reader in ("t2tl", "t1tl", "gnn") for state in ("rm", "dfa")]
    claims += [("water-t1tl", "water-gnn"), ("water-t2tl", "water-gnn"), ("water-rm", "water-dfa")]
    return "\n\n".join(
        (
            methods(runs, labels),
            curves_by_episode(runs, labels, marks, published_water.PHI_WATER),
            differences(runs, claims, means, "mean return at these episodes", claimed=True),
        )
    )


def steps(runs: Runs) -> str:
    """Steps on success within each limit, beside the rate of success that they are an average over."""
    parts = []
    for title, cells, same_maps in (
        ("Sub-goals", step_tables.BY_GOALS, False),
        ("Obstacles", step_tables.BY_OBSTACLES, False),
        ("Size of the obstacles", step_tables.BY_SIZE, True),
    ):
        rows = []
        for cell in cells:
            for method in named.STEP_METHODS:
                name = named.step_name(cell, same_maps, method)
                if name not in runs:
                    continue
                mean, spread = cell.published[method]
                row = [f"{cell.goals} goals, {cell.obstacles} obstacles, {cell.size:g}x", method]
                for limit in step_tables.LIMITS:
                    row += [
                        text(runs[name].by_seed("success_length", limit=limit), 1),
                        share(runs[name].by_seed("success_rate", limit=limit)),
                    ]
                rows.append([*row, f"{mean:.1f} ± {spread:.1f}"])
        heading = ["world", "method"]
        for limit in step_tables.LIMITS:
            heading += [f"steps on success, {limit}", f"success, {limit}"]
        if rows:
            parts.append(f"**{title}** (final parameters, sampled policy)\n\n{table([*heading, 'published'], rows)}")
    return "\n\n".join(parts)


def reward_sum(run: Stored) -> dict[int, float]:
    """Sum of the undiscounted rewards of all episodes of a training, by seed: formulas pay +1 and -1 at the end."""
    counts = np.nan_to_num(run.metrics["episodes"])
    rates = np.nan_to_num(run.metrics["success_rate"]) - np.nan_to_num(run.metrics["violation_rate"])
    return dict(zip(run.seeds, (counts * rates).sum(axis=1).tolist(), strict=True))


UNIT_PUBLISHED = {
    "zone-t2tl": "12.21 ± 7.16",
    "zone-t1tl": "11.09 ± 7.46",
    "zone-gnn": "9.60 ± 5.85",
    "zone-dfa_cont": "3.12 ± 2.80",
    "zone-dfa_number": "6.61 ± 5.63",
    "water-t2tl": "1.96 ± 0.08",
    "water-t1tl": "2.60 ± 0.05",
    "water-gnn": "1.95 ± 0.03",
    "water-rm": "2.20 ± 0.20",
    "water-dfa": "2.02 ± 0.52",
}
"""Reward per unit time as printed: 0.01 per minute in ZoneEnv, per minute in WaterWorld."""


def unit_time(runs: Runs) -> str:
    """Reward over the time of one seed alone on the device, its pre-training counted, without and with compiling."""
    rows = []
    for name, run in runs.items():
        alone = runs.get(f"{name}-alone")
        if alone is None:
            continue
        world, _, method = name.partition("-")
        reader = {"t2tl": "transformer", "t1tl": "transformer", "gnn": "gnn"}.get(method)
        before = runs.get(f"{world}-pretraining-{reader}-alone")
        if reader is not None and before is None:
            continue
        both = [one for one in (alone, before) if one is not None]
        seconds = sum(one.train_seconds for one in both)
        compiling = sum(one.compile_seconds for one in both)
        rewards = reward_sum(run)
        rows.append(
            (
                name,
                text(rewards, 0),
                f"{seconds:.0f} s",
                f"{compiling:.0f} s",
                text({seed: 60 * value / seconds for seed, value in rewards.items()}, 0),
                text({seed: 60 * value / (seconds + compiling) for seed, value in rewards.items()}, 0),
                UNIT_PUBLISHED.get(name, "-"),
            )
        )
    heading = (
        "run",
        "sum of rewards",
        "time of one seed alone",
        "compile",
        "per minute",
        "per minute, with compiling",
        "published",
    )
    note = (
        "The published unit is not known (the paper's R_i cannot be what its curves show), so only orders compare.\n"
        "Pre-training and training compile side by side in use; here their seconds are added."
    )
    return f"{table(heading, rows)}\n\n{note}" if rows else ""


def dimensions(runs: Runs) -> str:
    """What a width of the code comes to."""
    rows = [
        (
            name,
            _width(run),
            text(run.end("discounted_return")),
            text(run.area("discounted_return")),
            share(run.end("success_rate")),
        )
        for name, run in runs.items()
    ]
    return table(("run", "code", "return at the end", "mean return", "success at the end"), rows)


def _width(run: Stored) -> str:
    encoder = run.config.learner.task_encoder
    return str(getattr(encoder, "output", getattr(encoder, "size", "-")))


def frames_to(run: Stored) -> dict[int, float]:
    """Frames after which success in training rose above 95 % and stayed, for a time limit at least; inf if never."""
    since = success_since(run.metrics["success_rate"], window(run.config))
    frames = run.metrics["frames"][0][0]
    return dict(zip(run.seeds, np.where(since > 0, since * frames, np.inf).tolist(), strict=True))


def ablation(pairs: Pairs, unit: str, claimed: bool = False) -> Callable[[Runs], str]:
    """A section of runs side by side, and of these pairs of them by the mean of `unit` over training."""

    def section(runs: Runs) -> str:
        areas = {name: run.area(unit) for name, run in runs.items()}
        show = share if unit == "success_rate" else text
        rows = []
        for name, run in runs.items():
            reached = list(frames_to(run).values())
            median, solved = np.median(reached), run.solved()
            rows.append(
                (
                    name,
                    "-" if solved.value is None else f"{round(solved.value * solved.count)}/{solved.count}",
                    show(areas[name]),
                    show(run.end(unit)),
                    share(run.end("violation_rate")),
                    f"{median / 1e6:.2f} M" if np.isfinite(median) else "-",
                    f"{sum(np.isfinite(reached))}/{len(reached)}",
                    text(run.end("code_change_relative")) if "code_change_relative" in run.metrics else "-",
                )
            )
        heading = (
            "run",
            "solved",
            "mean over training",
            "at the end",
            "violations at the end",
            "frames to 95 %, median",
            "seeds that stay there",
            "movement of codes",
        )
        what = {"success_rate": "success", "discounted_return": "return"}[unit]
        compared = differences(runs, pairs, areas, f"mean {what} over training", claimed)
        return "\n\n".join(part for part in (table(heading, rows), compared) if part)

    return section


def benchmark(runs: Runs) -> str:
    """Normalised score at the published marks, mean over maps, of the ten tasks; return per step of the single one."""
    marks = published_water.STEPS
    ten = {name: run for name, run in runs.items() if "best_score_10" in run.columns}
    rows = []
    best = {number: 1.0 / np.array(steps) for number, steps in published_water.BEST_STEPS.items()}
    for run in ten.values():
        for seed, scores in best_scores(run.columns, 10).items():
            if seed in best:
                best[seed] = np.maximum(best[seed], scores)
    for name, run in ten.items():
        curves = []
        for seed in run.seeds:
            if seed in best:
                steps, scores = normalised_scores(run.columns, seed, best[seed])
                curves.append(np.interp(marks, steps, scores, right=np.nan))
        if curves:
            rows.append([name, *(text(column.tolist(), 2) for column in np.stack(curves).T)])
    for name, (mean, deviation) in published_water.SCORES.items():
        rows.append([f"{name}, published", *(f"{m:.2f} ± {d:.2f}" for m, d in zip(mean, deviation, strict=True))])
    parts = [table(["ten tasks", *(f"{mark // 1000} k" for mark in marks)], rows)]
    single = {name: run for name, run in runs.items() if name not in ten}
    rows = [
        [name, share(run.end("success_rate")), share(run.area("success_rate")), text(run.end("length"), 1)]
        for name, run in single.items()
    ]
    parts.append(table(("single task", "success at the end", "mean success", "steps at the end"), rows))
    return "\n\n".join(part for part in parts if part)


def safe(runs: Runs) -> str:
    """Success and violations of every method on `phi_safe`."""
    rows = [
        (
            name.removeprefix("safe-"),
            share(run.by_seed("success_rate")),
            share(run.by_seed("violation_rate")),
            share(run.end("violation_rate")),
            text(run.by_seed("discounted_return")),
        )
        for name, run in runs.items()
        if "pretraining" not in name
    ]
    return table(("method", "success, final", "violations, final", "violations, training", "return, final"), rows)


def attention(runs: Runs) -> str:
    """Token*, the token that the policy needs, whether these are one, and what is entered first; over seeds."""
    rows = []
    for name, run in runs.items():
        for stage, found in read_json(run.path / READING)["over_seeds"].items():
            black = Estimate(**found["first"]["Black"]).text(2) if "Black" in found["first"] else "-"
            rows.append(
                (
                    f"{name}, {stage}",
                    _counted(found["token_star"]),
                    _counted(found["needed_token"]),
                    Estimate(**found["agreement"]).text(2),
                    Estimate(**found["agreement_over_rows"]).text(2),
                    Estimate(**found["rank_correlation"]).text(2),
                    black,
                )
            )
    heading = (
        "run",
        "token*, seeds",
        "needed token, seeds",
        "agree, whole task",
        "agree, all sub-tasks",
        "rank correlation",
        "episodes that enter Black first",
    )
    note = "Published, one agent: token* is the conjunction at the start (1.02) and Black at the end (1.67)."
    return f"{table(heading, rows)}\n\n{note}"


def _counted(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{token.partition(': ')[2]} {count}" for token, count in counts.items()) or "-"


def published_program(runs: Runs) -> str:
    """The published program beside the curve that it is said to have made."""
    labels = {"zone-published": "t2tl as published"}
    published = {"zone-published": ZONE_CURVES["T2TL_pre (published)"]}
    return "\n\n".join(
        (methods(runs, labels, {"zone-published": 0.68}), curves_by_frames(runs, labels, ZONE_MARKS, published))
    )
