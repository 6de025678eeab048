"""The section of attention: claims of every seed, and what is said of agents that do not do the task."""

import json

import pytest

from experiments.paper import published_attention
from experiments.reproduction.sections import attention
from experiments.reproduction.work import READING
from t2tl_jax.registry import named_config
from tests.made_up_runs import outcome, played, pretrained, reading, rows

pytestmark = pytest.mark.usefixtures("unpaired")


def test_attention_claims_are_asked_of_every_seed(make):
    run = make("prime-own", seeds=tuple(range(12)), status=pretrained(7000))
    star = {"start": {"3: and": 6, "8: White": 6}, "end": {"4: Black": 12}}
    (run.path / READING).write_text(json.dumps(reading(star, agreement=0.0, black=1.0, seeds=12)))
    text = attention.attention({"prime-own": run})
    assert outcome(text, "prime-own: token* is the conjunction at the start") == "undecided"
    assert outcome(text, "prime-own: token* is Black at the end") == "reproduced"
    assert outcome(text, "prime-own: token* is the needed token at the end") == "not reproduced"
    assert outcome(text, "prime-own: Black is entered first at the end") == "reproduced"
    assert "Corrected for 8 comparisons, 4 of which can be made so far." in text
    assert rows(text)["4: Black"][-2:] == ["0.96", "1.67"]
    assert rows(text)["published, end"][0] == "Black (1.67)"
    assert "| layer 0 | layer 1 |" in text and "Pre-training, apart: 7,000 frames a seed" in text
    assert attention.attention({}) == ""


def test_attention_without_weights_is_removal_alone(make):
    """A graph network attends to nothing; runs that were read before projections were stored have none."""
    run = make("prime-fresh")
    found = reading({"start": {}, "end": {}}, agreement=0.0, black=0.5, seeds=4)
    for stage in found["over_seeds"].values():
        stage["attention_received"], stage["agreement"] = None, dict.fromkeys(("value", "low", "high")) | {"count": 0}
    del found["out_projection_change"]
    (run.path / READING).write_text(json.dumps(found))
    text = attention.attention({"prime-fresh": run})
    assert outcome(text, "prime-fresh: Black is entered first at the end") == "undecided"
    assert "token* is" not in text.split("Token* is")[0] and "layer 0" not in text


def test_agents_that_do_not_do_the_task_are_counted_beside_their_attention(make):
    runs, limit = {}, named_config("zone_ppo").episode_length
    for name, rates in (("prime-fresh", [1.0, 1.0, 0.96, 0.04]), ("prime-own", None)):
        runs[name] = make(name, evaluated={limit: played(rates, 9.0)} if rates else None)
        (runs[name].path / READING).write_text(json.dumps(reading({"start": {}, "end": {}}, 0.5, 0.5, 4)))
    text = attention.attention(runs)
    assert rows(text)["prime-fresh, start"][-2:] == ["-", "-"] == rows(text)["prime-own, end"][-2:]
    assert rows(text)["prime-fresh, end"][-2] == "3/4" and rows(text)["prime-fresh, end"][-1].startswith("0.750 [")
    assert "carry it out is 0.75 (prime-fresh)." in " ".join(text.split())
    assert attention.of_all({("prime-own", "end"): {}}, runs) == ""


def test_published_attention_sums_to_the_heads():
    for values in (published_attention.START, published_attention.END):
        assert len(values) == len(published_attention.TOKENS) and sum(values) == pytest.approx(8, abs=0.05)
