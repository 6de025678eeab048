"""What the documentation shows of stored results: its page, parts of other pages, and pictures."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from experiments.paper.published_curves import ZONE_CURVES
from experiments.reproduction import beside, speed, stored
from experiments.reproduction.cells import text
from experiments.reproduction.items import ITEMS
from experiments.reproduction.measures import frames_to
from experiments.reproduction.method_table import method_table
from experiments.reproduction.page import page, paragraph
from experiments.reproduction.parts import filled
from experiments.reproduction.pictures import Picture, pictures
from experiments.reproduction.runs import WATER_METHODS
from experiments.reproduction.stored import Stored
from experiments.tuning import in_words

PAGE = "docs/results.md"
"""The page that is written as a whole."""

HEAD = """# Results

Written by `python -m experiments.reproduce --report True` from what is stored in `results/`; do not edit. Every run is
there with its configuration, metrics, evaluation, versions and the commit that made it, which is one of this history,
without changes. First come the items of the paper, from `results/paper`, each with the command that measures it, then
what was measured beside them."""


@dataclass(frozen=True)
class Documentation:
    """What should be there."""

    pages: dict[str, str]
    """By path below the root of the repository, the whole text."""
    pictures: dict[str, Picture]
    """By path likewise."""


def documentation(root: Path) -> Documentation:
    """What `results` gives, between the words of the pages as they are.

    Args:
        root: of the repository.
    """
    results = root / "results"
    paper, short = (stored.load(results / name) for name in ("paper", beside.SHORT))
    shown = pictures(paper, short)
    lines = {name: picture.markdown() for name, picture in shown.items()}
    items = page(ITEMS, paper, smoke=False, head=HEAD, pictures=lines)
    whole = f"{items}\n{beside.measurements(results, lines)}"
    parts = {
        "README.md": {
            "picture": caption(short),
            "methods": method_table(paper, WATER_METHODS),
            "speed": speed.short_table(results),
        },
        "docs/methods.md": {"methods": method_table(paper)},
        "docs/speed.md": {
            "until-solved": speed.until_solved(results),
            "second-core": speed.second_core(results),
            "environments": speed.environments(results),
        },
    }
    written = {name: filled((root / name).read_text(encoding="utf-8"), of, name) for name, of in parts.items()}
    return Documentation({PAGE: whole, **written}, {f"docs/{picture.file}": picture for picture in shown.values()})


def write(root: Path) -> list[str]:
    """Write pages and pictures anew; returns their paths below the root."""
    wanted = documentation(root)
    for name, content in wanted.pages.items():
        (root / name).write_text(content, encoding="utf-8")
    for name, picture in wanted.pictures.items():
        picture.draw(root / name)
    return [*wanted.pages, *wanted.pictures]


def caption(runs: Mapping[str, Stored]) -> str:
    """What the README says below its picture, from the runs of the short schedule."""
    t2tl, t1tl = (runs[name] for name in beside.FRESH)
    reached = [sum(frames < float("inf") for frames in frames_to(run).values()) for run in (t2tl, t1tl)]
    frames, returns = ZONE_CURVES["T2TL_pre (published)"]
    then = returns[frames.index(t2tl.config.frames)]
    return paragraph(f"""
        *`F(Red & F(Black & F Yellow))` in the MJX ZoneEnv with the defaults, {len(t2tl.seeds)} seeds that nothing was
        tuned on ({in_words(t2tl.seeds)}), {t2tl.config.frames / 1e6:g} million frames each: success in training rises
        above 95 % and stays there in {reached[0]} of {len(t2tl.seeds)} seeds of T2TL and {reached[1]} of
        {len(t1tl.seeds)} of T1TL, and T2TL ends at a discounted return of {text(t2tl.end("discounted_return"))}
        (published: {then:.2f} at {t2tl.config.frames / 1e6:g} million frames, {returns[-1]:.2f} at
        {frames[-1] / 1e6:g}). Data: [`results/{beside.SHORT}`](results/{beside.SHORT}).*""")
