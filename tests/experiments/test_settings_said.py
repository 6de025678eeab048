"""What sections say of settings: for which form they were chosen, and in which of them compared runs differ."""

import dataclasses
from types import SimpleNamespace

import pytest

from experiments.reproduction.items import ITEMS
from experiments.reproduction.sections import settings
from t2tl_jax.registry import named_config

pytestmark = pytest.mark.usefixtures("unpaired")


def test_for_which_form_settings_were_chosen_is_said_beside_the_others(make):
    names = ("water-t1tl", "water-paper-t1tl", "water-rm", "water-dfa", "water-rm-per-16")
    runs = {name: make(name) for name in names}
    text = settings.chosen({name: runs[name] for name in names[:2]})
    assert text.startswith("Settings were chosen for `waterworld_dqn` on seeds 100-111 (with rm; codes: t1tl), where")
    assert "a frozen encoder and the bilinear head. They were not chosen again for an encoder that is trained" in text
    assert (
        "trained on (water-paper-t1tl); nor for a code that is concatenated with the state (water-paper-t1tl)" in text
    )
    own_row = settings.chosen({name: runs[name] for name in ("water-rm", "water-dfa")})
    assert "again for learning from the own row alone (water-dfa). " in own_row and "trained on" not in own_row
    assert settings.chosen({name: runs[name] for name in ("water-t1tl", "water-rm")}) == ""
    assert settings.chosen({"water-rm-per-16": runs["water-rm-per-16"]}) == " ".join(settings.EARLIER.split())
    zone = {name: make(name) for name in ("zone-t1tl-pre-none", "zone-published-t1tl")}
    assert settings.chosen(zone) == ""  # in what form those of ZoneEnv were chosen is not recorded


@pytest.mark.parametrize("item", ["water-form", "simultaneous", "simultaneous-one-hot", "pretraining-water"])
def test_sections_of_waterworld_say_for_which_form_settings_were_chosen(make, item):
    text = ITEMS[item].section({name: make(name) for name in ITEMS[item].runs})
    assert "They were not chosen again for " in text and settings.LEADS in text


def test_encoders_that_begin_otherwise_have_no_settings_of_their_own(make):
    names = [f"water-gnn-pre-{kind}" for kind in ("none", "own")]
    said = settings.chosen({name: make(name) for name in names})
    assert "an encoder that is trained on (all runs here); nor for no pre-training (water-gnn-pre-none)." in said


def test_compared_runs_that_differ_in_several_settings_say_which():
    shared = named_config("zone_ppo")
    slower = dataclasses.replace(shared.learner, epochs=9, discount=0.5)
    configs = {
        "base": shared,
        "one": dataclasses.replace(shared, random_starts=0.5),
        "two": dataclasses.replace(shared, learner=slower, seeds="3"),
        "fresh": dataclasses.replace(shared, pretrained="", learner=slower),
    }
    runs = {name: SimpleNamespace(config=config) for name, config in configs.items()}
    pairs = [("base", "one"), ("base", "two"), ("two", "fresh"), ("base", "fresh"), ("base", "missing")]
    text = settings.settings(runs, pairs)
    epochs, discount = shared.learner.epochs, shared.learner.discount
    first = f"- base, two: `learner.discount` {discount}, 0.5; `learner.epochs` {epochs}, 9."
    assert text.splitlines()[:3] == [settings.MANY, "", first]
    assert text.splitlines()[3].startswith("- base, fresh: ") and "`pretrained` auto:own, no" in text
    assert len(text.splitlines()) == 4 and settings.settings(runs, [("base", "one")]) == ""
