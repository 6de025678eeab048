"""How long a formula that is typed waits for its first action: what counts, and how it is told."""

import json
from types import SimpleNamespace

import pytest

import t2tl_jax
from experiments.benchmarks import prompt
from experiments.reproduction import typed
from t2tl_jax.errors import UserError
from t2tl_jax.ltl import Chains
from t2tl_jax.runs import prompt as prompts


@pytest.fixture
def played(monkeypatch):
    """Formulas that were played, after three that cannot be: the first compiles, the others take 1, 2, ... ms."""
    texts, refused = [], []

    class Played:
        def __init__(self, result, episode_length):
            assert episode_length == prompt.LENGTH

        def play(self, text):
            if len(refused) < 3:
                refused.append(text)
                raise UserError("no episode can satisfy it")
            texts.append(text)
            took = 900.0 if len(texts) == 1 else len(texts) - 1.0
            return SimpleNamespace(is_new_shape=len(texts) == 1, compile_ms=took / 2, action_ms=took)

    env = SimpleNamespace(propositions=("Up", "Down"))
    result = SimpleNamespace(config=SimpleNamespace(task=Chains()), experiment=SimpleNamespace(env=env))
    monkeypatch.setattr(t2tl_jax, "load", lambda run: result)
    monkeypatch.setattr(prompts, "Prompt", Played)
    return texts


def test_warming_up_does_not_count(played, tmp_path):
    file = tmp_path / typed.FILE
    assert prompt.main(["a/run", "--formulas", "10", "--json", str(file)]) == 0
    content = json.loads(file.read_text())
    assert len(played) == 10 and all("Up" in text or "Down" in text for text in played)
    assert content["results"]["a/run"] == {
        "drawn": 10,
        "counted": 9,
        "late": 5,
        "quantiles": [0.5, 0.95, 1.0],
        "compile_ms": [2.5, 4.3, 4.5],
        "action_ms": [5.0, 8.6, 9.0],
    }
    assert content["settings"]["aim_ms"] == prompt.AIM and len(content["load"]) == 2
    row = "| `a/run` | 9 of 10 | 2.5, 4.3, 4.5 | 5.0, 8.6, 9.0 | **not reached** | **not reached** | 5 |"
    assert row in typed.typed(tmp_path)
    assert typed.typed(tmp_path / "none") == "Not measured yet."


def test_the_aim_is_one_for_every_formula(tmp_path):
    def of(median, most, slowest, late):
        times = {"compile_ms": [1.0, 2.0, 3.0], "action_ms": [median, most, slowest]}
        return {"drawn": 10, "counted": 9, "late": late, "quantiles": [0.5, 0.95, 1.0], **times}

    def told(**results):
        stored = {
            "where": {"command": ["python"], "cpu_count": 2},
            "settings": {"aim_ms": 5.0},
            "load": [0.5, 7.25],
            "results": {f"runs/{name}": one for name, one in results.items()},
        }
        (tmp_path / typed.FILE).write_text(json.dumps(stored))
        return " ".join(typed.typed(tmp_path).split())

    text = told(a=of(1, 2, 6, 1), b=of(2, 5.5, 196.8, 2))
    assert "under 5 ms, of every formula. That is reached by the median in each and by the 95 % quantile in a, " in text
    assert "in a, not in b: 3 of 18 formulas took longer, and the slowest 196.8 ms." in text
    assert "load average was 0.5 before and 7.2 after, on 2 cores" in text
    assert "by the 95 % quantile in none: 2 of 9" in told(b=of(2, 5.5, 196.8, 2))


def test_mistakes_are_told_before_the_work(played, tmp_path, capsys):
    assert prompt.main(["a/run", "--formulas", "0"]) == 2
    assert prompt.main(["a/run", "--json", str(tmp_path / "none" / "file.json")]) == 2
    assert not played and "formulas" in capsys.readouterr().err
