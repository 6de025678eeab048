"""The configuration of a run: everything that its numbers depend on, and what happens around it."""

import math
import os
from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

from tyro.constructors import PrimitiveConstructorSpec

from t2tl_jax import checks
from t2tl_jax.env import EnvConfig
from t2tl_jax.ltl import Limits, TaskFamily, named_families
from t2tl_jax.runs.convergence import ConvergenceConfig
from t2tl_jax.task_env import Labels
from t2tl_jax.training.types import LearnerConfig


def _whole_number(texts: list[str]) -> int:
    try:
        number = float(texts[0].replace("_", ""))
    except ValueError:
        number = math.nan
    if not math.isfinite(number) or number != int(number):
        raise ValueError(f"expected a whole number such as 200000 or 2e5, got {texts[0]!r}")
    return int(number)


Count = Annotated[
    int,
    PrimitiveConstructorSpec(
        nargs=1,
        metavar="INT",
        instance_from_str=_whole_number,
        is_instance=lambda value: isinstance(value, int),
        str_from_instance=lambda value: [str(value)],
    ),
]
"""A whole number that may be written 2e5 on the command line."""

Task = Annotated[
    str | TaskFamily,
    PrimitiveConstructorSpec(
        nargs=1,
        metavar="STR",
        instance_from_str=lambda texts: texts[0],
        is_instance=lambda value: isinstance(value, str | TaskFamily),
        str_from_instance=lambda value: [str(value)],
    ),
]
"""A task or a family by name, or a family itself, whose fields are flags as well."""


def _default_cache() -> str:
    base = os.environ.get("XDG_CACHE_HOME") or os.path.join("~", ".cache")
    return os.path.join(base, "t2tl_jax", "xla")


@dataclass(frozen=True)
class RunConfig:
    """What happens around the training; none of it changes the numbers, but for the rounding of sums and what
    `table_rows` says of random starts."""

    folder: str = "runs"
    """Runs are stored in FOLDER/<config>/<time>."""
    checkpoint_period: float = 120.0
    """Seconds between checkpoints, at least; there is always one at the end. They are written beside the training."""
    keep_replay: bool = False
    """Keep the replay of a training that has come to its end, so that it can go on with more frames. Until then replay
    is always kept. Of learners without replay (PPO) nothing of this counts."""
    evaluation_episodes: Count = 100
    """Episodes per seed and policy (deterministic, sampled) of the evaluation after training; 0 for none."""
    gif: bool = True
    """Draw one evaluated episode from above."""
    progress: bool = True
    """Show a progress bar."""
    compilation_cache: str = field(default_factory=_default_cache)
    """Folder where compiled and traced programs are kept, so that the next run starts sooner; '' for none. They are
    code: of a run that is opened again its own folder is not taken, but the default one, or that of the command."""
    seeds_at_once: Count = 0
    """The most seeds that are on the devices together; 0 for as many as fit into their memory. The others wait on the
    host, and every iteration goes through all groups."""
    devices_per_seed: int = 0
    """The most devices that the environments of one seed are spread over, where there are more devices than seeds
    take. 0 leaves it to the learner. Of PPO it is all of them on a CPU, where every core can be a device, and 1 on
    other hardware. Of DQN it is 1: its devices meet at every gradient step, and each has the whole replay. More than 1
    is refused where a seed has one environment."""

    table_rows: Count = 0
    """Rows that the table of a formula has room for, so that trainings of formulas of different sizes share one
    compiled program; 0 for as many as it needs. Where episodes start in random rows, others are drawn. Of families and
    reward machines nothing of this counts."""
    table_length: Count = 0
    """The same for the tokens of a row. An encoder that reads padding does not take it."""
    pool_processes: Count = 0
    """Processes that draw the tables of random tasks ahead of time, for pools that change faster than one core draws
    them; 0 for a thread. A script that sets it does its work under `if __name__ == "__main__":`. Of a curriculum
    nothing of this counts: it decides late what to draw."""

    def __post_init__(self) -> None:
        if not self.checkpoint_period >= 0:  # inf is fine: none but the one at the end
            raise ValueError(f"checkpoint_period is in seconds and not negative, got {self.checkpoint_period}")
        checks.episodes(self, "evaluation_episodes", least=0)
        names = ("devices_per_seed", "seeds_at_once", "table_rows", "table_length")
        checks.counts(self, *names, least=0)
        checks.counts(self, "pool_processes", least=0, most=1024, why="since all of them are started")


@dataclass(frozen=True)
class PoolConfig:
    """Random tasks: tables of many formulas of a family, one after another. Of a fixed task, nothing of this counts."""

    size: Count = 32
    """Formulas in a table; all seeds of a run have the same ones."""
    period: Count = 4
    """Iterations until the next table takes its place. Episodes under way then start anew, unless they `finish`."""
    rows: Count = 512
    """Rows of a table: what its formulas can become. Formulas that do not fit are drawn again."""
    length: Count = 48
    """Tokens of a row. Formulas that do not fit are drawn again."""
    nodes: Count = 0
    """Room for the letters of a table: where so many propositions hold together that letters are looked up in parts,
    what one part leaves open. 0 for twice as many as rows. Formulas that do not fit are drawn again."""
    finish: bool = False
    """Let episodes under way end with the tasks that they began with: the table then has room for two pools, and its
    period must be no shorter than an episode can be."""
    seed: Count = 0
    """Which formulas are drawn. The pool for evaluation is another one in any case."""
    held_out: str = ""
    """Tasks by name or formula, apart by commas, that training is not to meet: no formula is drawn that has an open row
    in common with one of them, under whatever names of propositions. '' for none."""
    unseen: str = ""
    """Likewise, but only the tasks themselves are kept out: no formula is drawn that means or can become one of them,
    under whatever names of propositions. What is left of them when they are begun may be trained on. '' for none."""

    def __post_init__(self) -> None:
        checks.counts(self, "size", "period", "length")
        checks.counts(self, "nodes", least=0)
        checks.whole(self, "rows", "seed")
        if self.rows < 3:
            raise ValueError(f"rows counts true, false and every open formula: at least 3, got {self.rows}")


@dataclass(frozen=True)
class SelectionConfig:
    """How the best parameters of a run are found, beside its final ones: by episodes that are played for nothing else.

    They are scored by the mean discounted return of their sampled policy. None of it changes the training.
    """

    points: Count = 10
    """How often in the second half of the run, its end included; where `convergence` may end it sooner, as often in the
    first half. 0 selects nothing: the final parameters are the best ones."""
    episodes: Count = 16
    """Episodes per seed at each point."""

    def __post_init__(self) -> None:
        checks.counts(self, "points", least=0)
        checks.episodes(self, "episodes")


@dataclass(frozen=True, kw_only=True)
class Config:
    """Everything that a training run depends on. The learner owns its network."""

    env: EnvConfig
    """The environment."""
    task: Task
    """A formula such as 'F(Red & F White)', a task by name, a reward machine by name or file (needs one_hot), or a
    family such as Until_1_2_1_1: random tasks, see pool. Families that are data, such as chains, have fields of their
    own: --task chains --task.depth 1 3."""
    task_length: int = 0
    """Pad formulas to this many tokens; 0 for as many as the longest one has."""
    limits: Limits = field(default_factory=Limits)
    """How large a task may become."""
    pool: PoolConfig = field(default_factory=PoolConfig)
    """How the tasks of a family are drawn."""
    map_period: Count = 16
    """Iterations after which training goes on with new random maps, which are made while it trains; 0 keeps the first
    ones. Where maps are not random, nothing of this counts."""
    progression: Literal["exact", "paper"] = "exact"
    """How formulas go on: by the usual rules, or by the paper's definition 2 with its last case, which drops a
    satisfied proposition and contradicts theorem 1; of the paper's tasks it changes phi_zone_prime only."""
    labels: Labels = "next"
    """Which labels a step reads: those of the state it leads to, or those of the state it leaves, as printed. The
    initial labels then count, and every verdict comes one step later."""
    random_starts: float = 0.0
    """Share of training episodes that start at a random sub-task of the formula (the on-policy form of the paper's
    simultaneous learning); evaluation never does."""
    renaming: bool = False
    """Give the propositions other names in every training episode, drawn at its start: objects change places in the
    observation together with the labels. Needs an environment that describes its objects; evaluation never does it."""
    learner: LearnerConfig
    """The learner with its network."""
    frames: Count = 10_000_000
    """Environment steps of every seed; rounded up to whole iterations."""
    until_solved: bool = False
    """Stop before that when every seed seems to have solved its task: success in training over 95 % in each of the
    last iterations, as many as an episode takes that runs into the time limit, and at least five."""
    convergence: ConvergenceConfig = field(default_factory=ConvergenceConfig)
    """Stop before that when training has converged. Schedules over the run do not move."""
    selection: SelectionConfig = field(default_factory=SelectionConfig)
    """How the best parameters are found, which evaluations report beside the final ones."""
    pretrained: str = ""
    """Start with the task encoder (best parameters) of a pre-training run: its folder; or 'auto' to pre-train now on
    random formulas, 'auto:own' on this run's task, 'auto:TASK' on another task or family; '' starts fresh."""
    pretraining_schedule: Literal["short", "published"] = "short"
    """What an automatic pre-training is trained with: as soon as it has converged, 500,000 frames at most, or the two
    million frames and the constants of the authors' code."""
    seeds: str = "1"
    """How many seeds (4 means 0, 1, 2, 3) or which (0,3,7; a single seed 7 is '7,'). All train in one program."""
    episode_length: Count = 1000
    """Time limit of an episode, in steps."""
    plan: Literal["none", "critic"] = "none"
    """At play, never in training: act by the shortest way to true as the task's code tells it, or look at every way
    that the task leaves open and act by the one that the critic values most where the agent is. Needs a code that is
    read off the table's transitions, such as lookahead."""
    run: RunConfig = field(default_factory=RunConfig)
    """Files and displays."""

    def __post_init__(self) -> None:
        if isinstance(self.task, str) and self.task.strip() in named_families():
            object.__setattr__(self, "task", named_families()[self.task.strip()])
        checks.kinds(self)
        checks.whole(self, "frames")
        if self.frames < 1:
            raise ValueError(f"frames must be at least 1, got {self.frames}")
        # One less than other counts: random lengths of first episodes are drawn from below the next number.
        checks.counts(self, "episode_length", most=checks.COUNTER_LIMIT - 1)
        checks.counts(self, "task_length", "map_period", least=0)
        checks.shares(self, "random_starts")
        if self.frames > self.learner.max_frames:
            raise ValueError(
                f"frames must be at most {self.learner.max_frames:,} with these settings of the learner, "
                f"which counts in 32 bits, got {self.frames:,}"
            )
        reader = self.learner.task_encoder
        learned = reader is not None and reader.learned
        if self.learner.freezes_task_encoder and not self.pretrained and learned:
            raise ValueError(
                "a frozen task encoder that was not pre-trained never learns anything, got "
                "learner.network.freeze_task_encoder=True with pretrained=''; set pretrained='auto', or "
                "freeze_task_encoder=False"
            )
        if self.pretrained and not learned:
            raise ValueError(
                f"a code without parameters cannot be pre-trained, got pretrained={self.pretrained!r} with a task "
                f"encoder of {type(reader).__name__}; leave pretrained empty, or use one that reads formulas"
            )

    @property
    def iterations(self) -> int:
        """As many as are needed for the frames asked for."""
        return -(-self.frames // self.learner.frames_per_iteration)

    def for_task(self, task: str | TaskFamily) -> "Config":
        """The same for another task, whose table is as large as it needs."""
        return replace(self, task=task, run=replace(self.run, table_rows=0, table_length=0))
