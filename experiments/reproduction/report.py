"""What the documentation shows of stored results: its page, parts of other pages, and pictures."""

from pathlib import Path

from experiments.paper.published_curves import ZONE_CURVES
from experiments.reproduction import beside, speed, stored
from experiments.reproduction.items import ITEMS
from experiments.reproduction.method_table import method_table
from experiments.reproduction.page import page, paragraph
from experiments.reproduction.parts import filled
from experiments.reproduction.pictures import pictures
from experiments.reproduction.runs import WATER_METHODS
from experiments.reproduction.sections import frames_to
from experiments.reproduction.tables import text
from experiments.tuning import in_words

PAGE = "docs/results.md"
"""The page that is written as a whole."""


def pages(root: Path) -> dict[str, str]:
    """The pages as they should be, by path below the root of the repository, from `results` there."""
    results = root / "results"
    runs = stored.load(results / "paper")
    shown = {name: picture.markdown() for name, picture in pictures(results).items()}
    whole = page(ITEMS, runs, smoke=False, pictures=shown) + "\n" + beside.measurements(results, shown)
    parts = {
        "README.md": {
            "picture": caption(results),
            "methods": method_table(runs, WATER_METHODS),
            "speed": speed.short_table(results),
        },
        "docs/methods.md": {"methods": method_table(runs)},
        "docs/speed.md": {
            "until-solved": speed.until_solved(results),
            "second-core": speed.second_core(results),
            "environments": speed.environments(results),
        },
    }
    written = {name: filled((root / name).read_text(encoding="utf-8"), of, name) for name, of in parts.items()}
    return {PAGE: whole, **written}


def write(root: Path) -> list[str]:
    """Write pages and pictures anew; returns their paths below the root."""
    for name, content in pages(root).items():
        (root / name).write_text(content, encoding="utf-8")
    drawn = pictures(root / "results").values()
    for picture in drawn:
        picture.draw(root / "docs")
    return [PAGE, "README.md", "docs/methods.md", "docs/speed.md", *(f"docs/{picture.file}" for picture in drawn)]


def caption(results: Path) -> str:
    """What the README says below its picture."""
    runs = stored.load(results / "zone_short_h200")
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
        {frames[-1] / 1e6:g}). Data: [`results/zone_short_h200`](results/zone_short_h200).*""")
