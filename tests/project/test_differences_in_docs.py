"""Tests and intervals in docs/results.md, computed anew from the stored runs."""

import json
import re
from pathlib import Path

import pytest

from t2tl_jax.evaluation.comparisons import compare, outcome
from t2tl_jax.evaluation.statistics import mean_rate
from t2tl_jax.runs.metrics_file import ending, history

ROOT = Path(__file__).parents[2]
DOCS = (ROOT / "docs" / "results.md").read_text(encoding="utf-8")
METHODS = ("t2tl", "t1tl", "gnn", "dfa", "dfa_cont")


def test_order_of_the_methods_on_phi_zone():
    runs = {}
    for name in METHODS:
        curves = history(ROOT / "results" / "zone_methods_h200" / name / "metrics.csv")
        runs[name] = dict(enumerate(ending(curves, 0.05)["discounted_return"]))
    found = compare(runs, {})  # one map for all seeds: nothing to pair
    rows = re.findall(r"^\| (\w+) - (\w+) \| (.+) \| (.+) \| (.+) \| (.+) \|$", DOCS, re.MULTILINE)
    assert [row[:2] for row in rows] == list(found)
    for *names, gap, pvalue, probability, claim in rows:
        each = found[tuple(names)]
        assert (gap, probability, claim) == (each.gap.text(), each.improvement.text(2), outcome(each.gap))
        assert each.pvalue == pytest.approx(float(pvalue), abs=0.006)


@pytest.mark.parametrize(
    ("run", "policy", "row"),
    [
        ("phi_t1tl", "deterministic", "| t1tl: Transformer, every row |"),
        ("phi_rm", "deterministic", "| rm: one-hot, every row |"),
        ("phi_dfa", "deterministic", "| dfa: one-hot, own row |"),
        ("phi_t1tl_random", "deterministic", "| t1tl, random formulas, trained further (*) |"),
        ("phi_t1tl_fresh", "deterministic", "| t1tl, no pre-training (*) |"),
    ],
)
def test_success_over_seeds_on_phi_water(run, policy, row):
    (line,) = (line for line in DOCS.splitlines() if line.startswith(row))
    stored = json.loads((ROOT / "results" / "water_h200" / run / "evaluation.json").read_text(encoding="utf-8"))
    seeds = stored["evaluations"][0]["policies"][policy]["seeds"]
    rates = {name: mean_rate([seed[name]["value"] for seed in seeds]) for name in ("success_rate", "violation_rate")}
    assert "| " + " | ".join(rate.text() for rate in rates.values()) + " |" in line
