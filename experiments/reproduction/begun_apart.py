"""Which runs began with other trainings of the same pre-training."""

from collections.abc import Mapping
from pathlib import PurePosixPath

from experiments.reproduction.page import named, paragraph
from experiments.reproduction.stored import Stored

WORDS = """Some of these runs are pre-trained in the same way and yet did not begin with the same encoder, since that
pre-training was made more than once, which even by one commit does not end alike every time. {each} What differs
between two such runs has that in it too."""


def begun_apart(runs: Mapping[str, Stored]) -> dict[str, list[tuple[int, list[str]]]]:
    """Of each pre-training that some of the runs had from one training and some from another: for each of its
    trainings the frames of a seed, and the runs that began with it."""
    found: dict[str, list[tuple[dict, list[str]]]] = {}
    for name, run in runs.items():
        summary = run.status.get("pretraining")
        if not summary:
            continue
        trainings = found.setdefault(PurePosixPath(summary["folder"]).name, [])
        known = next((names for other, names in trainings if other == summary), None)
        if known is None:
            trainings.append((summary, [name]))
        else:
            known.append(name)
    return {
        folder: [(summary["frames_per_seed"], names) for summary, names in trainings]
        for folder, trainings in found.items()
        if len(trainings) > 1
    }


def said(runs: Mapping[str, Stored]) -> str:
    """Which these are, in words; '' for none."""
    each = [
        f"`{folder}`: " + "; ".join(f"{frames:,} frames a seed for {named(names)}" for frames, names in trainings) + "."
        for folder, trainings in begun_apart(runs).items()
    ]
    return paragraph(WORDS.format(each=" ".join(each))) if each else ""
