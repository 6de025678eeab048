"""How far the one time that a method has can be trusted, and which orders of reward per unit time hang on it."""

from collections.abc import Mapping

from experiments.benchmarks import measured
from experiments.benchmarks.trainings import training
from experiments.reproduction.claims import Values, compared
from experiments.reproduction.page import paragraph
from experiments.reproduction.runs import ALONE_END
from experiments.reproduction.stored import Stored
from t2tl_jax.evaluation.comparisons import Pairs, outcome

CONFIG = {"water": "waterworld_dqn"}
"""The configurations that are benchmarked as they are timed here."""

NEAR = 0.1
"""By how much the time of one of two methods is moved, to see whether their order hangs on it."""

BENCHMARKS = "benchmark_*.json"
"""Beside the folder of the paper's runs."""


def doubts(runs: Mapping[str, Stored], claims: Mapping[str, Pairs], rates: Values) -> list[str]:
    """How far times agree with benchmarks, and which outcomes would be others if one of two times were another.

    Args:
        runs: with those of one seed that were timed.
        claims: by world, the pairs that are compared.
        rates: reward per minute, by run and seed.
    """
    each = []
    for name, run in runs.items():
        world, _, method = name.removesuffix(ALONE_END).partition("-")
        if name.endswith(ALONE_END) and world in CONFIG and not method.startswith("pretraining"):
            rate, own = _benchmarked(run, f"{CONFIG[world]}:{method}"), run.frames / run.train_seconds
            if rate is not None:
                each.append(f"{rate / own:.2f} times as many frames/s of {name}")
    said = []
    if each:
        said.append(
            "How sure is one such time? At the same commit, on the same kind of GPU and with one seed alone, "
            f"benchmarks of some iterations made {'; '.join(each)} as the timed trainings."
        )
    if hang := [pair for pairs in claims.values() for pair in _hanging(runs, pairs, rates)]:
        said.append(
            f"With {NEAR:.0%} more or less time for one of the two methods, these outcomes would be others: "
            f"{', '.join(hang)}."
        )
    return [paragraph(" ".join(said))] if said else []


def _hanging(runs: Mapping[str, Stored], pairs: Pairs, rates: Values) -> list[str]:
    """The claims whose outcome depends on a little of one method's time."""
    found = []
    for better, worse in pairs:
        if better not in rates or worse not in rates:
            continue
        outcomes = set()
        for share in (0.0, NEAR, -NEAR):
            moved = {seed: rate / (1 + share) for seed, rate in rates[better].items()}
            there = {name: runs[name] for name in (better, worse)}
            _, moved_by = compared(there, pairs, {better: moved, worse: rates[worse]})
            outcomes.add(outcome(moved_by[better, worse].gap))
        if len(outcomes) > 1:
            found.append(f"{better} > {worse}")
    return found


def _benchmarked(run: Stored, what: str) -> float | None:
    """Frames per second of one seed of a training, by a benchmark of a run's commit and kind of device."""
    for file in sorted(run.path.parents[1].glob(BENCHMARKS)):
        where, rows = measured.read(file)
        if where["git_modified"] or any(where[name] != run.versions[name] for name in ("git_revision", "devices")):
            continue
        for row in rows:
            if (row.part, row.what, row.size) == ("training", what, "1 seed"):
                return row.rate if training(what).learner == run.config.learner else None
    return None
