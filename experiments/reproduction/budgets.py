"""Which runs of the paper's items have fewer frames than the paper gives them."""

from collections.abc import Mapping

from envs.zones import ZoneConfig
from experiments.reproduction import rates
from experiments.reproduction.page import named, paragraph
from experiments.reproduction.runs import ALONE_END, ZONE_FRAMES
from experiments.reproduction.stored import Stored

WORDS = """The paper's budget in ZoneEnv is {paper:.0f} million frames a seed, and to train these for as many was the
aim. They had fewer: {runs}.{constant}"""


def fewer(runs: Mapping[str, Stored]) -> dict[str, int]:
    """Frames of a seed, by run, of those in ZoneEnv with fewer than the paper's; not of a search, which says so itself,
    nor of runs that are only timed."""
    return {
        name: run.frames
        for name, run in runs.items()
        if "all_sessions" in run.status  # it was trained
        and isinstance(run.config.env, ZoneConfig)
        and run.frames < ZONE_FRAMES
        and not name.startswith(rates.SEARCH)
        and not name.endswith(ALONE_END)
    }


def said(runs: Mapping[str, Stored]) -> str:
    """Which these are, in words; '' for none."""
    found = fewer(runs)
    if not found:
        return ""
    by_frames: dict[int, list[str]] = {}
    for name, frames in found.items():
        by_frames.setdefault(frames, []).append(name)
    each = [f"{frames / 1e6:.1f} million ({named(names)})" for frames, names in sorted(by_frames.items())]
    constant = [name for name in found if not getattr(runs[name].config.learner, "anneal_learning_rate", True)]
    told = (
        f" Of these the learning rate is constant, where it falls in the main runs: {named(constant)}."
        if constant
        else ""
    )
    return paragraph(WORDS.format(paper=ZONE_FRAMES / 1e6, runs="; ".join(each), constant=told))
