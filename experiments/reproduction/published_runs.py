"""The runs of the published program in ZoneEnv: one choice of its code at a time, more seeds, and its critic's start.

The motion is in closed form, since MJX takes long to step so few environments so often.
"""

from dataclasses import replace
from typing import Any

from experiments.methods import apply
from experiments.reproduction.plan import Run
from experiments.reproduction.pretraining_runs import pretraining_run
from experiments.reproduction.variants import changed_learner
from t2tl_jax.registry import named_config
from t2tl_jax.runs.config import Config

MORE_SEED = 36
"""The first of the published program's second runs, whose seeds are the numbers that come next, chosen before any of
their outcomes was known."""
MORE_SEEDS, FEWER_MORE_SEEDS = (",".join(map(str, range(MORE_SEED, end))) for end in (60, 48))
"""Those of T1TL, and of T2TL, which takes longer."""

MORE = "-more"
"""What their names end with."""

VALUE_SEED = 60
"""The first seed of the runs of the published program whose critics are set below and above 0 at first, the number that
comes next."""
VALUE_SEEDS = ",".join(map(str, range(VALUE_SEED, 84)))
VALUE_BIAS = 0.5
"""By how much: of 36 critics 26 were nearer to 0 than this at first."""
VALUES = {"zone-published-t1tl-value-below": -VALUE_BIAS, "zone-published-t1tl-value-above": VALUE_BIAS}
"""What is added to the value of each of these runs."""
KEPT = "zone-published-t1tl-value-kept"
"""The same seeds with the critic as it is."""


def published_runs() -> dict[str, Run]:
    """All of them, and the runs that pre-train theirs."""
    return published_pieces() | _more() | _critics()


def published_pieces() -> dict[str, Run]:
    """The published program for T1TL without pre-training, and with one choice of its code as it is by default here,
    or with two of them."""
    base = _t1tl()
    default: Any = apply(named_config("zone_ppo_long"), "t1tl").learner

    def of_network(name: str) -> Any:
        network = replace(base.learner.network, **{name: getattr(default.network, name)})
        return changed_learner(base.learner, network=network)

    learners = {
        "": base.learner,
        "-correlated-noise": changed_learner(base.learner, noise_time=default.noise_time),
        "-no-bonus": changed_learner(base.learner, entropy_coefficient=default.entropy_coefficient),
        "-timeouts-no-end": changed_learner(base.learner, timeout_is_terminal=default.timeout_is_terminal),
        "-normalised-advantages": changed_learner(base.learner, normalise_advantage=True),
        "-512-environments": changed_learner(base.learner, num_envs=512, unroll_length=128),
        "-squashed-observations": of_network("observation"),
        "-critic-from-zero": of_network("value_scale"),
        "-corrected-reader": of_network("task_encoder"),
    }
    no_end = learners["-timeouts-no-end"]
    learners |= {
        "-timeouts-correlated": changed_learner(no_end, noise_time=default.noise_time),
        "-timeouts-normalised": changed_learner(no_end, normalise_advantage=True),
    }
    return {f"zone-published-t1tl{name}": Run(replace(base, learner=learner)) for name, learner in learners.items()}


def _more() -> dict[str, Run]:
    """The published program on other seeds: T1TL without pre-training as before, and T2TL with its pre-training and the
    first token of its windows."""
    t2tl, new = _closed_form(), dict[str, Run]()
    new[f"zone-published-t2tl{MORE}"] = Run(t2tl, pretraining_run(new, f"zone-published{MORE}", t2tl))
    new = {name: replace(run, seeds=FEWER_MORE_SEEDS) for name, run in new.items()}
    new[f"zone-published-t1tl{MORE}"] = Run(_t1tl(), seeds=MORE_SEEDS)
    return {name: replace(run, first_seed=MORE_SEED) for name, run in new.items()}


def _critics() -> dict[str, Run]:
    """T1TL without pre-training with its critic set below and above 0 at first, and as it is."""
    config, new = _t1tl(), dict[str, Run]()
    for name, bias in (VALUES | {KEPT: 0.0}).items():
        network = replace(config.learner.network, value_bias=bias)
        moved = replace(config, learner=changed_learner(config.learner, network=network))
        new[name] = Run(moved, seeds=VALUE_SEEDS, first_seed=VALUE_SEED)
    return new


def _t1tl() -> Any:
    return replace(apply(_closed_form(), "t1tl"), pretrained="")


def _closed_form() -> Config:
    published = named_config("zone_ppo_published")
    env: Any = published.env
    return replace(published, env=replace(env, physics="closed_form"))
