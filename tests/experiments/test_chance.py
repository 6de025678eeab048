"""Random play in WaterWorld, and what the page says of it."""

import json

import pytest

from envs.waterworld import WaterWorldConfig
from envs.waterworld.params import RADIUS, SPEED
from experiments.paper.published_water import PHI_WATER
from experiments.reproduction import chance, stored
from experiments.reproduction.items import ITEMS
from experiments.reproduction.page import made_by, page
from experiments.reproduction.runs import all_runs
from experiments.reproduction.sections import chance as section
from t2tl_jax.registry import make_env
from tests.made_up_runs import rows

MAPS = (0, 1, 2)


def of_map(number, value):
    return {
        "map": number,
        "episodes": 2000,
        "mean_return": value,
        "success_rate": 0.001,
        "violation_rate": 0.9,
        "mean_length": 60.0,
        "frames": 120_000,
    }


def write(folder, *settings):
    """A finished measurement, of factors of radius, speed and the maps' radius, and the mean of three maps."""
    folder.mkdir(parents=True)
    measured = [
        {
            "radius": radius,
            "speed": speed,
            "map_radius": map_radius,
            "maps": [of_map(number, value + 0.001 * (number - 1)) for number in MAPS],
        }
        for radius, speed, map_radius, value in settings
    ]
    content = {"task": "phi_water", "episode_length": 600, "compile_seconds": 7.0, "seconds": 90.0}
    (folder / chance.FILE).write_text(json.dumps(content | {"settings": measured}))
    (folder / "status.json").write_text(json.dumps({"state": "finished", "ended": "complete", "seeds": []}))
    (folder / "versions.json").write_text(json.dumps({"started": {"cpu": "an abacus", "devices": ["an abacus"]}}))
    return stored.Stored(folder)


def test_a_setting_is_said_and_stands_beside_the_published_values(tmp_path):
    default, small = (1.0, 1.0, 1.0, -0.998), (0.5, 1.0, 2.0, -0.5)
    text = section.random_play({chance.NAME: write(tmp_path / chance.NAME, default, small)})
    assert rows(text)["the default world"][0] == "radius x 1"
    assert rows(text)["the default world"][1].startswith("-0.9980 [-1.0000, ")
    assert rows(text)["radius x 0.5"][0] == "radius x 2" and rows(text)["radius x 0.5"][4:] == ["60.0", "2,000"]
    assert all(f"{method} {curve[0]:.2f}" in text for method, curve in PHI_WATER.items())
    assert "In all 720,000 frames in 90 s, compiling 7 s" in text
    assert section.random_play({}) == ""


@pytest.mark.parametrize(
    ("value", "where"),
    [(-0.95, "none of these settings"), (-0.89, "the default world (-0.890)"), (0.2, "the default world (0.200)")],
)
def test_who_reaches_the_published_values_follows_from_the_numbers(tmp_path, value, where):
    text = section.random_play({chance.NAME: write(tmp_path / chance.NAME, (1.0, 1.0, 1.0, value))})
    assert f"the highest published value at 500 episodes, -0.89 (GNN_pre), at: {where}." in text


def test_settings_are_told_apart_by_their_maps_too(tmp_path):
    high = [(1.0, 1.0, 2.0, -0.1), (1.5, 1.0, 2.0, -0.2), (1.0, 2.0, 1.0, -0.3), (1.0, 1.0, 1.0, -0.9)]
    text = section.random_play({chance.NAME: write(tmp_path / chance.NAME, *high)})
    assert text.count("the default world on maps for radius x 2 (-0.100); radius x 1.5 on maps for radius x 2 (") == 1
    assert "(-0.200); speed x 2 (-0.300)." in text


def test_the_item_shows_trainings_and_chance_in_any_order_of_coming(tmp_path, make):
    item = ITEMS["water-beginning"]
    trained = {"water-rm": make("water-rm", seeds=(0, 1), episodes=1000.0)}
    random = {chance.NAME: write(tmp_path / "made" / chance.NAME, (1.0, 1.0, 1.0, -0.99))}
    both = item.section(trained | random)
    assert item.section(trained) in both and section.random_play(trained | random) in both
    assert "Ours, mean of these 500: water-rm 0.000." in both
    assert "map by map: water-rm 0.990 [" in both and "Ours" not in item.section(random)
    assert item.section({}) == ""
    assert "Seeds: 2. Commits" in made_by(list((trained | random).values()))
    assert "Seeds" not in made_by(list(random.values()))
    text = page({"water-beginning": item}, random, smoke=False)
    assert "Random play is at or above" in text and "Not measured yet: water-t1tl," in text


def test_a_smoke_test_leaves_it_out_and_a_reproduction_does_not():
    item = ITEMS["water-beginning"]
    assert chance.NAME not in item.names("smoke") and chance.NAME in item.names("full")
    assert all_runs()[chance.NAME].measure is chance.measure


def test_worlds_differ_in_what_their_setting_says_alone():
    base = WaterWorldConfig(layout="by_seed")
    slow = chance.Setting(speed=0.5).world(base)
    assert set(slow.radii) == {RADIUS} and slow.ball_speed == 0.5 * SPEED
    worlds = [setting.world(base) for setting in chance.SETTINGS if setting.map_radius != 1]
    assert {world.map_radius_of_each_colour for world in worlds} == {(2 * RADIUS,) * 8}
    assert {world.ball_speed for world in worlds} == {SPEED} and len({world.radii for world in worlds}) == len(worlds)
    starts = [make_env(world).make_params(7).starts for world in (base, slow)]
    assert (starts[0].balls == starts[1].balls).all()


@pytest.mark.slow
def test_it_is_measured(tmp_path):
    settings = (chance.Setting(), chance.Setting(radius=2.0, map_radius=2.0))
    chance.measure(tmp_path / chance.NAME, episodes=50, settings=settings, maps=MAPS)
    runs = stored.load(tmp_path)
    measured = json.loads((tmp_path / chance.NAME / chance.FILE).read_text())["settings"]
    first, second = ([one["mean_length"] for one in setting["maps"]] for setting in measured)
    assert [one["map"] for one in measured[0]["maps"]] == list(MAPS) and len(first) == len(second) == 3
    assert sum(second) < sum(first)  # large balls are sooner touched
    for one in measured[0]["maps"]:
        assert one["mean_return"] == pytest.approx(one["success_rate"] - one["violation_rate"])
        assert one["episodes"] == 50 and one["frames"] == round(50 * one["mean_length"])
    assert "the default world" in rows(section.random_play(runs))
