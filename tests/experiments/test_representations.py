"""The table of representations, of what is stored now and of what was stored before tasks were added."""

import json

import pytest

from experiments.reproduction import representations, stored
from t2tl_jax.ltl import named_task
from tests.made_up_runs import rows


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / representations.NAME
    representations.measure(folder)
    return stored.Stored(folder)


@pytest.mark.slow
def test_the_papers_own_tasks_are_among_them(measured):
    text = representations.section({representations.NAME: measured})
    assert set(rows(text)) >= {"`phi_zone`", "`phi_water`", "`phi_water_5_3`", "`phi_water_6_2`"}
    assert rows(text)["`phi_water`"][:6] == ["54", "5", "1", "5", "16 (ZoneEnv), 32 (WaterWorld)", "7 x 256"]
    assert named_task(representations.OWN) == named_task(representations.SAME)
    assert "`phi_water_5_3` is `phi_water` by another name." in text
    assert f"median of {representations.REPEATS} times" in text


def test_the_published_words_stand_beside_what_was_measured(measured):
    text = representations.section({representations.NAME: measured})
    assert rows(text)["size"][0] == "fixed" and rows(text)["size"][2] == "flexible"
    assert "2 to 6" in rows(text)["size"][1] and "8 to 54 tokens" in rows(text)["size"][3]


def test_what_was_stored_with_fewer_tasks_is_still_shown(measured, tmp_path):
    kept = json.loads((measured.path / representations.FILE).read_text())["rows"]
    (tmp_path / representations.FILE).write_text(json.dumps({"rows": kept[:3]}))
    (tmp_path / "versions.json").write_text((measured.path / "versions.json").read_text())
    text = representations.section({representations.NAME: stored.Stored(tmp_path)})
    assert (
        "`phi_zone`" in rows(text)
        and "another name" not in text
        and "median of 5 times" in text
        and "2 to 3" in rows(text)["size"][1]
    )
