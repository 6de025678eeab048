"""What the kept agents come to is said of each, also of those that fail."""

from types import SimpleNamespace

import numpy as np

from experiments.reproduction.kept_agents import kept_agents
from t2tl_jax.runs import params_file


def run(folder, kept, rates):
    folder.mkdir()
    if kept is not None:
        params = {"final": {"a": np.zeros((1, 2), np.float32)}}
        params_file.write(folder / "params.npz", params, [kept], 1)
    return SimpleNamespace(path=folder, by_seed=lambda name: rates)


def test_agents_that_are_kept_are_told_with_their_success(tmp_path):
    rates = {3: 0.5, 4: 1.0}
    runs = {name: run(tmp_path / name, kept, rates) for name, kept in (("a", 3), ("b", 4), ("c", None))}
    text = " ".join(kept_agents(runs).split())
    assert "a (seed 3) 0.500, b (seed 4) 1.000. 1 of these 2 agents solve their task" in text and "c (" not in text
