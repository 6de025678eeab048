"""The attention figure: drawn from what was read over seeds, and named by the numbers that it shows."""

import json

from experiments.paper import published_attention
from experiments.reproduction.attention_picture import PUBLISHED, TITLES, attention_picture
from experiments.reproduction.pictures import drawn
from experiments.reproduction.work import READING


def reading(value, tokens=published_attention.TOKENS):
    bar = {"value": value, "low": value - 0.1, "high": value + 0.1, "count": 12}
    stage = {"tokens": list(tokens), "attention_received": [bar] * len(published_attention.TOKENS)}
    return json.dumps({"over_seeds": {"start": stage, "end": stage}})


def test_it_shows_both_runs_and_the_published_agent(make, tmp_path):
    runs = {name: make(name) for name in TITLES}
    for run in runs.values():
        (run.path / READING).write_text(reading(0.9))
    picture = attention_picture(runs)["attention"]
    assert list(picture.panels) == [*TITLES.values(), PUBLISHED]
    picture.draw(tmp_path / "x.png")
    assert drawn(tmp_path / "x.png") == picture.digest() and picture.file in picture.markdown()
    (runs["prime-own"].path / READING).write_text(reading(0.91))
    assert attention_picture(runs)["attention"].digest() != picture.digest()
    (runs["prime-own"].path / READING).write_text(reading(0.9, tokens=["White"] * 9))
    assert attention_picture(runs) == attention_picture({"prime-fresh": runs["prime-fresh"]}) == {}
