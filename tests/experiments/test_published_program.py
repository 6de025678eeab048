"""What the pages say of the published program: whom its noise keeps company, and its choices one at a time."""

import numpy as np

from experiments import configs
from experiments.reproduction.sections import figures
from tests.made_up_runs import played, rows


def test_successes_are_counted_by_the_noise_until_the_task_is_found(make):
    """Seed 24 finds it in the sixth of ten iterations, no other does; from the third on noise is at its limit."""
    entropy = np.tile([1.0, 1.5] + [figures.MOST_ENTROPY] * 8, (4, 1))
    success = np.tile([0.02, 0.0] + [0.01] * 8, (4, 1))
    success[0, 5:] = 0.9
    run = make("zone-published", seeds=(24, 25, 26, 27), entropy=entropy, success_rate=success, episodes=100.0)
    shown, said = rows(figures.noise(run)), figures.noise(run)
    assert shown["24"][1:] == ["200", "2", "300", "3"] and shown["24"][0].endswith(" M")
    assert shown["25"] == ["never", "200", "2", "800", "8"]
    assert "6 of 600 episodes" in said and "24 of 2,400 at the limit" in said
    assert "standard deviation is at most 1.314 (entropy 1.692 a dimension" in said


def test_noise_that_grows_is_told_apart_from_failing(make):
    """One piece never comes to the limit and solves one seed of four; the program comes to it and solves two."""
    most = np.tile([1.0] * 5 + [figures.MOST_ENTROPY] * 5, (4, 1))
    solved = {"evaluated": {1000: played([1.0, 0.99, 0.1, 0.0], 200.0)}}
    runs = {
        figures.BASE: make(figures.BASE, entropy=most, **solved),
        f"{figures.BASE}-512-environments": make(f"{figures.BASE}-512-environments", entropy=most, **solved),
        f"{figures.BASE}-normalised-advantages": make(
            f"{figures.BASE}-normalised-advantages",
            entropy=np.tile([[0.5], [0.6], [0.7], [0.8]], 10),
            evaluated={1000: played([1.0, 0.9, 0.1, 0.0], 200.0)},
        ),
    }
    said = figures.noise_of_pieces(runs)
    assert rows(said)[figures.BASE] == ["2/4", "4/4", "4/4", "1.69 to 1.69", "1.69 to 1.69"]
    assert rows(said)[f"{figures.BASE}-normalised-advantages"] == ["1/4", "0/4", "0/4", "0.50 to 0.50", "0.60 to 0.80"]
    assert "Below the limit in every seed: normalised-advantages solves 1 of 4." in said
    assert "Below the limit" not in figures.noise_of_pieces({figures.BASE: runs[figures.BASE]})
    whole = figures.published_pieces(runs)
    heading = next(line for line in whole.splitlines() if line.startswith("| frames | t1tl as published"))
    assert "normalised-advantages" in heading and "512-environments" not in heading
    assert "Not in this table: 512-environments" in whole


def test_what_the_published_configuration_leaves_out_is_listed(request):
    page = (request.config.rootpath / "docs" / "methods.md").read_text(encoding="utf-8")
    listed = page.partition("The program leaves out:")[2].partition("\n\nAn earlier")[0]
    items = [" ".join(item.split()).rstrip(";.") for item in listed.strip().split("\n- ")]
    assert [item.removeprefix("- ") for item in items] == list(configs.ZONE_PUBLISHED_LEAVES_OUT)
