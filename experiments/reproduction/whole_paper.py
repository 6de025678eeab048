"""How long the whole paper keeps GPUs busy, and its smoke test a processor."""

import shlex
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path

from experiments.reproduction import budgets, rates, work
from experiments.reproduction.items import PAPER_ITEMS
from experiments.reproduction.page import origin, paragraph
from experiments.reproduction.published_runs import MORE
from experiments.reproduction.runs import MADE_AGAIN, ZONE_FRAMES, again_name, all_runs
from experiments.reproduction.sections import figures
from experiments.reproduction.sections.ablation import EVERY
from experiments.reproduction.stored import Stored
from t2tl_jax.runs.folder import read_json

PROCESSORS = 16
"""Of each GPU on the hosts that were used; how many GPUs a host had is not stored."""


AIM = 90
"""Minutes of one H200 for all runs of the paper."""

BENCHMARK = "rm-"
"""What the names of the runs of the reward-machine benchmark begin with."""


def whole(runs: Mapping[str, Stored]) -> str:
    """What all runs of the paper took, summed and as they shared GPUs; '' without any."""
    trained = {name: run for name, run in runs.items() if "all_sessions" in run.status}  # not the table of codes
    if not trained:
        return ""
    training = {name: run.train_seconds / 60 for name, run in trained.items()}
    compiles = sum(run.compile_seconds / 60 for run in trained.values())
    busy = gpu_minutes(list(trained.values()))
    longest = sorted(training, key=lambda name: -training[name])[:10]
    planned = work.needed(all_runs(), [name for item in PAPER_ITEMS.values() for name in item.runs])
    missing = len(set(planned) - set(runs))
    short = len(budgets.fewer(trained))
    left_out = f"{missing} of the plan are not trained" if missing else ""
    left_out += (" and " if left_out and short else "") + (
        f"{short} had fewer frames than the paper's, beside those of the search, so that it would be more"
        if short
        else ""
    )
    return paragraph(
        f"{len(trained)} trained runs (`--only paper`; those of agents for any task come on top): "
        f"{sum(training.values()):.0f} minutes of training and {compiles:.0f} of compiling, summed over runs. "
        f"By when each began they kept GPUs busy for {busy:.0f} minutes, with several beside each other on a GPU or, "
        "where fewer were left, one; evaluation and starting are not counted. The search, repeated runs and some on "
        "another kind of GPU are among them. The aim was "
        f"{AIM} minutes of one H200, and is {'' if busy <= AIM else 'not '}reached"
        f"{f'; {left_out}' if left_out else ''}. The longest, in minutes: "
        f"{', '.join(f'{name} {training[name]:.0f}' for name in longest)}.{_benchmark_steps(trained)}"
        + where_the_minutes_are(trained)
    )


def where_the_minutes_are(runs: Mapping[str, Stored]) -> str:
    """How long some of the runs alone kept GPUs busy: those that update at every step, and without repetitions.

    '' without any that update at every step.
    """
    benchmark = [name for name in runs if name.startswith(BENCHMARK)]
    slow = [name for name in runs if name.startswith(BENCHMARK) or name.endswith(EVERY)]
    once = [name for name, run in runs.items() if not _beside(name, run)]
    fast = [name for name in once if name not in slow]
    if not slow:
        return ""
    minutes = [gpu_minutes([runs[name] for name in names]) for names in (benchmark, slow, once, fast)]
    aim = "within the aim" if minutes[3] <= AIM else f"{minutes[3] - AIM:.0f} above the aim"
    mainly = minutes[2] > AIM and minutes[2] - minutes[3] > minutes[3] - AIM
    limit = " So it is mainly the updates at every step that keep it from the aim." if mainly else ""
    return (
        f" By the same count of some runs alone: the {len(benchmark)} of that benchmark {minutes[0]:.0f} minutes, with "
        f"the others that make an update after every step ({len(slow)} in all) {minutes[1]:.0f}; the {len(once)} "
        "without the search, repeated runs, runs at a rate of their own and the pieces of the published program "
        f"{minutes[2]:.0f}; of these the {len(fast)} that do not make an update after every step {minutes[3]:.0f}, "
        f"which is {aim}.{limit}"
    )


def _beside(name: str, run: Stored) -> bool:
    """Whether a run is of a search, one that was made again or on more seeds, or a piece of the published program."""
    begins = name.startswith((rates.SEARCH, figures.BASE, f"zone-published{MORE}"))
    again = name in MADE_AGAIN and run.config.frames == ZONE_FRAMES
    return begins or again or name.endswith((again_name(""), rates.own_name(""), MORE))


def _benchmark_steps(runs: Mapping[str, Stored]) -> str:
    """What a step of the reward-machine benchmark took, of all its maps at once; '' without its runs."""
    took = {name: 1e3 * run.train_seconds / run.frames for name, run in runs.items() if name.startswith(BENCHMARK)}
    if not took:
        return ""
    least, most = min(took, key=lambda name: took[name]), max(took, key=lambda name: took[name])
    return (
        f" A step of the reward-machine benchmark took {took[least]:.2f} ({least}) to {took[most]:.2f} ms ({most}); "
        "most ran beside others on a GPU, and only the newest have loops as CUDA graphs."
    )


SMOKE = "smoke.json"
"""What ``experiments.reproduce --scale smoke`` writes as time.json, among the results."""


def smoke(results: Path) -> str:
    """How long the smoke test of all items took."""
    if not (results / SMOKE).is_file():
        return "Not measured yet."
    stored = read_json(results / SMOKE)
    return paragraph(
        f"The smoke test of all {stored['items']} items (`{shlex.join(stored['where']['command'])}`), which trains "
        f"{stored['runs']} runs for a moment each: {stored['seconds'] / 60:.1f} minutes. {origin([stored['where']])}"
    )


def gpu_minutes(runs: Sequence[Stored]) -> float:
    """How long GPUs trained and compiled, in minutes: of each host as many at once as it ran runs, or had GPUs."""
    changes: dict[tuple[str, int], list[tuple[float, int]]] = {}
    for run in runs:
        began = datetime.fromisoformat(run.versions["time"]).timestamp()
        host = run.versions["git_revision"], run.versions["cpu_count"]
        changes.setdefault(host, []).extend([(began, 1), (began + run.train_seconds + run.compile_seconds, -1)])
    seconds = 0.0
    for (_, processors), of in changes.items():
        running, before = 0, 0.0
        for now, change in sorted(of):
            seconds += (now - before) * min(running, max(1, processors // PROCESSORS))
            running, before = running + change, now
    return seconds / 60
