"""The reward-machine benchmark: ten tasks and a single one, with and without counterfactual learning and shaping."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from experiments.paper import published_water
from experiments.reproduction import below, score_bounds
from experiments.reproduction.cells import cost_line, share, text
from experiments.reproduction.claims import differences
from experiments.reproduction.page import paragraph, table
from experiments.reproduction.sections import ten_tasks
from experiments.reproduction.sections.ten_tasks import FORM
from experiments.reproduction.stored import Stored
from t2tl_jax.evaluation.statistics import Estimate, mean_rate

SINGLE = {f"rm-single-{name.removeprefix('rm-')}": published for name, published in ten_tasks.TEN.items()}

SLOW = "-slow"
"""Ending of the name of a run that has the published learning rate instead of ours."""

SINGLE_KINDS = SINGLE | {f"rm-single-crm{ending}": "crm" for ending in (SLOW, FORM)}
"""All runs of the single task by the published ones that they stand beside."""

SINGLE_PAIRS = [
    *(
        (f"rm-single-{first.removeprefix('rm-')}", f"rm-single-{second.removeprefix('rm-')}")
        for first, second in ten_tasks.PAIRS
        if {first, second} <= ten_tasks.TEN.keys()
    ),
    (f"rm-single-crm{SLOW}", "rm-single-crm"),
    (f"rm-single-crm{FORM}", "rm-single-crm"),
    (f"rm-single-crm{FORM}", f"rm-single-crm{SLOW}"),
]
"""Nothing is claimed of these: the published curves overlap within one standard deviation."""

EPISODES = 100
"""Of the single task in one average, as in the published shares."""

SINGLE_NOTE = """In the published single task a wrong touch in the last state pays 1 too, which the published shares
count, so that they do not compare with "carried out". Discounted return counts whatever was paid, the sooner the more,
so that an agent gains by the touch that is nearer, be it the wrong one. A gradient step of crm holds three states'
values here instead of 77, at the learning rate that was chosen for 77, but for {slow} the published one. The runs
were made again to record what is paid. By the same settings and seeds other maps had been lost before: how a run ends
on one map is not stable. Why the maps are lost where episodes no longer pay is open."""

FORM_NOTE = f"""rm-single-crm{FORM} has the published network, learning rate and clipping. What still differs from the
published program: its batches are 32 steps with all three states of the machine, where theirs are 96 pairs of a step
and a state, without states that the events before rule out; the observation's and the state's parts of the first layer
begin, and are clipped, apart; and every episode starts at rest."""

SCORE_NOTE = """The published figure of the single task is a normalised score: an episode's reward over its length, in
units of the best episode on the map, mean of the last 100 (here of whole iterations, as few as hold so many). Ours was
not stored, only means over iterations of reward, length and discounted return, which enclose it: a cell has the least
and the greatest mean over maps that these allow, and an interval that holds the intervals of both. For the greatest no
paid episode is taken to be shorter than the authors' shortest one, whose score counts as 1. What is said to be below is
so by the greatest: under that assumption, and as far as the two kinds of windows agree, our mean is below."""

TRAINING_ALONE = """None of these runs was evaluated after its training, nor were the published ones: all figures are of
training episodes, with exploration."""

EVALUATED = """Evaluated after training, by the final parameters: {}. Not evaluated: {}; nor the published
runs. Those of ours that are stored without an evaluation are older than it, and their parameters were not kept. All
other figures are of training episodes, with exploration."""

LEAD = """A lead on why crm's single task is behind, and no explanation: the authors trained crm with three layers of
512 too (crm1, one repeat), the width of ours. At their learning rate it ends the ten tasks at a score of {narrow:.3f}
where their 1,024 end at {wide:.3f}, so that width alone costs {cost:.3f} there. Of the single task no such run is
published.{ours}"""

AGAIN = """An earlier training of it, which was cut, stands
[below](#crms-single-task-in-the-published-form-once-more)."""

AS_WIDE = " On the ten tasks ours is as narrow and ends at {:.3f}, with another head and another learning rate."

UNKNOWN = "How many of our episodes were paid was not recorded in {}."
"""Of runs that are older than the metric."""

PUBLISHED_SETTINGS = """Published: learning rate 1e-05, constant, for all; 3 layers of 1,024 and heads of 256 that read
the state's number beside the observation; each variable's gradient clipped by itself; of ql alone the time limit is an
end."""

OVERVALUED = (
    "Nothing pays more than 1 (with shaping no value is above 2), but in some iteration the values averaged more for"
)

NOTE = "Published: mean and standard deviation over maps 1 to 10 and two repeats. Seed k is map k here, and pairs maps."


def benchmark(runs: Mapping[str, Stored]) -> str:
    """Normalised score of the ten tasks and discounted return of the single one, with what is published of both."""
    ten = {name: run for name, run in runs.items() if ten_tasks.is_one(run)}
    single = {name: run for name, run in runs.items() if name not in ten}
    parts = [*ten_tasks.ten_tasks(ten), *_single(single), lead(ten, single)]
    parts += [overvalued(runs), settings(runs), NOTE]
    parts += [*evaluated(runs), cost_line(runs)]
    return "\n\n".join(part for part in parts if part) if runs else ""


def overvalued(runs: Mapping[str, Stored]) -> str:
    """Seeds whose values on the average exceeded what a task can pay, and what became of them.

    That is 1; where rewards are shaped values are higher by what the shaping takes off, which is up to 1 more.
    """
    found = []
    for name, run in runs.items():
        highest = np.nanmax(run.metrics["q"], axis=1) if "q" in run.metrics else np.zeros(len(run.seeds))
        late, best = run.end("discounted_return"), np.nanmax(run.metrics["discounted_return"], axis=1)
        bound = 2.0 if getattr(run.config.learner, "shaping", False) else 1.0
        found += [
            f"{name} on map {seed} ({most:.1f}; return {late[seed]:.3f} at the end, {high:.3f} at its best)"
            for seed, most, high in zip(run.seeds, highest, best, strict=True)
            if most > bound
        ]
    return f"{OVERVALUED}: {'; '.join(found)}." if found else ""


def settings(runs: Mapping[str, Stored]) -> str:
    """What the learners differ in beside what they are compared for, and from the published ones."""
    each = []
    for name, run in runs.items():
        learner: Any = run.config.learner  # of either kind
        network = learner.network
        layers = ", ".join(str(size) for size in (*network.state_layers, network.task_layer))
        falls = "falling to 0" if learner.anneal_learning_rate else "constant"
        behind = ", ".join(str(size) for size in network.head_layers)
        heads = f", a layer of {behind} in each of two heads" if behind else ""
        clipped = "array by array" if learner.gradient_clipping == "each" else "as a whole"
        ends = "; the time limit is an end" if learner.timeout_is_terminal else ""
        rate = f"learning rate {learner.learning_rate:g}, {falls}"
        how = f"{rate}; layers {layers}, head {network.head}{heads}; gradients clipped {clipped}{ends}"
        each.append((how, name))
    same = {how: [name for what, name in each if what == how] for how, _ in each}
    ours = [f"{', '.join(names)}: {how}." for how, names in same.items()]
    return "\n".join([*ours, PUBLISHED_SETTINGS] if {*ten_tasks.KINDS, *SINGLE_KINDS} & {*runs} else ours)


def evaluated(runs: Mapping[str, Stored]) -> list[str]:
    """What became of the runs that were evaluated after their training, or that none was."""
    rows = []
    for name, run in runs.items():
        if run.evaluations:
            of = {
                (policy, metric): run.by_seed(metric, policy=policy)
                for policy in ("sampled", "deterministic")
                for metric in ("discounted_return", "success_rate")
            }
            rows.append((name, *(text(of[key]) if "return" in key[1] else share(of[key]) for key in of)))
    if not rows:
        return [TRAINING_ALONE]
    there = [name for name, *_ in rows]
    others = [name for name in runs if name not in there]
    heading = ("evaluated", "sampled: return", "carried out", "deterministic: return", "carried out")
    said = EVALUATED.format(", ".join(there), ", ".join(others) or "none")
    return [table(heading, rows), paragraph(said)]


def lead(ten: Mapping[str, Stored], single: Mapping[str, Stored]) -> str:
    """What the authors' narrower crm says of ours on the single task; '' without that."""
    if "rm-single-crm" not in single:
        return ""
    wide, narrow = published_water.SCORES["crm"][0][-1], published_water.NARROW_CRM[0][-1]
    curves = ten_tasks.scores(ten).get("rm-crm", {})
    end = float(np.mean([curve[-1] for curve in curves.values()])) if curves else np.nan
    ours = AS_WIDE.format(end) if end > wide else ""
    return paragraph(LEAD.format(narrow=narrow, wide=wide, cost=wide - narrow, ours=ours))


def _single(runs: Mapping[str, Stored]) -> list[str]:
    if not runs:
        return []
    marks = published_water.SINGLE_STEPS
    rows = [
        (
            name,
            *(text(at.tolist()) for at in recent(run, marks, "discounted_return").T),
            text(run.area("discounted_return")),
            share(run.end("success_rate")),
            share(run.end("violation_rate")),
            text(run.end("length"), 1),
        )
        for name, run in runs.items()
    ]
    heading = [
        "single task: discounted return",
        *ten_tasks.thousands(marks),
        "over training",
        "carried out",
        "wrong touch, paid or not",
        "steps at the end",
    ]
    means = {name: run.area("discounted_return") for name, run in runs.items()}
    return [
        table(heading, rows),
        differences(runs, SINGLE_PAIRS, means, "mean discounted return over training"),
        scored(runs),
        rewarded(runs),
        single_note(runs),
    ]


def single_note(runs: Mapping[str, Stored]) -> str:
    """What to know of the figures of the single task, and of the run in the published form where it is there."""
    form = f"rm-single-crm{FORM}"
    slow = f"the slow run and {form}, which have" if form in runs else "the slow run, which has"
    note = paragraph(SINGLE_NOTE.format(slow=slow))
    return f"{note}\n\n{paragraph(f'{FORM_NOTE} {AGAIN}')}" if form in runs else note


def scored(runs: Mapping[str, Stored]) -> str:
    """Between which values the normalised score of the single task lies, beside the published, and where it is below.

    Maps without published scores are left out, and runs that are older than the metric of what is paid.
    """
    marks, best = published_water.STEPS, published_water.SINGLE_BEST_STEPS
    rows, found = [], {}
    for name, run in runs.items():
        if "total_reward" not in run.metrics or not {*run.seeds} <= {*best}:
            continue
        least, greatest = (recent(run, marks, of) for of in _score_bounds(run))
        rows.append((name, *(score_bounds.cell(*at) for at in zip(least.T, greatest.T, strict=True))))
        means, _ = published_water.SINGLE_SCORES[SINGLE_KINDS[name]]
        found[name] = below.marks(greatest, marks, means)
    for published in SINGLE.values():
        every = zip(*published_water.SINGLE_SCORES[published], strict=True)
        rows.append((f"{published}, published", *(f"{mean:.2f} ± {deviation:.2f}" for mean, deviation in every)))
    heading = ["single task: normalised score", *ten_tasks.thousands(marks)]
    listed = below.listed(found, "after {} steps")
    return "\n\n".join(part for part in (SCORE_NOTE, table(heading, rows), listed) if part)


def _score_bounds(run: Stored) -> tuple[np.ndarray, np.ndarray]:
    best: Any = published_water.SINGLE_BEST_STEPS
    return score_bounds.bounds(run.metrics, [best[seed] for seed in run.seeds], run.config.learner.discount)


def greatest_scores(run: Stored) -> np.ndarray:
    """The greatest score at the published steps that the stored means allow: float[maps, steps], NaN after the end."""
    return recent(run, published_water.STEPS, _score_bounds(run)[1])


def rewarded(runs: Mapping[str, Stored]) -> str:
    """Episodes of the single task that pay 1, beside the published shares, and where ours are fewer."""
    marks, known = published_water.SINGLE_STEPS, [name for name, run in runs.items() if "total_reward" in run.metrics]
    shares = {name: recent(runs[name], marks, "total_reward") for name in known}
    rows = [(name, *(_paid(at[np.isfinite(at)]).text() for at in of.T)) for name, of in shares.items()]
    for published, of_episodes in published_water.SINGLE_REWARDED.items():
        rows.append((f"{published}, published", *(f"{at:.3f}" for at in of_episodes)))
    found = {
        name: below.marks(of, marks, published_water.SINGLE_REWARDED[SINGLE_KINDS[name]], estimate=_paid)
        for name, of in shares.items()
    }
    unknown = [name for name in runs if name not in known]
    parts = [table(["episodes that pay 1", *ten_tasks.thousands(marks)], rows), below.listed(found, "after {} steps")]
    ended = {name: of[:, -1] for name, of in shares.items() if np.isfinite(of[:, -1]).all()}
    by_map = [f"{name}: {', '.join(f'{share:.2f}' for share in last)}." for name, last in ended.items()]
    parts += ["\n".join(["By map, after the last of these steps:", *by_map])] if by_map else []
    return "\n\n".join(part for part in (*parts, UNKNOWN.format(", ".join(unknown)) if unknown else "") if part)


def _paid(shares: np.ndarray) -> Estimate:
    return mean_rate(shares.round(6))  # sums of rounded columns can come to a hair over 1


def recent(run: Stored, marks: Sequence[int], metric: str | np.ndarray) -> np.ndarray:
    """Mean of a metric over each seed's last `EPISODES` episodes or more, whole iterations: float[seeds, marks].

    NaN at marks after the end, and before an episode ended. A metric that is not stored is float[seeds, iterations].
    """
    frames, episodes = run.metrics["frames"][0], np.nan_to_num(run.metrics["episodes"])
    paid = episodes * np.nan_to_num(run.metrics[metric] if isinstance(metric, str) else metric)
    ended, total = (np.pad(np.cumsum(of, axis=1), ((0, 0), (1, 0))) for of in (episodes, paid))
    values = np.full((len(episodes), len(marks)), np.nan)
    for column, mark in enumerate(marks):
        last = int(np.searchsorted(frames, mark, side="right"))
        if mark > frames[-1]:
            continue
        for seed, count in enumerate(ended):
            first = max(int(np.searchsorted(count, count[last] - EPISODES, side="right")) - 1, 0)
            if count[last] > count[first]:
                values[seed, column] = (total[seed, last] - total[seed, first]) / (count[last] - count[first])
    return values
