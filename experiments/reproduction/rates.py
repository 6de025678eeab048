"""The one search that is made for every method: its learning rate, at three values, on seeds that are kept for tuning.

What it found has to be known before results are read, since it says what is trained next; so it is written down here.
"""

from collections.abc import Mapping

from t2tl_jax.training.seeds import FIRST_TUNING_SEED

SHARED = "same"
"""The usual learning rate, which all methods of a world share; in the benchmark crm and ql have one each."""

RATES = {"low": 1 / 3, SHARED: 1.0, "high": 3.0}
"""By the ending of a run's name, its learning rate as a multiple of the usual one."""

WORDS = {"low": "a third of it", SHARED: "the usual one", "high": "three times it"}
"""The same for a page."""

SEEDS = ",".join(str(FIRST_TUNING_SEED + k) for k in range(4))
"""Of the search; in WaterWorld they are its maps."""

WORLDS = ("zone", "water", "safe", "rm")
"""Where the search is made, as the names of runs begin: `phi_zone`, `phi_water`, `phi_safe` and the ten tasks of the
reward-machine benchmark."""

OWN_RATE: Mapping[str, Mapping[str, str]] = {
    "zone": {"gnn": "high", "dfa": "high", "dfa_cont": "high"},
    "water": {"dfa_cont": "low"},
    "safe": {"t2tl": "high", "t1tl": "high", "dfa": "high", "dfa_number": "high", "dfa_cont": "high"},
    "rm": {"crm": "high", "ql": "high", "ql_shaped": "high"},
}
"""By world whose search is stored in full, the methods for which another rate than the usual one is best, and which of
`RATES` that is: ``{"zone": {"gnn": "high"}, "water": {}}``. `tests/experiments/test_rates.py` compares it with what is
stored."""


SEARCH = "search-"
"""What the names of the runs of the search begin with."""


def scaled(learning_rate: float, which: str) -> float:
    """One of `RATES` times a learning rate, to three digits."""
    return float(f"{RATES[which] * learning_rate:.3g}")


def search_name(world: str, method: str, which: str) -> str:
    """Name of the run that tries one of `RATES` for a method."""
    return f"{SEARCH}{world}-{method}-{which}"


def own_name(name: str) -> str:
    """Name of a method's main run once more, with the method's own rate."""
    return f"{name}-own-rate"


def at_its_best(name: str) -> str:
    """Of a method's main run and the same with the method's own rate the one with the rate that the search took."""
    world, _, method = name.partition("-")
    return own_name(name) if method in OWN_RATE.get(world, {}) else name
