"""What was measured beside the paper's items, from clean commits, and is stored in folders of its own."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments import tuning
from experiments.benchmarks.plans import table as plan_table
from experiments.methods import apply
from experiments.paper.published_curves import ZONE_CURVES
from experiments.reproduction import stored
from experiments.reproduction.anytask import met
from experiments.reproduction.cells import solved, text
from experiments.reproduction.claims import differences
from experiments.reproduction.measures import frames_to
from experiments.reproduction.page import fitting, made_by, origin, paragraph, table
from experiments.reproduction.sections import safe_again, ten_tasks
from experiments.reproduction.sections.benchmark import benchmark
from experiments.reproduction.sections.published_form import published_form
from experiments.reproduction.sections.published_ql import published_ql
from experiments.reproduction.sections.thousand import thousand
from experiments.reproduction.stored import Stored
from experiments.reproduction.tables import curves_by_frames, methods
from t2tl_jax.evaluation.statistics import SOLVED, brackets
from t2tl_jax.registry import named_config
from t2tl_jax.runs.differences import differences as changes
from t2tl_jax.runs.folder import read_json

SHORT = "zone_short_h200"
"""The folder of the short schedule's runs."""

FRESH = ("t2tl", "t1tl")
"""The runs of the short schedule as it is, on seeds that nothing was tuned on."""

SHORT_MARKS = tuple(1e6 * x for x in (0.5, 1, 1.5, 2, 2.5, 3))

CORRECTIONS = {
    "t1_base": "t1tl, nothing",
    "t1_positions": "no positions: `--learner.network.task-encoder.positions none`",
    "t1_masked": "padding counts: `--learner.network.task-encoder.masked False`",
    "t1_terminal": "a time-out is an end: `--learner.timeout-is-terminal True`",
    "t2_base": "t2tl, nothing",
    "t2_aligned": "windows misaligned, and no segments: `--learner.network.context.aligned False "
    "--learner.network.context.segment-length 1`",
    "t2_reset": "window never emptied: `--learner.network.context.reset False`",
    "t2_recompute": "stored embeddings: `--learner.network.context.recompute False`",
    "t2_terminal": "a time-out is an end: `--learner.timeout-is-terminal True`",
    "t2_target": "pre-trained on the task itself: `--pretrained auto:phi_zone`",
    "t2_none": "no pre-training: `--pretrained ''`",
}
"""What each stored run has as the authors' code has it."""


@dataclass(frozen=True)
class Measurement:
    """A section of the page."""

    title: str
    commands: tuple[str, ...]
    section: Callable[[Path], str]
    """The folder with all stored results -> its Markdown, without title and commands."""
    picture: str = ""
    """The name of the picture that it shows."""


def short_schedule(results: Path) -> str:
    """When success rose for good, and what came of it, by run."""
    runs = stored.load(results / SHORT)
    rows = [(f"`{name}`", *_short_row(run)) for name, run in runs.items()]
    heading = (
        *("run", "beside the default", "seeds", "frames at most", "stay over 95 %"),
        *("since frames, median / last", "return, training", "over 95 %, final parameters", "best parameters"),
    )
    note = """
        The default of `zone_ppo`: 256 environments x 128 steps and minibatches of 2,048, after pre-training on the
        task. *Stay over 95 %*: seeds whose success in training is above it from some iteration to the end, for at least
        one time limit. *Over 95 %*: seeds in evaluations of final and of best parameters, with the deterministic / the
        sampled policy. The `..._solved` runs ended when success in training had stayed above 95 % for a time limit,
        which is a sign of a solved task: the evaluation decides. Settings were chosen on seeds from 100 on, in runs
        that are not kept. A deterministic policy has one episode a seed on this map."""
    fresh = {name: runs[name] for name in FRESH}
    published = {name: ZONE_CURVES[f"{name.upper()}_pre (published)"] for name in FRESH}
    curves = curves_by_frames(fresh, {name: name for name in FRESH}, SHORT_MARKS, published)
    lost = paragraph(" ".join(map(_lost, runs, runs.values())))
    parts = (paragraph(note), table(heading, rows), lost, curves, made_by(list(runs.values())))
    return "\n\n".join(part for part in parts if part)


def _lost(name: str, run: Stored) -> str:
    """Which seeds did not rise above 95 %, or did not stay there, and what their final parameters come to; '' for
    none."""
    found = []
    for seed, frames in frames_to(run).items():
        of_seed = run.columns["seed"] == seed
        over = run.columns["success_rate"][of_seed] > SOLVED
        if np.isfinite(frames) or over[-1]:
            continue
        if not over.any():
            found.append(f"Seed {seed} of `{name}` is never above 95 %.")
            continue
        last_frames = run.columns["frames"][of_seed][over][-1]
        told = f"Seed {seed} of `{name}` does not stay there: it is above 95 % for the last time after "
        rate = run.by_seed("success_rate").get(seed)
        steps = run.by_seed("success_length", policy="deterministic").get(seed)
        told += f"{last_frames / 1e6:.2f} M frames"
        told += f", and in the final evaluation {rate:.2f} of its sampled episodes succeed" if rate is not None else ""
        told += f"; its deterministic episode succeeds after {steps:.0f} steps" if steps is not None else ""
        found.append(f"{told}.")
    return " ".join(found)


def _short_row(run: Stored) -> list[str]:
    """What a run of the short schedule changes, when it rose above 95 %, and where it ended."""
    reached = list(frames_to(run).values())
    return [
        ", ".join(f"`{change}`" for change in _changes(run)) or "-",
        tuning.in_words(run.seeds),
        f"{run.config.frames / 1e6:g} M",
        f"{sum(np.isfinite(reached))}/{len(reached)}",
        f"{_millions(float(np.median(reached)))} / {_millions(max(reached))}",
        text(run.end("discounted_return")),
        *(_over(run, which) for which in ("final", "best")),
    ]


def _over(run: Stored, which: str) -> str:
    """How many seeds succeed in over 95 % of the episodes, with the deterministic / the sampled policy."""
    found = [run.by_seed("success_rate", which=which, policy=policy) for policy in ("deterministic", "sampled")]
    counts = [f"{sum(rate > SOLVED for rate in rates.values())}/{len(rates)}" for rates in found if rates]
    return " / ".join(counts) or "-"


def _changes(run: Stored) -> list[str]:
    """Fields in which a run differs from the method of today's `zone_ppo` that it is nearest to."""
    method = "t1tl" if run.config.learner.network.context is None else "t2tl"
    base = apply(named_config("zone_ppo"), method)
    ignored = ("seeds=", "until_solved=", "selection.", "frames=")
    return [change for change in changes(base, run.config) if not change.startswith(ignored)]


def _millions(frames: float) -> str:
    return f"{frames / 1e6:.2f} M" if np.isfinite(frames) else "-"


def corrections(results: Path) -> str:
    """Each correction of the authors' code undone by itself, against the run with all of them."""
    there = stored.load(results / "corrections_h200")
    runs = {name: there[name] for name in CORRECTIONS}
    rows = []
    for name, run in runs.items():
        rates = run.end("success_rate").values()
        over = f"{sum(rate > SOLVED for rate in rates)}/{len(rates)}"
        ends, areas = (text(of("discounted_return")) for of in (run.end, run.area))
        rows.append((f"`{name}`", CORRECTIONS[name], solved(run), over, ends, areas))
    heading = (
        *("run", "as published", "solved", "seeds over 95 %, training"),
        *("return, training", "mean return over training"),
    )
    pairs = [(f"{name[:2]}_base", name) for name in CORRECTIONS if not name.endswith("_base")]
    compared = differences(
        runs, pairs, {name: run.area("discounted_return") for name, run in runs.items()}, "mean return"
    )
    note = """
        `phi_zone` in the closed form, 10 million frames, on seeds that nothing was tuned on. Switches of the formula's
        Transformer are measured on t1tl without pre-training, those of the context on t2tl pre-trained on random
        formulas; padding is up to the longest formula. `phi_zone` says little about some of them: its three formulas
        differ in length, so that a bag of tokens tells them apart, and one fixed map needs no memory. They are
        corrections because the code then does what the paper says. `t2_aligned`, the one that differs from
        its base by more than chance, learns *faster*. It differs in a second thing: steps that read windows of others
        share nothing, so each is drawn by itself, as published, instead of in segments of eight. Which of the two makes
        the difference, or whether both do, is open: aligned windows without segments were not measured on these
        seeds."""
    return "\n\n".join((paragraph(note), table(heading, rows), compared, made_by(list(runs.values()))))


def parallel(results: Path) -> str:
    """The benchmark's ten tasks with 32 environments, by the section of the paper's benchmark."""
    runs = {"rm_parallel": Stored(results / "water_h200" / "rm_parallel")}
    (run,) = runs.values()
    note = f"""
        32 environments and one gradient step after each of their steps: more steps and less time than the authors'
        form, {run.train_seconds:.0f} s of training for {len(run.seeds)} maps and {run.frames:,} steps each. The score
        is normalised by the best of this run and of the authors'. On which maps its learning rate was chosen is not
        recorded."""
    behind = ten_tasks.behind(ten_tasks.scores(runs), dict.fromkeys(runs, "crm"))
    others = paragraph(PARALLEL.format(maps=tuning.in_words(run.seeds))) if behind else ""
    parts = (paragraph(note), benchmark(runs), fitting(behind), others, made_by([run]))
    return "\n\n".join(part for part in parts if part)


PARALLEL = """That is beside the published crm, which likewise learns every state's experience, on maps 1 to 10; these
are maps {maps} alone. After as many steps it has made a thirty-second of the gradient steps, with another batch size
and another learning rate than the published. That may be why it learns less from a step; it was not tested, nor were
other maps."""


QUANTITIES = (("position_mm", "mm", 2), ("velocity_m_s", "m/s", 3), ("turning_rad_s", "rad/s", 2))
"""What is compared at the walls, its unit, and the digits that are shown."""


def walls(results: Path) -> str:
    """How far both physics are from MuJoCo with the original's walls after one step."""
    measured = read_json(results / "walls.json")
    touched, clear = ([row for row in measured["results"] if row["wall"] == wall] for wall in ("touched", "clear"))
    rows = [
        (
            row["physics"],
            *(f"{row[name]['median']:.{d}f} / {row[name]['p95']:.{d}f} {unit}" for name, unit, d in QUANTITIES),
            ", ".join(_ends(row[name]["median_interval"], d) for name, _, d in QUANTITIES),
        )
        for row in touched
    ]
    settings = measured["config"]
    largest = ", ".join(f"{max(row[name]['p95'] for row in clear):.0e} {unit}" for name, unit, _ in QUANTITIES)
    note = f"""
        How far both physics are from MuJoCo with the original's 204 cubes after one environment step (20 ms), median /
        95 %, over the {touched[0]["states"]:,} steps in which the robot touched a wall, of {settings["episodes"]}
        episodes of {settings["steps"]} steps. The original drives: from rest at a random place and heading, under
        actions drawn uniformly and held for a second on average. Intervals are 95 %, of the medians, by resampling
        whole episodes. In the other {clear[0]["states"]:,} steps 95 % of the differences are below {largest} in every
        row. One Newton step is what the environment takes; what is left with twenty is the model's (planes, no
        torsional friction, two points for the front of the robot), not the solver's."""
    heading = ("physics", "position", "velocity", "turning rate", "intervals of the medians")
    return "\n\n".join((paragraph(note), table(heading, rows), origin([measured["where"]])))


def plans(results: Path) -> str:
    """What a plan was worth to a stored agent."""
    file = results / "plans.json"
    if not file.is_file():
        return "Not measured yet."
    measured = read_json(file)
    count, seeds = measured["episodes"], measured["seeds"]
    note = f"""
        {len(seeds)} agent{"s" * (len(seeds) > 1)} of `{measured["run"]}` (seed {tuning.in_words(seeds)}), {count:,}
        episodes of at most {measured["episode_length"]} steps for each formula and policy:
        `python -m experiments.benchmarks.plans {measured["run"]} --json results/plans.json`."""
    parts = (paragraph(note), plan_table(measured), _met_of_plans(results, measured), origin([measured["where"]]))
    return "\n\n".join(part for part in parts if part)


def _met_of_plans(results: Path, measured: Mapping[str, Any]) -> str:
    """How many open rows of the formulas training met; '' where that was counted of none of them."""
    shares = met.read(results / "any" / Path(measured["run"]).name)
    told = [
        f"{task} {exactly}, {renamed}" for task in measured["tasks"] for exactly, renamed in [met.cells(shares, task)]
    ]
    known = [one for one in told if not one.endswith("-, -")]
    if not known:
        return ""
    others = " Of the other formulas that was not counted." if len(known) < len(told) else ""
    return paragraph(f"Open rows that training met, and up to names: {'; '.join(known)}.{others}")


def _ends(interval: list[float], digits: int) -> str:
    low, high = interval
    return brackets(low, high, digits)


def safe_before(results: Path) -> str:
    """What the settings of `phi_zone` came to on `phi_safe`."""
    run = Stored(results / "zone_safe_h200" / "t1tl")
    note = """
        Before `zone_ppo_safe` had settings of its own: every episode from the start of the task, and a constant
        learning rate. Seeds that fail stand still, or are lost again after they succeeded. The present settings were
        tried on seeds from 100 on in runs that are not kept, and what they come to with more frames stands above."""
    runs = {"t1tl": run}
    return "\n\n".join((paragraph(note), methods(runs, {"t1tl": "t1tl"}), made_by([run])))


_SEEDS = "--seeds 24,25,26,27,28,29,30,31,32,33,34,35"

MEASUREMENTS = (
    Measurement(
        "The short schedule",
        (
            f"python -m experiments.run --config zone_ppo {_SEEDS}",
            f"python -m experiments.run --config zone_ppo --method t1tl {_SEEDS}",
        ),
        short_schedule,
        picture="short",
    ),
    Measurement(
        "The corrections, one at a time",
        (
            f"python -m experiments.run --config zone_ppo_long --env.physics closed_form {_SEEDS} [--FIELD VALUE]",
            f"python -m experiments.run --config zone_ppo_long --env.physics closed_form {_SEEDS} --method t1tl "
            "--pretrained '' [--FIELD VALUE]",
        ),
        corrections,
    ),
    Measurement(
        "A thousand seeds",
        ("python -m experiments.run --config zone_ppo_closed_form --method t1tl --seeds 1000",),
        thousand,
    ),
    Measurement(
        "The reward-machine benchmark with 32 environments",
        ("python -m experiments.run --config rm_water_parallel --seeds 1,2,3,4",),
        parallel,
    ),
    Measurement(
        "crm's single task in the published form, once more",
        ("python -m experiments.reproduce --only rm-single-crm-published",),
        published_form,
    ),
    Measurement(
        "ql in the published form, as far as it went",
        ("python -m experiments.reproduce --only rm-ql-published,rm-ql_shaped-published",),
        published_ql,
    ),
    Measurement(
        safe_again.TITLE,
        ("python -m experiments.reproduce --only safe-t2tl,safe-t2tl-own-rate,safe-dfa_cont,safe-dfa_cont-own-rate",),
        safe_again.safe_again,
    ),
    Measurement(
        "`phi_safe` with the settings of `phi_zone`",
        (
            "python -m experiments.run --config zone_ppo_safe --method t1tl --seeds 12 --random-starts 0 "
            "--learner.anneal-learning-rate False",
        ),
        safe_before,
    ),
    Measurement(
        "Walls against the original's", ("python -m experiments.benchmarks.walls --json results/walls.json",), walls
    ),
)


def measurements(results: Path, pictures: Mapping[str, str]) -> str:
    """All sections, from the folder with all stored results; `pictures` by name of what they show."""
    parts = []
    for one in MEASUREMENTS:
        parts += [f"## {one.title}", "\n".join(f"    {command}" for command in one.commands)]
        if one.picture:
            parts.append(pictures[one.picture])
        parts.append(one.section(results))
    return "\n\n".join(parts) + "\n"
