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
"""By how much the time of one of two methods is moved, to see whether their order hangs on it, unless it is known that
the times of two methods are further off."""

BENCHMARKS = "benchmark_*.json"
"""Beside the folder of the paper's runs."""


def doubts(runs: Mapping[str, Stored], claims: Mapping[str, Pairs], rates: Values) -> list[str]:
    """How far times agree with benchmarks, and which outcomes would be others if one of two times were another.

    Args:
        runs: with those of one seed that were timed.
        claims: by world, the pairs that are compared.
        rates: reward per minute, by run and seed.
    """
    each, off = [], []
    for name, run in runs.items():
        world, _, method = name.removesuffix(ALONE_END).partition("-")
        if name.endswith(ALONE_END) and world in CONFIG and not method.startswith("pretraining"):
            rate, own = _benchmarked(run, f"{CONFIG[world]}:{method}"), run.frames / run.train_seconds
            if rate is not None:
                off.append(rate / own)
                each.append(f"{off[-1]:.2f} times as many frames/s of {name}")
    said = []
    if each:
        said.append(
            "How sure is one such time? At the same commit, on the same kind of GPU and with one seed alone, "
            f"benchmarks of some iterations made {'; '.join(each)} as the timed trainings."
        )
    share = max(NEAR, max(off) / min(off) - 1 if off else 0.0)
    if hang := [pair for pairs in claims.values() for pair in _hanging(runs, pairs, rates, share)]:
        said.append(
            f"If one of the two methods took {share:.0%} more or less time{', as far as these differ' * bool(off)}, "
            f"these outcomes would be others: {', '.join(hang)}."
        )
    return [paragraph(" ".join(said))] if said else []


def _hanging(runs: Mapping[str, Stored], pairs: Pairs, rates: Values, share: float) -> list[str]:
    """The claims whose outcome depends on such a share of one method's time."""
    found = []
    for better, worse in pairs:
        if better not in rates or worse not in rates:
            continue
        there, outcomes = {name: runs[name] for name in (better, worse)}, set()
        for who, by in ((better, 0.0), (better, share), (better, -share), (worse, share), (worse, -share)):
            values = {name: rates[name] for name in there}
            values |= {who: {seed: rate / (1 + by) for seed, rate in rates[who].items()}}
            _, differences = compared(there, pairs, values)
            outcomes |= {outcome(one.gap) for one in differences.values()}
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
