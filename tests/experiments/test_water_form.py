"""WaterWorld's learners in the paper's form: each beside itself, and what the page says of why it stays behind."""

import numpy as np
import pytest

from experiments.reproduction import claims
from experiments.reproduction.runs import all_runs
from experiments.reproduction.sections import water_form
from tests.made_up_runs import played

NEAR = np.array([0.0, 0.001, 0.002, 0.003])
LIMIT = all_runs()["water-t1tl"].config.episode_length


@pytest.fixture(autouse=True)
def unpaired(monkeypatch):
    """Environments need not be built to see whether seeds share maps: `test_claims.py` does that."""
    monkeypatch.setattr(claims, "worlds", lambda config, seeds: None)


def test_each_method_in_the_papers_form_stands_beside_itself(make):
    frozen = {f"water-{one}" for one in water_form.READERS}
    whole = [(first, second) for first, second in water_form.PAIRS if first in frozen and "paper" in second]
    assert [second for _, second in whole] == [f"water-paper-{one}" for one in water_form.READERS]
    for first, second in water_form.PAIRS:
        configs = [all_runs()[name].config for name in (first, second)]
        readers = {config.learner.task_encoder for config in configs}
        contexts = {config.learner.network.context for config in configs}
        assert len(readers) == len(contexts) == 1, (first, second)

    levels = {kind.format(one): 0.8 - 0.1 * step + 0.02 * (one == "gnn") for one in water_form.READERS
              for step, kind in enumerate((water_form.FROZEN, water_form.TRAINED, water_form.PAPER))}  # fmt: skip
    levels[water_form.SLOW] = 0.65
    slow, moved = {"code_change_relative": 0.1}, {"code_change_relative": 0.3}
    runs = {
        name: make(
            name, success_rate=level + NEAR, target_lag=0.1 + NEAR, evaluated={LIMIT: played(0.9, 9.0)},
            **(slow if name == water_form.SLOW else moved),
        )
        for name, level in levels.items()
    }  # fmt: skip
    text = " ".join(water_form.why(runs).split())
    assert "with the same head, by t1tl 0.100" in text and "gnn 0.100" in text
    assert "which concatenates, by t1tl 0.100" in text and "no sign of older targets" in text
    assert "move 0.100 instead of 0.300" in text and "the difference is 0.050" in text
    assert "difference whose interval leaves out 0 for none" in text  # by what they end with they are equal
    assert "success of the final parameters, in episodes of their own" in water_form.water_form(runs)
    assert water_form.why({name: run for name, run in runs.items() if name != water_form.SLOW}) == ""
