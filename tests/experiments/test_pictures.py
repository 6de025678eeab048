"""Pictures of items that have tables, too: ours beside the published curve of the same name, in the same colour."""

import numpy as np
import pytest
from PIL import Image

from experiments.paper import published_water
from experiments.reproduction.pictures import BAND, drawn, pictures, say_above
from experiments.reproduction.sections import ten_tasks, widths


def ours_and_published(picture):
    """Colours by the name of the curve."""
    return (
        {line.label.split(" (")[0]: line.colour for line in picture.lines if not line.dashed},
        {line.label.split(", ")[0]: line.colour for line in picture.lines if line.dashed},
    )


@pytest.mark.parametrize(("half", "labels"), [("water", widths.WATER), ("zone", widths.ZONE)])
def test_widths_have_a_picture_for_each_half(make, half, labels):
    runs = {name: make(name, iterations=100, episodes=100.0, success_rate=0.5) for name in labels}
    picture = pictures(runs, {name: make(f"safe-{name}") for name in ("t2tl", "t1tl")})[f"fig-dimensions/{half}"]
    ours, published = ours_and_published(picture)
    assert ours == published == {label: k for k, label in enumerate(labels.values())}
    assert [line.label.split(", ")[0] for line in picture.lines if line.dashed] == list(labels.values())


def test_the_benchmark_has_a_picture_of_its_ten_tasks(make):
    columns = {f"{what}_{k + 1}": 0.01 for k in range(10) for what in ("score", "best_score")}
    columns |= {f"episodes_{k + 1}": 10.0 for k in range(10)}
    runs = {name: make(name, seeds=(1, 2), frames=200_000, **columns) for name in ("rm-ql", "rm-crm_shaped")}
    picture = pictures(runs, {name: make(f"safe-{name}") for name in ("t2tl", "t1tl")})["benchmark"]
    ours, published = ours_and_published(picture)
    assert set(ours) == {"ql", "crm-rs"} and set(published) == set(ten_tasks.TEN.values())
    assert all(published[name] == colour for name, colour in ours.items())
    for line in picture.lines[:2]:  # what the table shows
        assert line.values.shape == (2, len(published_water.STEPS)) and "(2 maps)" in line.label
    np.testing.assert_allclose(picture.lines[0].values, list(ten_tasks.scores(runs)["rm-ql"].values()))


def test_nothing_is_drawn_of_runs_that_are_not_there(make):
    assert set(pictures({}, {name: make(f"safe-{name}") for name in ("t2tl", "t1tl")})) == {"short"}


def test_a_picture_can_say_above_what_it_is_of(tmp_path, make):
    picture, file = pictures({"zone-t1tl": make("zone-t1tl")}, {})["fig-zone"], tmp_path / "x.png"
    picture.draw(file)
    with Image.open(file) as image:
        before = np.asarray(image.convert("RGB"))
    say_above(file, "Smoke test")
    with Image.open(file) as image:
        after = np.asarray(image.convert("RGB"))
    assert (after[BAND:] == before).all() and (after[:BAND] < 100).any() and drawn(file) == picture.digest()
