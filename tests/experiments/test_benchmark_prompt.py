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
        "quantiles": [0.5, 0.95, 1.0],
        "compile_ms": [2.5, 4.3, 4.5],
        "action_ms": [5.0, 8.6, 9.0],
    }
    assert "| `a/run` | 9 of 10 | 2.5, 4.3, 4.5 | 5.0, 8.6, 9.0 | **not reached** |" in typed.typed(tmp_path)
    assert typed.typed(tmp_path / "none") == "Not measured yet."


def test_mistakes_are_told_before_the_work(played, tmp_path, capsys):
    assert prompt.main(["a/run", "--formulas", "0"]) == 2
    assert prompt.main(["a/run", "--json", str(tmp_path / "none" / "file.json")]) == 2
    assert not played and "formulas" in capsys.readouterr().err
