"""The documentation's figures are those of the stored results: pages, parts of pages and pictures, made anew."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from experiments.reproduction import beside, parts, report, stored
from experiments.reproduction.pictures import drawn, pictures
from experiments.reproduction.runs import ZONE_METHODS, again_name
from experiments.reproduction.stored import Stored
from t2tl_jax.errors import UserError
from t2tl_jax.evaluation import statistics

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "results"
GENERATED = re.compile(r"<!-- reproduce: .*?<!-- end -->|^```.*?^```", re.M | re.S)
FIGURE = re.compile(
    r"\[-?\d*\.\d+, -?\d*\.\d+\]|\d (?:frames|steps)/s|\d\d s\b|\d/12\b|p = 0|± \d"
    r"|\d (?:us|ms|kB|kFLOP|GFLOP|GiB|TFLOP/s)\b|\d\.\d+ (?:times|million)"
)


@pytest.fixture(scope="module")
def wanted():
    return report.documentation(ROOT)


@pytest.fixture(scope="module")
def pages(wanted):
    return wanted.pages


@pytest.mark.slow
def test_pages_are_those_of_the_stored_results(pages):
    """Written anew by ``python -m experiments.reproduce --report True``."""
    names = ("results", "zeroshot", "methods", "speed", "performance", "usage")
    assert set(pages) == {f"docs/{name}.md" for name in names} | {"README.md"}
    for name, text in pages.items():
        assert (ROOT / name).read_text(encoding="utf-8") == text, f"{name} is not what results/ says"


@pytest.mark.parametrize("page", [*sorted(file.name for file in (ROOT / "docs").glob("*.md")), "../README.md"])
def test_no_interval_is_empty(page):
    assert re.findall(r"\[(-?[\d.,]*\d), \1(?: [\w/]+)?\]", (ROOT / "docs" / page).read_text(encoding="utf-8")) == []


@pytest.mark.slow
def test_pictures_are_those_of_the_stored_results(wanted, pages):
    """Each holds a digest of the numbers that it shows, or of the parameters that play; its pixels also depend on the
    version of matplotlib."""
    files = [file for file in (ROOT / "docs").iterdir() if file.suffix != ".md"]
    assert {f"docs/{file.name}": drawn(file) for file in files} == {
        name: picture.digest() for name, picture in wanted.pictures.items()
    }
    for picture in wanted.pictures.values():
        assert any(f"]({picture.file})" in pages[f"docs/{name}.md"] for name in ("results", "zeroshot", "usage"))
    assert "](docs/zone_short_curves.png)" in pages["README.md"]


@pytest.mark.parametrize(
    "page", ["README.md", *(f"docs/{name}.md" for name in ("methods", "usage", "python", "speed", "performance"))]
)
def test_no_figure_stands_outside_of_what_is_generated(page):
    """Intervals, seconds, speeds, seeds that solve something, tests: written by hand nobody would check them."""
    assert FIGURE.findall(GENERATED.sub("", (ROOT / page).read_text(encoding="utf-8"))) == []


def test_the_check_sees_figures():
    by_hand = "0.769 [0.756, 0.782], 2,446 frames/s, 313 s, 12/12, p = 0.32, 0.91 ± 0.02, 1.06 times, 120 us, 13 kB"
    assert len(FIGURE.findall(by_hand)) == 9 and FIGURE.findall(GENERATED.sub("", by_hand)) != []


def test_other_numbers_make_another_picture_and_another_page(tmp_path):
    shutil.copytree(RESULTS / beside.SHORT, tmp_path / beside.SHORT)
    before, said = pictures({}, stored.load(tmp_path / beside.SHORT))["short"], beside.short_schedule(tmp_path)
    before.draw(tmp_path / "x.png")
    assert drawn(tmp_path / "x.png") == before.digest() == drawn(ROOT / "docs" / before.file)
    metrics = tmp_path / beside.SHORT / "t2tl" / "metrics.csv"
    header, *rows = metrics.read_text(encoding="utf-8").splitlines()
    at = header.split(",").index("discounted_return")
    cells = rows[-1].split(",")
    cells[at] = str(float(cells[at]) - 0.5)
    metrics.write_text("\n".join([header, *rows[:-1], ",".join(cells)]) + "\n", encoding="utf-8")
    assert pictures({}, stored.load(tmp_path / beside.SHORT))["short"].digest() != before.digest()
    assert beside.short_schedule(tmp_path) != said


@pytest.mark.slow
@pytest.mark.parametrize("name", ["t2tl", "t1tl", "t2tl_4"])
def test_figures_of_the_short_schedule(name, pages):
    """By hand from the metrics: since when success stayed above 95 % in half of the seeds and in all, and the end.

    One that is lost before the end has not stayed there.
    """
    run = Stored(RESULTS / beside.SHORT / name)
    columns, since, ends = run.columns, [], []
    for seed in run.seeds:
        of_seed = columns["seed"] == seed
        low = np.flatnonzero(np.nan_to_num(columns["success_rate"][of_seed]) <= 0.95)
        frames = [*columns["frames"][of_seed], np.inf]
        since.append(frames[low[-1] + 1] / 1e6)
        last = slice(-round(0.05 * of_seed.sum()), None)
        episodes = columns["episodes"][of_seed][last]
        returns = np.nan_to_num(columns["discounted_return"][of_seed][last])  # NaN where no episode ended
        ends.append(np.average(returns, weights=episodes))
    (row,) = re.findall(rf"^\| `{name}` .*$", pages["docs/results.md"], re.M)
    last_one = f"{max(since):.2f} M" if np.isfinite(max(since)) else "-"
    stay = f"{np.isfinite(since).sum()}/12"
    assert f"| {stay} | {np.median(since):.2f} M / {last_one} | {statistics.mean(ends).text()} |" in row


@pytest.mark.slow
def test_the_table_of_methods_shows_stored_runs_and_dashes_for_others(pages):
    runs = stored.load(RESULTS / "paper")
    for method, cell in (("rm", -2), ("dfa", -2)):
        (row,) = re.findall(rf"^\| `{method}` .*$", pages["README.md"], re.M)
        first, again = (
            sum(rate > 0.95 for rate in runs[name].by_seed("success_rate").values())
            for name in (f"water-{method}", again_name(f"water-{method}"))
        )
        repeated = "the same training" if method == "rm" else f"{again}/12"
        assert row.split(" | ")[cell + 1].strip(" |") == f"{first}/12, again {repeated}"
    measured = [name for name in ZONE_METHODS if f"zone-{name}" in runs]
    for line in re.findall(r"^\| `.*$", pages["docs/methods.md"], re.M)[:8]:
        name = {"rm": "dfa"}.get(line.split("`")[1], line.split("`")[1])  # under PPO one is the other
        assert (line.split(" | ")[5] == "-") == (name not in measured)


def test_parts_are_replaced_between_their_markers():
    page = "a\n<!-- reproduce: x -->\nold\n<!-- end -->\nb\n<!-- reproduce: y -->\n<!-- end -->\n"
    new = parts.filled(page, {"x": "1\n2", "y": r"\1"}, "page")
    assert new == page.replace("old", "1\n2").replace("y -->\n", "y -->\n\\1\n")
    assert parts.filled(new, {"x": "1\n2", "y": r"\1"}, "page") == new


@pytest.mark.parametrize(
    ("page", "said"),
    [
        ("<!-- reproduce: x -->\nno end\n", "needs an '<!-- end -->'"),
        ("<!-- reproduce: x -->\n<!-- reproduce: x -->\n<!-- end -->\n", "needs an '<!-- end -->'"),
        ("<!-- reproduce: xx -->\n<!-- end -->\n", "did you mean 'x'"),
        ("nothing\n", "needs one place '<!-- reproduce: x -->', it has 0"),
        ("<!-- reproduce: x -->\n<!-- end -->\n" * 2, "it has 2"),
    ],
)
def test_markers_that_cannot_be_filled_are_explained(page, said):
    with pytest.raises(UserError, match=re.escape(said)):
        parts.filled(page, {"x": "new"}, "page")
