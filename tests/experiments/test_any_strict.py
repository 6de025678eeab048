"""Agents to whom the tests are unseen in the strict sense: what is kept out of their pools, and what the page says."""

import json
from dataclasses import replace
from random import Random

import pytest

from experiments.reproduction import claims
from experiments.reproduction.anytask import met, tested, water_chains
from experiments.reproduction.anytask.runs import STRICT
from experiments.reproduction.runs import all_runs
from experiments.reproduction.sections import anystrict
from t2tl_jax.ltl import make_sampler, resolve_tasks, row_languages
from t2tl_jax.registry import make_env, named_config
from tests.made_up_runs import write
from tests.runs.test_pool_workers import CONFIG


@pytest.fixture(autouse=True)
def unpaired(monkeypatch):
    monkeypatch.setattr(claims, "worlds", lambda config, seeds: None)


@pytest.mark.slow
@pytest.mark.parametrize("name", [first for first, _ in anystrict.PAIRS])
def test_no_row_of_the_tests_is_met_under_any_names(name):
    config = all_runs()[name].config
    config = replace(config, pool=replace(config.pool, size=64, rows=512), frames=1)  # of the first pool
    env = make_env(config.env)
    _, renamed = met.rows_trained_on(config, env)
    tests = {task for tasks in anystrict.TESTS[name.removesuffix(STRICT)].values() for task in tasks}
    formulas = resolve_tasks(tests).values()
    of_tests = row_languages(formulas, env.propositions, env.alphabet, renamed=True)
    assert len(renamed) > 20 and len(of_tests) > 1 and renamed.isdisjoint(of_tests)


@pytest.mark.slow
def test_processes_count_the_same_rows():
    env = make_env(CONFIG.env)
    alone = replace(CONFIG, run=replace(CONFIG.run, pool_processes=0))
    first = range(2)
    assert met._rows_of_pools(CONFIG, env, first) == met._rows_of_pools(alone, env, first)


def test_pools_are_drawn_once_for_trainings_that_differ_in_what_reads_them(monkeypatch):
    env, drawn = make_env(CONFIG.env), []
    monkeypatch.setattr(met, "_of_pools", {})
    monkeypatch.setattr(met, "_rows_of_pools", lambda config, env, numbers: drawn.append(config) or len(drawn))
    other = replace(CONFIG, learner=replace(CONFIG.learner, learning_rate=0.5), seeds="5", run=replace(CONFIG.run))
    assert [met.rows_trained_on(config, env) for config in (CONFIG, other, CONFIG)] == [1, 1, 1]
    shorter = replace(CONFIG, frames=CONFIG.frames // 2)
    others = (shorter, replace(CONFIG, pool=replace(CONFIG.pool, seed=CONFIG.pool.seed + 1)), CONFIG, other)
    assert [met.rows_trained_on(config, env) for config in others] == [2, 3, 4, 4]
    assert len(met._of_pools) == met.MOST_KEPT


def made(tmp_path, name, success, rows):
    run = write(tmp_path / name, all_runs()[name].config, seeds=(1, 2, 3))
    tasks = [task for tasks in anystrict.TESTS[name.removesuffix(STRICT)].values() for task in tasks]
    ends = {"violation_rate": [0.01] * 3, "env_termination_rate": [0.02] * 3, "timeout_rate": [0.0] * 3}
    of = {policy: {"success_rate": success} | ends for policy in ("sampled", "deterministic")}
    (run.path / tested.FILE).write_text(json.dumps({"x": {"scale": "full", "tasks": dict.fromkeys(tasks, of)}}))
    shares = {"exactly": {}, "renamed": dict.fromkeys(tasks, rows), "rows": {}}
    (run.path / met.FILE).write_text(json.dumps(shares))
    return run


def test_a_strict_agent_stands_beside_the_other(tmp_path):
    values = {"any-flat": [0.9, 0.91, 0.92], "any-flat-strict": [0.7, 0.71, 0.72]}
    runs = {name: made(tmp_path, name, of, "0/2" if STRICT in name else "1/2") for name, of in values.items()}
    text = anystrict.strict(runs)
    strict, loose = (line for line in text.splitlines() if line.startswith("| any-flat") and " | flat_1 to 5 |" in line)
    assert "| 0/10 | 0.710 [" in strict and "| 5/10 | 0.910 [" in loose
    assert strict.endswith("| 0.700 | 0.010 | 0.020 | 0.000 |")
    assert "| any-flat-strict - any-flat | -0.200 [" in text and "Corrected for 4 comparisons, 1 of which" in text
    assert anystrict.strict({"any-flat": runs["any-flat"]}) == ""


def test_what_was_not_played_is_said_plainly(tmp_path):
    runs = {name: made(tmp_path, name, [0.9, 0.9, 0.9], "0/2") for name in ("any-water", "any-water-strict")}
    tasks = tested.read(runs["any-water"].path)["x"]["tasks"]
    part = {"x": {"scale": "full", "tasks": {"phi_water": tasks["phi_water"]}}}
    (runs["any-water"].path / tested.FILE).write_text(json.dumps(part))
    text = anystrict.strict(runs)
    assert f"| any-water | {anystrict.CHAINS} | 0/64 | not played | - | - | - | - |" in text and "yet" not in text
    assert anystrict.NOT_PLAYED in text and anystrict.NOT_PLAYED not in anystrict.strict(
        {"any-water-strict": runs["any-water-strict"]}
    )


def test_the_aim_on_chains_is_judged_by_the_strict_agent_alone(tmp_path):
    loose = {"any-water": made(tmp_path, "any-water", [0.99, 0.99, 0.99], "1/2")}
    flat = made(tmp_path, "any-flat-strict", [0.7, 0.7, 0.7], "0/2")
    assert anystrict.NOT_MEASURED in anystrict.strict(loose | {"any-flat-strict": flat})
    strict = made(tmp_path, "any-water-strict", [0.96, 0.97, 0.965], "0/2")
    text = anystrict.strict(loose | {"any-water-strict": strict})
    aim = next(line for line in text.splitlines() if line.startswith("| success on chains over eight colours of which"))
    assert "0.965 [" in aim and aim.endswith("| reached |") and anystrict.NOT_MEASURED not in text


@pytest.mark.slow
def test_the_chains_are_the_first_that_the_family_draws_with_their_end():
    config = named_config("water_any")
    env = make_env(config.env)
    draw, rng, found = make_sampler(config.task, env.propositions), Random(0), []
    (end,) = row_languages([water_chains.END], env.propositions, env.alphabet)
    while len(found) < 8:
        formula = draw(rng)
        if end in row_languages([formula], env.propositions, env.alphabet):
            found.append(formula)
    known = resolve_tasks(water_chains.CHAINS)
    assert list(known.values())[:8] == found and len(known) == 32
