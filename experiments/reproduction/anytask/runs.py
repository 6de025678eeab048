"""The trainings of agents for any task, by name. Frames and seeds are those that a budget of minutes on GPUs allows."""

from dataclasses import replace
from typing import Any

from envs import zones
from envs.zones import ZoneConfig, ZoneEnv
from experiments import any_configs, controls
from experiments.reproduction.anytask import suites, water_chains
from experiments.reproduction.plan import Run
from t2tl_jax.agents.dp_config import DPConfig
from t2tl_jax.ltl import Chains, Conjunction, Disjunction, Grammar, Mixture, Named
from t2tl_jax.networks.automaton_encoder import AutomatonConfig
from t2tl_jax.networks.context_config import ContextConfig
from t2tl_jax.networks.gated import GatedConfig
from t2tl_jax.networks.gru import GRUConfig
from t2tl_jax.networks.lookahead import LookaheadConfig
from t2tl_jax.networks.merged import MergedConfig
from t2tl_jax.networks.rgcn import RGCNConfig
from t2tl_jax.networks.roles import RolesConfig
from t2tl_jax.networks.state_encoders import FlatConfig
from t2tl_jax.networks.task_encoder import TaskEncoderConfig
from t2tl_jax.networks.transformer import TransformerConfig
from t2tl_jax.registry import named_config
from t2tl_jax.runs.config import Config, PoolConfig, SelectionConfig
from t2tl_jax.runs.convergence import ConvergenceConfig
from t2tl_jax.runs.pretraining_schedule import SCHEDULE
from t2tl_jax.single_state import SingleStateConfig

FIRST_SEED = 24
"""As in the runs on `phi_zone`: no search had seeds from 12 to 99."""

SECOND_SEED = 40
"""Of agents whose settings were chosen, on seeds from 100 on, after those with seeds from 24 on had been seen."""

THIRD_SEED = 60
"""Of agents whose settings were chosen once more, after those with seeds from 40 on had been seen."""

FOURTH_SEED = 76
"""Of agents whose settings were chosen after those with seeds from 60 on had been seen."""

FIFTH_SEED = 88
"""Of agents whose settings were chosen after those with seeds from 76 on had been seen."""

HEADLINE_SEEDS, ENCODER_SEEDS, MEMORY_SEEDS = "10", "4", "12"

ENCODER_FRAMES, FRESH_FRAMES, PRETRAINING_FRAMES, MEMORY_FRAMES = 20_000_000, 8_000_000, 3_000_000, 12_000_000

BROAD_FRAMES = 80_000_000
"""Of agents that are trained on the broad family."""

TEXTS = ("transformer", "gru")

DQN_FRAMES = 4_000_000

MEMORY_RANGE = 1.2
"""Metres that the lidar reaches, linearly, in SpecRLBench's partially observed worlds."""

MEMORY_STEPS = 24
"""Steps of the windows: in so many the robot goes 0.7 m at most."""

MEMORY_SEGMENT = 32
"""Steps over which a carried state is learned, from the one that was stored at the first of them."""

PAPER_COLOURS = ("Black", "White", "Red", "Yellow")

ZONE_TESTS = suites.ZONES.tasks
"""What agents of the open ZoneEnv are tested on, and what neither they nor their encoders are trained on."""

WIDE = Mixture(
    (
        Chains(depth=(1, 4)),
        Conjunction(Chains(depth=(1, 2)), (2, 3)),
        Disjunction(Chains(depth=(1, 2)), (2, 2)),
        Named("Until_1_2_1_1"),
        Named("Eventually_1_3_1_3"),
    )
)
"""What encoders are pre-trained on in the world of a single state: wider than what the agents are trained on."""

BROAD = Mixture(
    (
        Chains(depth=(1, 4), avoid=(0, 3)),
        Conjunction(Chains(depth=(1, 2)), (2, 3)),
        Disjunction(Chains(depth=(1, 2)), (2, 2)),
        Named("Until_1_2_1_1"),
        Named("Eventually_1_3_1_3"),
        Grammar(),
    ),
    (2.0, 2.0, 1.0, 0.5, 0.5, 4.0),
)
"""What encoders and agents alike are trained on, so that an agent meets texts of all kinds that its code was learned
from: two fifths of the formulas are written by the grammar."""

LEARNED: dict[str, TaskEncoderConfig] = {
    "transformer": TransformerConfig(output=32),
    "automaton": AutomatonConfig(),
    "rgcn": RGCNConfig(),
    "gru": GRUConfig(output=32),
}
"""Codes with parameters, which are pre-trained and then kept: from scratch they are not learned, see the last run."""

WITHOUT_PARAMETERS: dict[str, TaskEncoderConfig] = {
    "lookahead": LookaheadConfig(farther=True),
    "names": controls.NamesConfig(),
    "nothing": controls.NothingConfig(),
}

SOLVED_RATES = {"transformer": 2e-3, "gru": 3e-3}
"""Step sizes of readers of texts that learn by dynamic programming: of .001 to .005, and of .001 and .003, the best."""

SOLVED_FORMULAS = 2_000_000
"""How many places for random formulas their pools have. Far fewer rows are different: met.json counts them."""

POOL_PROCESSES = 12
"""Processes that draw these, for each of two trainings at a time on 32 cores."""

MERGED: dict[str, TaskEncoderConfig] = {
    "lookahead": LookaheadConfig(propositions=10, farther=True),
    "roles": RolesConfig(propositions=10),
}
"""Codes that say of each colour what it is to the task, with room for more colours than the training has."""

MEMORIES = ("t1tl", "t2tl", "gru", "carried")

MEMORY_GRU = GRUConfig(width=48, output=16)
"""Of the two recurrent policies, which then have as many parameters: one carries its state, one reads a window."""

STRICT = "-strict"
"""Ending of the names of agents whose training met no row of the tests."""

ANY_AGENTS = (
    *("any-zones", "any-letters", "any-flat", "any-water", "any-walls"),
    *(f"any-zones-broad-{text}" for text in TEXTS),
)
"""Agents that are kept, to be played by others."""


def any_runs() -> dict[str, Run]:
    """Every run of agents for any task."""
    return {**_headline(), **_strict(), **_broad(), **_solved(), **_encoders(), **_memory()}


def _headline() -> dict[str, Run]:
    zone = named_config("zones_any")
    walls = _with(_base(suites.WALLS.tasks), {"anneal_learning_rate": True}, {"task_encoder": MERGED["lookahead"]})
    walls = replace(walls, env=ZoneConfig(layout="random"), frames=20_000_000)
    letters = named_config("letters_any")
    water = _without(named_config("water_any"), suites.WATER.tasks)
    flat = named_config("flat_any")
    everything = {
        "suites": (suites.ZONES, suites.ZONE_MAPS, *suites.MORE_COLOURS),
        "certified": (*suites.ZONE_Z, *suites.ZONE_HARD),
        "drawn": ("z1", "long", "j10", "s8"),
    }
    tested: dict[str, tuple[Config, dict[str, Any]]] = {
        "any-zones": (zone, everything),
        "any-water": (water, {"suites": (suites.WATER,)}),
        "any-walls": (walls, {"suites": (suites.UNTIL, suites.WALLS)}),
        "any-letters": (letters, {"suites": (suites.LETTERS, suites.LETTERS_LONG, suites.LETTER_MAPS)}),
        "any-flat": (flat, {"suites": (suites.FLAT,)}),
    }
    again = {
        "any-zones": THIRD_SEED,
        "any-water": THIRD_SEED,
        "any-flat": SECOND_SEED,
    }
    runs = {
        name: _run(config, HEADLINE_SEEDS, early=True, first_seed=again.get(name, FIRST_SEED), **more)
        for name, (config, more) in tested.items()
    }
    dqn = replace(named_config("letters_any_dqn"), frames=DQN_FRAMES)
    return runs | {"any-letters-dqn": _run(dqn, ENCODER_SEEDS, suites=(suites.LETTERS, suites.LETTERS_LONG))}


def _strict() -> dict[str, Run]:
    """The same agents, to whom the tests are unseen in the strict sense: no row of theirs is drawn, under any
    renaming of propositions."""
    tested = {
        "any-zones": (suites.ZONES,),
        "any-letters": (suites.LETTERS, suites.LETTERS_LONG),
        "any-flat": (suites.FLAT,),
        "any-water": (suites.WATER, suites.WATER_CHAINS),
    }
    ends = {suites.WATER_CHAINS: (water_chains.END,)}  # which keep out all that end so
    # What is kept out as a whole is written as when these were made. It changes nothing: no row of it is drawn at all.
    whole = {"any-zones": suites.ZONE_Z, "any-letters": suites.LETTERS.tasks[:5], "any-flat": suites.FLAT.tasks}
    runs = {}
    for name, played in tested.items():
        config = _without(named_config(f"{name.removeprefix('any-')}_any"), whole.get(name, ()))
        tasks = ",".join(dict.fromkeys(task for suite in played for task in ends.get(suite, suite.tasks)))
        config = replace(config, pool=replace(config.pool, held_out=tasks))
        runs[f"{name}{STRICT}"] = _run(config, HEADLINE_SEEDS, FIFTH_SEED, suites=played)
    return runs


def _broad() -> dict[str, Run]:
    """One task family, world, budget and network with every code: lidars are gated by weights that one layer reads off
    the code, whatever it is. Codes that speak of each colour by itself also merge them, which takes any number."""
    base = _gated()
    merged = _with(base, network={"state": MergedConfig()})
    new = {
        f"any-zones-broad-{name}-merged": _run(
            _encoder(merged, encoder), HEADLINE_SEEDS, FOURTH_SEED, suites=(suites.ZONES, *suites.MORE_COLOURS)
        )
        for name, encoder in MERGED.items()
    }
    for name, encoder in WITHOUT_PARAMETERS.items():
        new[f"any-zones-broad-{name}"] = _run(
            _encoder(base, encoder), HEADLINE_SEEDS, FOURTH_SEED, suites=(suites.ZONES,)
        )
    for name in LEARNED:
        new |= _learned_first(f"broad-{name}", name, _offers(name), FOURTH_SEED)
    return new


def _solved() -> dict[str, Run]:
    """The same agents with codes that learn from many more texts: in the same world, from its solution."""
    return {
        run_name: run
        for name in TEXTS
        for run_name, run in _learned_first(f"solved-{name}", name, _millions(name), FIFTH_SEED).items()
    }


def _gated() -> Config:
    base = replace(_base(ZONE_TESTS), task=BROAD, frames=BROAD_FRAMES)
    return _with(base, {"learning_rate": 1e-3, "anneal_learning_rate": True}, {"state": GatedConfig()})


def _learned_first(name: str, encoder: str, lessons: Config, first_seed: int) -> dict[str, Run]:
    """A code that is learned by itself, and agents that are trained with it as it is."""
    before = f"any-pretraining-{name}"
    first = Run(lessons, seeds=HEADLINE_SEEDS, first_seed=first_seed, evaluated=False, suites=(suites.READ_ALONE,))
    config = replace(_encoder(_gated(), LEARNED[encoder]), pretrained="auto")
    config = _with(config, network={"freeze_task_encoder": True})
    more = (suites.EXCHANGED,) if encoder in TEXTS else ()
    agents = _run(config, HEADLINE_SEEDS, first_seed, before=before, suites=(suites.ZONES, *more))
    return {before: first, f"any-zones-{name}": agents}


def _offers(name: str) -> Config:
    """A pre-training in which two propositions are offered at a step, so that a code also has to tell what to leave.
    A Transformer learns to read more slowly, so it gets more frames, at half the learning rate."""
    config = _pretraining(LEARNED[name])
    slow = name == "transformer"
    sizes = {"num_envs": 1024, "minibatch_size": 4096, "learning_rate": 5e-4} if slow else {"learning_rate": 1e-3}
    config = replace(
        _with(config, {"anneal_learning_rate": True, **sizes}),
        env=SingleStateConfig(ZoneEnv(zones.OPEN).propositions, offered=2),
        task=BROAD,
        frames=30_000_000 if slow else 4_000_000,
    )
    return replace(config, pool=replace(config.pool, rows=448, period=2))


def _millions(name: str) -> Config:
    """The same lessons by dynamic programming, where a pool lasts for two gradient steps, each with all of its rows."""
    config = _offers(name)
    pool = replace(config.pool, period=1)
    played: Any = config.learner
    learner = DPConfig(network=played.network, minibatch_size=pool.rows, learning_rate=SOLVED_RATES[name])
    return replace(
        config,
        learner=learner,
        pool=pool,
        frames=-(-SOLVED_FORMULAS // pool.size) * learner.frames_per_iteration,
        run=replace(config.run, pool_processes=POOL_PROCESSES),
    )


def _encoders() -> dict[str, Run]:
    """A narrower family and fewer frames. Codes that do not speak of each colour by itself are read beside the
    observation as it is, and so is the look-ahead once more."""
    base = _base(ZONE_TESTS)
    base = replace(base, frames=ENCODER_FRAMES)
    flat = _with(base, network={"state": FlatConfig()})
    tested: dict[str, Any] = {"suites": (suites.ZONES,)}
    coloured: dict[str, Any] = {"suites": (suites.ZONES, *suites.MORE_COLOURS)}
    new = {
        "any-zones-lookahead-merged": _run(_encoder(base, MERGED["lookahead"]), ENCODER_SEEDS, **coloured),
        "any-zones-roles-merged": _run(_encoder(base, MERGED["roles"]), ENCODER_SEEDS, **coloured),
    }
    for name, encoder in WITHOUT_PARAMETERS.items():
        new[f"any-zones-{name}"] = _run(_encoder(flat, encoder), ENCODER_SEEDS, **tested)
    for name, encoder in LEARNED.items():
        before = f"any-pretraining-{name}"
        lessons = Run(_pretraining(encoder), seeds=ENCODER_SEEDS, first_seed=FIRST_SEED, evaluated=False)
        new[before] = replace(lessons, suites=(suites.READ_ALONE,))
        config = replace(_encoder(flat, encoder), pretrained="auto")
        config = _with(config, network={"freeze_task_encoder": True})
        more = (suites.EXCHANGED,) if name == "transformer" else ()
        new[f"any-zones-{name}"] = _run(config, ENCODER_SEEDS, before=before, suites=(suites.ZONES, *more))
    fresh = replace(_encoder(flat, LEARNED["transformer"]), frames=FRESH_FRAMES)
    new["any-zones-transformer-fresh"] = _run(fresh, ENCODER_SEEDS, **tested)
    return new


def _memory() -> dict[str, Run]:
    """Discs that are seen from near only: without memory, with either reader of the last steps, and with a state that
    is carried through the episode. Lidars are merged, also those that are remembered, and so are the states of the
    colours, by what these are to the task now."""
    base = _base(suites.ZONE_Z)
    env: Any = base.env
    base = replace(base, env=replace(env, lidar_range=MEMORY_RANGE), frames=MEMORY_FRAMES)
    contexts = {
        "t1tl": None,
        "t2tl": ContextConfig(length=MEMORY_STEPS),
        "gru": ContextConfig(length=MEMORY_STEPS, reader=MEMORY_GRU),
        "carried": ContextConfig(carried=True, reader=MEMORY_GRU, segment_length=MEMORY_SEGMENT),
    }
    return {
        f"any-memory-{name}": _run(_with(base, network={"context": contexts[name]}), MEMORY_SEEDS) for name in MEMORIES
    }


def _run(config: Config, seeds: str, first_seed: int = FIRST_SEED, **more: Any) -> Run:
    """A run whose agents are also tested on its own family, on formulas not trained on under their own names."""
    config = replace(
        config,
        selection=SelectionConfig(points=0),  # the parameters at the end are reported
        run=replace(config.run, evaluation_episodes=suites.EPISODES),
    )
    return Run(config, seeds=seeds, first_seed=first_seed, **more)


def _base(tests: tuple[str, ...]) -> Config:
    """What most agents of ZoneEnv have in common: narrower layers than any-zones, a constant step size, and fewer
    propositions to avoid."""
    config = replace(named_config("zones_any"), learner=any_configs.SMALL)
    return _without(replace(config, task=any_configs.any_tasks(Chains(depth=(1, 3)))), tests)


def _without(config: Config, tasks: tuple[str, ...]) -> Config:
    """The configuration whose training never begins, nor comes to, one of these tasks, whatever its propositions are
    called; what is left of them when they are begun may be met."""
    return replace(config, pool=replace(config.pool, unseen=",".join(dict.fromkeys(tasks))))


def _pretraining(encoder: TaskEncoderConfig) -> Config:
    learner: Any = SCHEDULE.learner
    return replace(
        SCHEDULE,
        env=SingleStateConfig(ZoneEnv(zones.OPEN).propositions),
        task=WIDE,
        pool=PoolConfig(size=192, rows=768, length=48, period=4, unseen=",".join(dict.fromkeys(ZONE_TESTS))),
        learner=replace(
            learner,
            network=replace(learner.network, task_encoder=encoder),
            num_envs=512,
            minibatch_size=2048,
        ),
        frames=PRETRAINING_FRAMES,
        convergence=ConvergenceConfig(),
        selection=SelectionConfig(points=0),
    )


def _encoder(config: Config, encoder: TaskEncoderConfig) -> Config:
    return _with(config, network={"task_encoder": encoder})


def _with(config: Config, learner: dict[str, Any] | None = None, network: dict[str, Any] | None = None) -> Config:
    """The configuration with other fields of its learner and of its network."""
    own: Any = config.learner
    return replace(config, learner=replace(own, network=replace(own.network, **(network or {})), **(learner or {})))
