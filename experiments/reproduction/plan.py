"""What a reproduction is made of: runs, which items share, and items, which are the tables and figures."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, TypeAlias

from envs.zones import ZoneConfig
from experiments.reproduction.anytask.suites import Suite
from t2tl_jax.agents.dp_config import DPConfig
from t2tl_jax.agents.dqn_config import DQNConfig
from t2tl_jax.agents.ppo_config import PPOConfig
from t2tl_jax.runs.config import Config, RunConfig
from t2tl_jax.training.seeds import parse_seeds

ScaleName: TypeAlias = Literal["smoke", "full"]


@dataclass(frozen=True)
class Run:
    """One training. Items that need the same one name it; it is done once."""

    config: Config | None
    """What is trained, at full scale but for its seeds; None where nothing is, see `measure`."""
    before: str | None = None
    """The run whose task encoder it starts with; None for a fresh one."""
    limits: tuple[int, ...] = ()
    """Time limits of its evaluations beside its own, in steps."""
    seeds: str | None = None
    """How many seeds it has, or which, where they are not those of the reproduction."""
    first_seed: int = 0
    """Where its seeds begin if only their number is given."""
    alone: bool = False
    """Whether no other run may be on its devices, since its time is reported."""
    evaluated: bool = True
    """Whether it is evaluated at the end; its curves are there in any case."""
    measure: Callable[[Path], None] | None = None
    """Makes the run's folder without a training."""
    read: bool = False
    """Whether its agents are read at the end: attention, and what removing a token changes."""
    suites: tuple[Suite, ...] = ()
    """Tasks that its agents are tested on at the end, beside its own."""
    certified: tuple[str, ...] = ()
    """Tasks for which its first seed gets a certificate."""
    drawn: tuple[str, ...] = ()
    """Tasks of which an episode of its first seed is recorded, all of them on one map, for a picture."""
    search: bool = False
    """Whether it is a trial of a search for settings, on seeds that are kept for tuning, or comes before such."""
    early: bool = False
    """Whether it is begun before other runs, however long they are."""

    @property
    def tested(self) -> bool:
        """Whether its agents are played on other tasks than its own."""
        return bool(self.suites or self.certified or self.drawn)


@dataclass(frozen=True)
class Item:
    """One table or figure of the paper, or one measurement beside it."""

    title: str
    runs: tuple[str, ...]
    """Names of the runs that it shows."""
    section: Callable[..., str] = field(repr=False)
    """(stored runs by name) -> its Markdown, without the title."""
    smoke: tuple[str, ...] = ()
    """The runs of a smoke test, where every other one would run the same lines; by default the first one."""
    beside: tuple[str, ...] = ()
    """Names of other items' runs that it shows too, where they are there; it does not have them done."""

    def names(self, scale: ScaleName) -> tuple[str, ...]:
        """The runs that are done at a scale."""
        return self.runs if scale == "full" else self.smoke or self.runs[:1]


@dataclass(frozen=True)
class Scale:
    """How much is done."""

    name: ScaleName
    seeds: str
    """How many seeds every run has that does not say so itself, counted from its first one; or which, for all of
    them."""

    def apply(self, run: Run) -> Config:
        """The configuration that is trained at this scale."""
        assert run.config is not None
        seeds = run.seeds or self.seeds
        if run.first_seed and "," not in seeds:
            seeds = _listed(seed + run.first_seed for seed in parse_seeds(seeds))
        config = replace(run.config, seeds=seeds, run=_quiet(run.config.run))
        return config if self.name == "full" else _small(config)


def cost(run: Run) -> float:
    """Roughly how long a run takes beside others, without a unit: steps and updates that wait for one another.

    All environments of a training step at once, and so do its seeds, so that neither makes it much longer.
    """
    if run.config is None:
        return 0.0
    learner: Any = run.config.learner
    if isinstance(learner, DPConfig):  # no steps, and gradient steps over the rows of one table
        return run.config.frames / learner.minibatch_size
    steps = run.config.frames / learner.num_envs
    if isinstance(learner, PPOConfig):
        updates = learner.epochs * run.config.frames / learner.minibatch_size
    else:
        updates = learner.updates_per_step * steps
    context = learner.network.context
    return (steps + updates) * (_CONTEXT if context is not None and not context.carried else 1)


_CONTEXT = 4
"""How much longer a step with a context window takes: measured 2.6 times in ZoneEnv, 8 in WaterWorld."""


def _listed(seeds: Iterable[int]) -> str:
    """The text that means these seeds, also if it is a single one."""
    return "".join(f"{seed}," for seed in seeds)


def _quiet(config: RunConfig) -> RunConfig:
    return replace(config, gif=False, progress=False, checkpoint_period=600.0)  # most take less


def _small(config: Config) -> Config:
    """The same with a network, a time limit and a budget that take seconds: it learns nothing, but runs every line."""
    learner: Any = config.learner
    network = learner.network
    changes: dict[str, Any] = {"task_encoder": _few_parameters(network.task_encoder)}
    context = network.context
    if context is not None:
        layers = 2 if context.halved else 1
        changes["context"] = replace(context, reader=_few_parameters(context.reader, layers))
    for name in ("env_layers", "actor_layers", "critic_layers", "state_layers", "head_layers"):
        if getattr(network, name, ()):
            changes[name] = (8,)
    if getattr(network, "task_layer", 0):
        changes["task_layer"] = 8
    network = replace(network, **changes)
    if isinstance(learner, PPOConfig):
        learner = replace(learner, network=network, num_envs=8, unroll_length=32, epochs=1, minibatch_size=128)
    elif isinstance(learner, DQNConfig):
        learner = replace(
            learner, network=network, num_envs=4, unroll_length=32, batch_size=8, buffer_size=512, learning_starts=32
        )
    elif isinstance(learner, DPConfig):
        learner = replace(learner, network=network, minibatch_size=32)
    env = config.env
    if isinstance(env, ZoneConfig):
        env = replace(env, physics="closed_form")
    return replace(
        config,
        env=env,
        learner=learner,
        frames=2 * learner.frames_per_iteration,
        episode_length=min(config.episode_length, 40),
        seeds=_listed(parse_seeds(config.seeds)[:2]),
        pool=replace(config.pool, size=2),
        run=replace(config.run, evaluation_episodes=2, pool_processes=min(config.run.pool_processes, 1)),
    )


def _few_parameters(part: Any, layers: int = 1) -> Any:
    """A reader of formulas or windows of a few parameters; what has no such sizes stays."""
    small = {"layers": layers, "width": 8, "heads": 2, "feed_forward": 8, "hidden": 8}
    return replace(part, **{name: size for name, size in small.items() if hasattr(part, name)})
