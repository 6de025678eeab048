"""What compared runs differ in besides the idea: sizes, what settings were chosen on, and the settings themselves."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from experiments import fairness, tuning
from experiments.reproduction import rates
from experiments.reproduction.page import paragraph, table
from experiments.reproduction.stored import Stored
from t2tl_jax.evaluation.comparisons import Pairs
from t2tl_jax.registry import configs
from t2tl_jax.runs.differences import differences
from t2tl_jax.training.seeds import parse_seeds

SEARCHED = """Settings were searched for with the methods of the column "chosen with" alone, and not again for each of
the others, which take them over: an ordering in which one of the latter is behind may come from that."""

NOT_WHOLE = """A search of the learning rate for every method is planned and not complete ([what there is of
it](#{})), and the orders here do not take it into account yet."""

ELSEWHERE = """The learning rate was searched for in the same way for every method ([below](#{})), but on other tasks,
and none was searched for on this one: the same search for every method was the aim, and was not made
here."""


def searched(world: str) -> str:
    """Which settings were searched for with which methods.

    Args:
        world: of `rates.OWN_RATE`, or anything else where no search was made.
    """
    if world not in rates.WORLDS:
        return paragraph(f"{SEARCHED} {ELSEWHERE.format(SEARCH_ANCHOR)}")
    if world not in rates.OWN_RATE:
        return paragraph(f"{SEARCHED} {again_searched(world)}")
    return paragraph(f"""
        Settings were chosen with the methods of the column "chosen with" alone, and the others take them over.
        {again_searched(world)} Other settings were not searched for again: an ordering in which one of the others is
        behind may still come from them.""")


def again_searched(world: str, usual: str = "All runs of this table") -> str:
    """What the same search for every method found in a world of `rates.WORLDS`.

    Args:
        world: which one.
        usual: the runs that have the usual rate, in words.
    """
    if world not in rates.OWN_RATE:
        return NOT_WHOLE.format(SEARCH_ANCHOR)
    own = [f"{method} ({rates.WORDS[which]})" for method, which in rates.OWN_RATE[world].items()]
    found = (
        f"it took another one than the usual for {', '.join(own)}. {usual} have the usual one. What the "
        "other is worth, and what the orders are with it, is in the section linked as far as it is trained"
        if own
        else "the usual one is best for every method"
    )
    return (
        "The learning rate was then searched for in one and the same way for every method, on seeds "
        f"{tuning.in_words(parse_seeds(rates.SEEDS))} (`--only search`, [there](#{SEARCH_ANCHOR})): {found}."
    )


SEARCH_TITLE = "The same search for every method: the learning rate"
SEARCH_ANCHOR = SEARCH_TITLE.lower().replace(":", "").replace(" ", "-")


def what_differs(runs: Mapping[str, Stored], labels: Mapping[str, str], world: str) -> str:
    """One row for each method: sizes, pre-training, and what its settings were chosen on; '' without stored sizes."""
    rows = [
        fairness.row(labels[name], run.config, run.seeds, run.status, run.sizes)
        for name, run in runs.items()
        if name in labels and run.sizes is not None
    ]
    if not rows:
        return ""
    differs = table(("method", *fairness.HEADING[1:]), rows)
    return f"What differs beside the method. {fairness.NOTE}\n\n{differs}\n\n{searched(world)}"


FORMS = {
    "learner.network.freeze_task_encoder=False": "an encoder that is trained on",
    "learner.network.head=concat": "a code that is concatenated with the state",
    "learner.counterfactual=False": "learning from the own row alone",
    "learner.printed_argmax=True": "the argmax as printed",
    "random_starts=0.5": "episodes that start at a later sub-task",
    "labels=state": "the printed labels",
}
"""By what a run has and the configuration that was searched for has not, what that is in words."""

WITHOUT, ON_RANDOM = "no pre-training", "pre-training on random formulas"
"""The same of where an encoder begins."""

LEADS = "So where the form that they were chosen for is ahead, the settings may be a reason."

EARLIER = """The runs per-16 and every-step have settings that `waterworld_dqn` had before its present ones; on which
maps those were chosen is not recorded."""


def chosen(runs: Mapping[str, Stored]) -> str:
    """For which form the settings of compared runs were chosen, and which of the runs have another one.

    '' where that is not known, and where no run has another one.

    Args:
        runs: of one world.
    """
    parts = []
    if others := _other_forms(runs):
        origin = _searched_for(next(iter(runs.values())))
        found = tuning.TUNED[origin]
        each = [
            f"{form} ({'all runs here' if len(names) == len(runs) else ', '.join(names)})"
            for form, names in others.items()
        ]
        parts.append(
            f"Settings were chosen for `{origin}` on seeds {tuning.in_words(found.seeds)} (with {found.methods}), "
            f"where codes have {found.form}. They were not chosen again for {'; nor for '.join(each)}. {LEADS}"
        )
    if any(name.endswith("-per-16") for name in runs):
        parts.append(EARLIER)
    return " ".join(" ".join(parts).split())


def _other_forms(runs: Mapping[str, Stored]) -> dict[str, list[str]]:
    """By form, the runs that have it though settings were not chosen for it."""
    found: dict[str, list[str]] = {}
    for name, run in runs.items():
        for form in _forms(run):
            found.setdefault(form, []).append(name)
    return found


def _forms(run: Stored) -> Iterator[str]:
    """What a run has that the configuration which was searched for has not, beside its method and its numbers."""
    origin, learner = _searched_for(run), _learner(run)
    if origin not in tuning.TUNED or not tuning.TUNED[origin].form:
        return
    changes = list(differences(configs()[origin][0], run.config))
    reads = learner.task_encoder is not None and learner.task_encoder.learned
    for change, words in FORMS.items():
        if change in changes and (reads or "freeze" not in change):  # a one-hot code has nothing to freeze
            yield words
    if reads and not run.config.pretrained:
        yield WITHOUT
    elif reads and run.config.pretrained.endswith("-random"):
        yield ON_RANDOM


def _searched_for(run: Stored) -> str:
    """The named configuration whose settings a run has."""
    nearest = tuning.nearest(run.config)
    tuned = tuning.TUNED.get(nearest)
    return tuned.of or nearest if tuned else nearest


def _learner(run: Stored) -> Any:
    """Of either kind: both have a task encoder."""
    return run.config.learner


MANY = "These differ in more than one setting, told of the first and of the second; the other pairs in one:"


def settings(runs: Mapping[str, Stored], pairs: Pairs) -> str:
    """The compared runs that differ in more than one setting, with the values of each; '' where there are none."""
    lines = []
    for first, second in pairs:
        if first in runs and second in runs and len(told := _told(runs[first], runs[second])) > 1:
            lines.append(f"- {first}, {second}: {'; '.join(told)}.")
    return "\n".join([MANY, "", *lines]) if lines else ""


def _told(first: Stored, second: Stored) -> list[str]:
    """Each setting that two runs differ in, with what it is in one and in the other; a dash where a part has it not."""
    of_second, of_first = _changes(first, second), _changes(second, first)
    return [f"`{name}` {of_first.get(name, '-')}, {of_second.get(name, '-')}" for name in {**of_first, **of_second}]


def _changes(base: Stored, other: Stored) -> dict[str, str]:
    """By setting, what it is in the other run; their seeds do not count."""
    changes = dict(change.split("=", 1) for change in differences(base.config, other.config))
    if "pretrained" in changes:
        changes["pretrained"] = Path(changes["pretrained"]).name or "no"
    return {name: value for name, value in changes.items() if name != "seeds"}
