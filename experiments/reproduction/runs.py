"""The trainings that the items share, by name. Names begin with the world and end with what is special."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from types import MappingProxyType
from typing import Any

from experiments import configs  # noqa: F401, registers the configurations
from experiments.methods import apply
from experiments.paper import step_tables
from experiments.reproduction import chance, rates, representations
from experiments.reproduction.anytask.runs import ANY_AGENTS, any_runs
from experiments.reproduction.plan import Run
from experiments.reproduction.pretraining_runs import pretraining_run
from experiments.reproduction.published_runs import published_runs
from experiments.reproduction.variants import changed_learner, with_context, with_encoder, with_gru_reader, with_rate
from t2tl_jax.registry import named_config
from t2tl_jax.runs.config import Config, SelectionConfig

ZONE_FRAMES = 10_000_000
"""The paper's budget on `phi_zone`."""

ZONE_SEARCH_FRAMES, RM_SEARCH_FRAMES = 3_000_000, 400_000
"""Of a search in ZoneEnv, as many as `zone_ppo` has, and of one in the reward-machine benchmark, where each step is an
update. That in WaterWorld has all."""

ALONE_END = "-alone"
"""Ending of the names of runs of one seed that has the device to itself, for its time."""

ZONE_METHODS = ("t2tl", "t1tl", "gnn", "dfa", "dfa_number", "dfa_cont")
"""Under PPO rm is dfa: there is no other state to learn from."""

WATER_METHODS = ("t2tl", "t1tl", "gnn", "rm", "dfa", "dfa_cont")
BENCHMARK_METHODS = ("crm", "ql", "crm_shaped", "ql_shaped")
SEARCH_METHODS = {
    "zone": ZONE_METHODS,
    "water": (*WATER_METHODS, "rm-6"),
    "safe": ZONE_METHODS,
    "rm": BENCHMARK_METHODS,
}
"""By what the names of their runs begin with, the methods that a section compares."""

STEP_METHODS = ("t1tl", "gnn", "rm")
WIDTHS = (8, 16, 32)

STEP_ROWS, STEP_LENGTH = 8, 54
"""Rows and tokens of the largest formula of the tables of steps, for which all of them leave room: one program."""

PER_16 = {"num_envs": 16, "unroll_length": 500, "batch_size": 512, "target_period": 100, "learning_rate": 1e-4}
"""One gradient step after every 16 steps of the environment, where the default makes one after 128."""

SHORT_EXPLORATION = PER_16 | {"epsilon_fraction": 0.01}
"""The same with exploration that fades within the first 25,000 frames instead of 125,000."""

EVERY_STEP = PER_16 | {"updates_per_step": 16, "batch_size": 32, "target_period": 1600}
"""One gradient step after every step, as published: as many samples as of `PER_16`, and targets as old in steps."""

PUBLISHED_RATE = 1e-5
"""Learning rate of the reward-machine benchmark as published, constant."""

ZONE_SEED = 24
"""Where the seeds of the runs in ZoneEnv begin: some of its settings were chosen on seeds 0 to 11, see
`experiments/tuning.py`. Those of WaterWorld, which are its maps, begin with 0."""

SOONER = ("", "-per-16", "-short-exploration")
"""Endings of the names of runs in WaterWorld, each of which learns sooner than the one before."""

BEGINNING = tuple(f"water-{name}{how}" for name in ("t1tl", "rm") for how in SOONER)

SHORTLY = {f"water-{method}": f"water-{method}{SOONER[-1]}" for method in WATER_METHODS if method not in ("t1tl", "rm")}
"""The other methods in the last of these ways, by their usual run."""


def again_name(name: str) -> str:
    """Name of a main run made once more."""
    return f"{name}-again"


MADE_AGAIN = {f"zone-{method}-pre-own": f"zone-{method}" for method in ("t2tl", "t1tl", "gnn")} | {
    "zone-t1tl-pre-none": "zone-t1tl-fresh-16"
}
"""Other runs that are made once more, as what others of one commit are compared with: by name, the first one."""

AGENTS = (
    *(f"zone-{method}" for method in ZONE_METHODS),
    *(f"safe-{method}" for method in ZONE_METHODS),
    "prime-own",
    *(again_name(f"water-{method}") for method in WATER_METHODS),
    *ANY_AGENTS,
)
"""The runs whose agents are kept, to be played by others."""

ALONE = "1"
"""One seed is enough for a run whose time is taken."""

MAPS = "1,2,3,4,5,6,7,8,9,10"
"""The maps of the reward-machine benchmark, which its seeds are."""


@cache
def all_runs() -> Mapping[str, Run]:
    """Every run of the reproduction; made once, since environments are built to see what the runs may pre-train on."""
    runs: dict[str, Run] = {
        one.NAME: Run(None, evaluated=False, measure=one.measure) for one in (representations, chance)
    }
    for parts, first_seed in (
        ((_zone, _zone_variants), ZONE_SEED),
        ((_water, _water_variants, _steps, _benchmark, _searches), 0),
    ):
        for part in parts:
            for name, run in part(runs).items():
                assert name not in runs, name
                runs[name] = replace(run, first_seed=run.first_seed or first_seed)
    return MappingProxyType(runs | _own_rates(runs) | any_runs())


def _zone_base(frames: int = ZONE_FRAMES, name: str = "zone_ppo") -> Config:
    """A short configuration of ZoneEnv with the paper's budget, or another one.

    Exploration fades over the same frames as in the shorter default. The learning rate falls to 0: at a constant one,
    agents that have long solved a task and get hardly any gradient are lost again now and then.
    """
    base = named_config(name)
    learner: Any = base.learner
    decay = learner.noise_decay * base.frames / frames
    return replace(base, frames=frames, learner=replace(learner, noise_decay=decay, anneal_learning_rate=True))


def _zone(runs: dict[str, Run]) -> dict[str, Run]:
    """The six methods on `phi_zone`, DFA both ways; each once more alone, for its time."""
    base = _zone_base()
    new: dict[str, Run] = {}
    for method in ZONE_METHODS:
        config = apply(base, method)
        before = pretraining_run(new, "zone", config)
        new[f"zone-{method}"] = Run(config, before)
        alone = None if before is None else _alone(new, before)
        new[f"zone-{method}{ALONE_END}"] = _timed(config, alone)
    return new


def _zone_variants(runs: dict[str, Run]) -> dict[str, Run]:
    """Widths of codes, pre-training, phi_safe, the attention figure, the published program, another reader."""
    base = _zone_base()
    new: dict[str, Run] = {}
    for width in WIDTHS:
        config = with_encoder(apply(base, "t1tl"), output=width)
        new[f"zone-t1tl-fresh-{width}"] = Run(replace(config, pretrained=""))
    new["zone-dfa-32"] = Run(with_encoder(apply(base, "dfa"), size=32))  # 1 and 16 are among the six methods
    for method in ("t2tl", "t1tl", "gnn"):
        for kind in ("none", "own", "random"):
            config = apply(base, method)
            before = None if kind == "none" else pretraining_run(runs, "zone", config, kind, new)
            config = replace(config, pretrained="") if before is None else config
            new[f"zone-{method}-pre-{kind}"] = Run(config, before)
    safe = _zone_base(name="zone_ppo_safe")
    for method in ZONE_METHODS:
        config = apply(safe, method)
        new[f"safe-{method}"] = Run(config, pretraining_run(new, "safe", config))
    prime = replace(base, task="phi_zone_prime")
    new["prime-fresh"] = Run(replace(prime, pretrained=""), read=True)
    new["prime-own"] = Run(prime, pretraining_run(new, "prime", prime), read=True)
    dropping = replace(prime, progression="paper")
    new["prime-progression-paper"] = Run(dropping, pretraining_run(new, "prime-progression-paper", dropping))
    new["prime-labels-state"] = Run(replace(prime, labels="state"), "prime-pretraining-transformer")
    published = named_config("zone_ppo_published")
    without = with_context(published, first_token="none")  # it was made before there was that token
    new["zone-published"] = Run(without, pretraining_run(new, "zone-published", without))
    new["zone-gru-reader"] = Run(with_gru_reader(base), "zone-pretraining-transformer")
    return new | published_runs()


def _water(runs: dict[str, Run]) -> dict[str, Run]:
    """The six methods on `phi_water`, 12 maps, and alone."""
    base = named_config("waterworld_dqn")
    new: dict[str, Run] = {}
    for method in WATER_METHODS:
        config = apply(base, method)
        before = pretraining_run(new, "water", config)
        new[f"water-{method}"] = new[again_name(f"water-{method}")] = Run(config, before)
        alone = None if before is None else _alone(new, before)
        new[f"water-{method}{ALONE_END}"] = _timed(config, alone)
    return new


def _water_variants(runs: dict[str, Run]) -> dict[str, Run]:
    """The paper's own form, simultaneous learning piece by piece, pre-training, widths of codes."""
    base = named_config("waterworld_dqn")
    new: dict[str, Run] = {}
    paper = named_config("waterworld_dqn_paper")
    for method in ("t1tl", "t2tl", "gnn"):
        config = apply(paper, method)
        new[f"water-paper-{method}"] = Run(config, pretraining_run(runs, "water", config, "own", new))
    new["water-t1tl-labels-state"] = Run(replace(apply(base, "t1tl"), labels="state"), "water-pretraining-transformer")
    slow = replace(
        apply(paper, "t1tl"), learner=changed_learner(apply(paper, "t1tl").learner, task_encoder_learning_rate=4e-5)
    )
    new["water-paper-t1tl-slow"] = Run(slow, "water-pretraining-transformer")

    t1tl, one_hot = apply(base, "t1tl"), apply(base, "rm")
    for name, config, before in (("t1tl", t1tl, "water-pretraining-transformer"), ("rm", one_hot, None)):
        learner = config.learner
        if name == "t1tl":  # of the one-hot code this is dfa
            own = replace(config, learner=changed_learner(learner, counterfactual=False))
            new["water-t1tl-own-row"] = Run(own, before)
        for variant, changed in (
            ("printed-argmax", replace(config, learner=changed_learner(learner, printed_argmax=True))),
            ("random-starts", replace(config, random_starts=0.5)),
            ("per-16", replace(config, learner=changed_learner(learner, **PER_16))),
            ("every-step", replace(config, learner=changed_learner(learner, **EVERY_STEP))),
            ("short-exploration", replace(config, learner=changed_learner(learner, **SHORT_EXPLORATION))),
        ):
            new[f"water-{name}-{variant}"] = Run(changed, before)

    for usual, name in SHORTLY.items():
        config = apply(base, usual.removeprefix("water-"))
        config = replace(config, learner=changed_learner(config.learner, **SHORT_EXPLORATION))
        new[name] = Run(config, pretraining_run(runs, "water", config))

    for method in ("t2tl", "t1tl", "gnn"):  # the encoder learns in all of them
        config = apply(base, method)
        network = replace(config.learner.network, freeze_task_encoder=False)
        config = replace(config, learner=changed_learner(config.learner, network=network))
        new[f"water-{method}-pre-none"] = Run(replace(config, pretrained=""))
        for kind in ("own", "random"):
            new[f"water-{method}-pre-{kind}"] = Run(config, pretraining_run(runs, "water", config, kind, new))

    for width in (8, 16):  # 32 is the default
        config = with_encoder(t1tl, output=width)
        before = pretraining_run(runs, f"water-{width}", config, "own", new)
        new[f"water-t1tl-{width}"] = Run(config, before)
    for width in (6, 32):  # 16 is the default
        new[f"water-rm-{width}"] = Run(with_encoder(one_hot, size=width))
    new[f"water-rm-6{ALONE_END}"] = _timed(with_encoder(one_hot, size=6), None)
    return new


def _steps(runs: dict[str, Run]) -> dict[str, Run]:
    """The worlds of the tables of steps; a world that two tables show is trained once."""
    base = named_config("waterworld_dqn")
    new: dict[str, Run] = {}
    worlds = [(cell, False) for cell in (*step_tables.BY_GOALS, *step_tables.BY_OBSTACLES)]
    for cell, same_maps in [*worlds, *((cell, True) for cell in step_tables.BY_SIZE)]:
        for method in STEP_METHODS:
            config = step_tables.configuration(apply(base, method), cell, same_maps)
            config = replace(config, run=replace(config.run, table_rows=STEP_ROWS, table_length=STEP_LENGTH))
            before = pretraining_run(runs, f"water-{cell.goals}-{cell.obstacles}", config, "own", new)
            new[step_name(cell, same_maps, method)] = Run(config, before, limits=step_tables.LIMITS)
    return new


def step_name(cell: step_tables.Cell, same_maps: bool, method: str) -> str:
    """Name of the run of one cell of the tables of steps."""
    size = f"-size-{cell.size:g}" if same_maps else ""
    return f"steps-{cell.goals}-{cell.obstacles}{size}-{method}"


def _benchmark(runs: dict[str, Run]) -> dict[str, Run]:
    """The reward-machine benchmark: ten tasks and the single one, plain and shaped."""
    new = {}
    for kind in BENCHMARK_METHODS:
        config = named_config(f"rm_water_{kind}")
        new[f"rm-{kind}"] = Run(config, seeds=MAPS)
        new[f"rm-single-{kind}"] = Run(_single_task(config), seeds=MAPS)
    single = _single_task(named_config("rm_water_crm"))
    slow = changed_learner(single.learner, learning_rate=PUBLISHED_RATE, anneal_learning_rate=False)
    new["rm-single-crm-slow"] = Run(replace(single, learner=slow), seeds=MAPS)
    for kind in ("ql", "ql_shaped"):
        new[f"rm-{kind}-published"] = Run(named_config(f"rm_water_{kind}_published"), seeds=MAPS)
    new["rm-single-crm-published"] = Run(_single_task(named_config("rm_water_crm_published")), seeds=MAPS)
    return new


def _single_task(config: Config) -> Config:
    """The benchmark's one task, the tenth, whose machine has three open states."""
    return with_encoder(replace(config, task="rm_t10_published"), size=3)


def _searches(runs: dict[str, Run]) -> dict[str, Run]:
    of_methods = {
        "zone": _zone_base(ZONE_SEARCH_FRAMES),
        "water": named_config("waterworld_dqn"),
        "safe": _zone_base(ZONE_SEARCH_FRAMES, "zone_ppo_safe"),
    }
    new: dict[str, Run] = {}
    for world, base in of_methods.items():
        new |= _search(world, {method: apply(base, method.replace("-", "_")) for method in SEARCH_METHODS[world]})
    benchmark = {kind: named_config(f"rm_water_{kind}") for kind in SEARCH_METHODS["rm"]}
    return new | _search("rm", {kind: replace(config, frames=RM_SEARCH_FRAMES) for kind, config in benchmark.items()})


def _search(world: str, methods: Mapping[str, Config]) -> dict[str, Run]:
    """Every method at three learning rates, on seeds for tuning; those that share an encoder share its pre-training on
    these seeds. Nobody plays what they come to, so parameters are not compared on the way."""
    new: dict[str, Run] = {}
    for method, config in methods.items():
        before = pretraining_run(new, f"{rates.SEARCH}{world}", config)
        config = replace(config, selection=SelectionConfig(points=0))
        for which in rates.RATES:
            new[rates.search_name(world, method, which)] = Run(with_rate(config, which), before, evaluated=False)
    return {name: replace(run, seeds=rates.SEEDS, search=True) for name, run in new.items()}


def _own_rates(runs: dict[str, Run]) -> dict[str, Run]:
    """The main runs of methods for which the search found another learning rate, once more with that one."""
    new = {}
    for world, methods in rates.OWN_RATE.items():
        for method, which in methods.items():
            shared = runs[f"{world}-{method}"]
            assert shared.config is not None
            new[rates.own_name(f"{world}-{method}")] = replace(shared, config=with_rate(shared.config, which))
    return new


def _timed(config: Config, before: str | None) -> Run:
    """A whole training for its time: one seed with the device to itself. Parameters are not compared on the way, which
    takes as long as the episodes that are played for it."""
    config = replace(config, selection=replace(config.selection, points=0))
    return Run(config, before, seeds=ALONE, evaluated=False, alone=True)


def _alone(new: dict[str, Run], before: str) -> str:
    """The same pre-training for the one seed whose time is taken."""
    name = f"{before}{ALONE_END}"
    new.setdefault(name, replace(new[before], seeds=ALONE, alone=True))
    return name
