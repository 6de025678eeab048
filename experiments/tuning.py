"""On which seeds the settings of each configuration were chosen, and with what: these seeds are not reported."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from t2tl_jax.errors import UserError, explained
from t2tl_jax.registry import configs
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.differences import differences
from t2tl_jax.training.seeds import FIRST_TUNING_SEED, parse_seeds


@dataclass(frozen=True)
class Tuning:
    """A search for settings."""

    methods: str
    """What was trained in it."""
    seeds: tuple[int, ...]
    """On which seeds."""
    of: str = ""
    """The named configuration that was searched for, where it is another one."""
    form: str = ""
    """What codes had in all of it, where that is known."""


_SEEDS = tuple(range(FIRST_TUNING_SEED, FIRST_TUNING_SEED + 12))
_WATER = Tuning("rm; codes: t1tl", _SEEDS, form="a frozen encoder and the bilinear head")
_ZONE = Tuning("t1tl, t2tl", _SEEDS)
_ZONE_LONG = Tuning("t1tl", (*range(12), *_SEEDS))  # of version 0.1, in part on the seeds that it reports

TUNED = {
    "zone_ppo": _ZONE,
    "zone_ppo_closed_form": _ZONE,
    "zone_ppo_long": _ZONE_LONG,
    "zone_ppo_random": _ZONE_LONG,
    "zone_ppo_safe": Tuning("t1tl", _SEEDS),
    "waterworld_dqn": _WATER,
    "zones_any": Tuning("look-ahead", _SEEDS[:4]),
    "flat_any": Tuning("look-ahead", _SEEDS[:4]),
    "water_any": Tuning("look-ahead", _SEEDS[:2]),
    "waterworld_dqn_paper": replace(_WATER, of="waterworld_dqn"),
    # There are maps 1 to 10 alone. On which of them crm's learning rate was chosen is not recorded: maybe on any.
    "rm_water_crm": Tuning("crm", tuple(range(1, 11))),
    "rm_water_crm_shaped": Tuning("crm", tuple(range(1, 11))),
    # Their settings are the authors', of whose search the same is known.
    "rm_water_crm_published": Tuning("crm", tuple(range(1, 11))),
    "rm_water_ql_published": Tuning("ql", tuple(range(1, 11))),
    "rm_water_ql_shaped_published": Tuning("ql", tuple(range(1, 11))),
    "rm_water_ql": Tuning("ql", (5, 6, 7, 8)),
    "rm_water_ql_shaped": Tuning("ql", (5, 6, 7, 8)),
}
"""By named configuration. Of the others no search is known."""


def nearest(config: Config) -> str:
    """The named configuration that a run's own differs from in the fewest fields, its method aside."""
    known = configs()
    return min(known, key=lambda name: len(list(differences(known[name][0], config))))


def tuning_seeds(config: Config, seeds: Iterable[int]) -> list[int]:
    """Those of a run's seeds that settings were chosen on, or are kept for that."""
    tuned = TUNED.get(nearest(config), Tuning("", ())).seeds
    return [seed for seed in seeds if seed >= FIRST_TUNING_SEED or seed in tuned]


def for_search(text: str) -> str:
    """The seeds of a search: ``4`` means the first four that are kept for tuning; a list must be of such seeds.

    Raises:
        UserError: for seeds that results are reported on.
    """
    with explained():
        seeds = parse_seeds(text)
    if text.strip().isdigit():
        seeds = tuple(FIRST_TUNING_SEED + seed for seed in seeds)
    if reported := [seed for seed in seeds if seed < FIRST_TUNING_SEED]:
        raise UserError(
            f"--seeds {text}: a search trains on seeds from {FIRST_TUNING_SEED} on, and results are reported on those "
            f"below, such as {reported[0]}; --seeds 4 means {FIRST_TUNING_SEED} to {FIRST_TUNING_SEED + 3} here"
        )
    return ",".join(map(str, seeds)) + ","


def for_report(config: Config, count: int = 12) -> str:
    """Seeds that results of a configuration may be reported on, as a flag takes them."""
    below = range(FIRST_TUNING_SEED)
    used = tuning_seeds(config, below)
    return ",".join([str(seed) for seed in below if seed not in used][:count])


def mixture(runs: Mapping[str, tuple[Config, Sequence[int]]]) -> str:
    """Why runs may not be tested against each other: some of their seeds are for tuning; '' if none are, or all.

    Args:
        runs: by name, the configuration and the seeds of each.
    """
    tuned = {name: tuning_seeds(config, seeds) for name, (config, seeds) in runs.items()}
    if not any(tuned.values()) or all(len(tuned[name]) == len(seeds) for name, (_, seeds) in runs.items()):
        return ""
    which = "; ".join(f"{name}: {in_words(seeds) or 'none'}" for name, seeds in tuned.items())
    return f"settings were chosen on some of these seeds and not on others, so they cannot be told apart ({which})"


def in_words(seeds: Sequence[int]) -> str:
    """``0-11, 100-111`` for a list of seeds in any order."""
    parts: list[list[int]] = []
    for seed in sorted(seeds):
        if parts and seed == parts[-1][-1] + 1:
            parts[-1][1:] = [seed]
        else:
            parts.append([seed])
    return ", ".join("-".join(map(str, part)) for part in parts)
