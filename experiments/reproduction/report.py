"""What the documentation shows of stored results: its page, parts of other pages, and pictures."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from experiments.paper.published_curves import ZONE_CURVES
from experiments.reproduction import (
    arithmetic,
    begun_apart,
    beside,
    budgets,
    profiles,
    room,
    speed,
    stored,
    survival,
    typed,
    whole_paper,
)
from experiments.reproduction.aims import aims
from experiments.reproduction.anytask.items import ANY_ITEMS
from experiments.reproduction.anytask.picture import EpisodesPicture, of_runs
from experiments.reproduction.anytask.runs import any_runs
from experiments.reproduction.anytask.summary import summary
from experiments.reproduction.anytask.terms import TERMS
from experiments.reproduction.attention_picture import AttentionPicture, attention_picture
from experiments.reproduction.cells import text
from experiments.reproduction.changed import changed
from experiments.reproduction.compiling import compiling
from experiments.reproduction.episode import EpisodeGIF
from experiments.reproduction.few_kernels import few_kernels
from experiments.reproduction.graphs import graphs
from experiments.reproduction.guard_price import guard_price
from experiments.reproduction.halved import halved
from experiments.reproduction.items import PAPER_ITEMS
from experiments.reproduction.kept_agents import kept_agents
from experiments.reproduction.measures import frames_before, frames_to
from experiments.reproduction.method_table import method_table
from experiments.reproduction.only_seed import only_seed
from experiments.reproduction.page import page, paragraph
from experiments.reproduction.parts import filled
from experiments.reproduction.pictures import Picture, pictures
from experiments.reproduction.rows_last import rows_last
from experiments.reproduction.runs import WATER_METHODS
from experiments.reproduction.scaling import scaling
from experiments.reproduction.second_gpu import second_gpu
from experiments.reproduction.sections import safe_again
from experiments.reproduction.sections.anyshort import in_short
from experiments.reproduction.stored import Stored
from experiments.reproduction.sums_of_rows import sums_of_rows
from experiments.reproduction.tally import tally
from experiments.tuning import in_words

PAGE = "docs/results.md"
"""The page that is written as a whole."""

HEAD = """# Results

Written by `python -m experiments.reproduce --report True` from what is stored in `results/`; do not edit. Every run
is there with its configuration, metrics, versions and the commit that made it, which is one of this history, without
changes, and with an evaluation, but for pre-trainings, runs that were only timed, the search for learning rates, most
of the reward-machine benchmark, among them the runs of it that were cut. Of pre-trainings that were made more than once
there is one. First come the items of the paper, from `results/paper`, each with the command that measures it, then what
was measured beside them. Agents that carry out formulas they were not trained on have a [page of their
own](zeroshot.md)."""

ANY_PAGE = "docs/zeroshot.md"
"""The page of agents for any task, which is written as a whole too."""

ANY_HEAD = """# Any formula, any map

Written by `python -m experiments.reproduce --report True` from what is stored in `results`, folder any; do not edit.
One agent for each environment is asked to carry out formulas that it was not trained on, on maps that it was not
trained on, where the world has more than one. What is not measured yet says so.
The formulas of the tests are named as in `t2tl_jax/ltl/benchmark_tasks.py`; `python -m experiments.reproduce --only
any` makes all of it again."""

OnPage = Picture | AttentionPicture | EpisodesPicture
Drawing = OnPage | EpisodeGIF

GIF = "zone_ppo_episode.gif"
"""Shown by the page of the usage."""


@dataclass(frozen=True)
class Documentation:
    """What should be there."""

    pages: dict[str, str]
    """By path below the root of the repository, the whole text."""
    pictures: dict[str, Drawing]
    """By path likewise."""


def documentation(root: Path) -> Documentation:
    """What `results` gives, between the words of the pages as they are.

    Args:
        root: of the repository.
    """
    results = root / "results"
    paper, short = (stored.load(results / name) for name in ("paper", beside.SHORT))
    for_any = stored.load(results / "any")
    shown = drawings(paper, short, for_any)
    lines = shown_by(shown)

    def remark(runs: Mapping[str, Stored]) -> str:
        said = (budgets.said(runs), begun_apart.said(runs), safe_again.said(results, runs))
        return "\n\n".join(part for part in said if part)

    items = page(PAPER_ITEMS, paper, smoke=False, head=HEAD, pictures=lines, summary=tally, remark=remark)
    whole = f"{items}\n{beside.measurements(results, lines)}"
    parts = {
        "README.md": {
            "picture": caption(short),
            "methods": method_table(paper, WATER_METHODS),
            "any": paragraph(in_short(for_any)),
            "speed": speed.short_table(results),
        },
        "docs/methods.md": {"methods": method_table(paper), "agents": kept_agents(paper)},
        "docs/speed.md": {
            "until-solved": speed.until_solved(results),
            "second-core": speed.second_core(results),
            "pauses": speed.pauses(results),
            "environments": speed.environments(results),
        },
        "docs/performance.md": {
            "trainings": speed.everything(results),
            "aims": aims(results),
            "whole": whole_paper.whole(paper),
            "smoke": whole_paper.smoke(results),
            "profiles": profiles.profiles(results),
            "gains": profiles.gains(results),
            "guard": guard_price(results),
            "graphs": graphs(results),
            "few-kernels": few_kernels(results),
            "scaling": scaling(results),
            "halved": halved(results),
            "second-gpu": second_gpu(results),
            "only-seed": only_seed(results),
            "rows-last": rows_last(results),
            "sums-of-rows": sums_of_rows(results),
            "compiling": compiling(results),
            "substep": arithmetic.substep(results),
            "gradient-step": arithmetic.gradient(results),
            "tables": arithmetic.tables(results),
            "replays": room.replays(results),
        },
        "docs/usage.md": {
            "plans": beside.plans(results),
            "kills": survival.kills(results),
            "large-table": room.table(results),
            "letters": room.letters(results),
            "recording": room.recording(results),
            "groups": room.groups(results),
            "prompt": typed.typed(results),
        },
    }
    written = {name: filled((root / name).read_text(encoding="utf-8"), of, name) for name, of in parts.items()}
    terms = "\n\n".join(part for part in (TERMS, changed(for_any, any_runs())) if part)
    head = "\n\n".join(part for part in (ANY_HEAD, summary(for_any, results)) if part)
    any_page = page(ANY_ITEMS, for_any, smoke=False, head=head, pictures=lines, terms=terms)
    moving = EpisodeGIF(GIF, results / "paper" / "zone-t2tl", "phi_zone")
    drawn: list[Drawing] = [*(one for of in shown.values() for one in of), moving]
    return Documentation(
        {PAGE: whole, ANY_PAGE: any_page, **written},
        {f"docs/{one.file}": one for one in drawn},
    )


def drawings(
    paper: Mapping[str, Stored], short: Mapping[str, Stored], for_any: Mapping[str, Stored]
) -> dict[str, list[OnPage]]:
    """By item the pictures of what is there: of the paper's runs, of the short schedule's, of agents for any task."""
    found: dict[str, list[OnPage]] = {}
    for some in (pictures(paper, short), attention_picture(paper), of_runs(for_any)):
        for name, picture in some.items():
            found.setdefault(name.partition("/")[0], []).append(picture)
    return found


def shown_by(drawn: Mapping[str, list[OnPage]]) -> dict[str, str]:
    """By item the lines that show its pictures on a page beside them."""
    return {name: "\n\n".join(one.markdown() for one in of) for name, of in drawn.items()}


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
    then, before = returns[frames.index(t2tl.config.frames)], frames_before(t2tl)
    return paragraph(f"""
        *`F(Red & F(Black & F Yellow))` in the MJX ZoneEnv with the defaults, {len(t2tl.seeds)} seeds that nothing was
        tuned on ({in_words(t2tl.seeds)}), {t2tl.config.frames / 1e6:g} million frames each
        {f"after {before / 1e6:.2g} million of pre-training on the formula" if before else "without pre-training"}:
        success in training rises above 95 % and stays there in {reached[0]} of {len(t2tl.seeds)} seeds of T2TL and
        {reached[1]} of {len(t1tl.seeds)} of T1TL. They [end](results/{beside.SHORT}) at a discounted return of
        {text(t2tl.end("discounted_return"))} and {text(t1tl.end("discounted_return"))} (published of T2TL, off a
        picture: {then:.2f}, and {returns[-1]:.2f} at {frames[-1] / 1e6:g} million).*""")
