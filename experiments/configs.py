"""Named configurations: a configuration is an instance of ``Config``, and ``CONFIGS`` holds those with a name."""

import math
import os
from dataclasses import dataclass, field, replace
from typing import Annotated

from tyro.constructors import PrimitiveConstructorSpec

from envs import single_state
from envs.registry import EnvConfig
from envs.single_state import SingleStateConfig
from envs.waterworld import WaterWorldConfig
from envs.waterworld import water_env as waterworld
from envs.zones import ZoneConfig
from envs.zones import zone_env as zones
from t2tl_jax import checks
from t2tl_jax.agents.dqn import DQNConfig
from t2tl_jax.agents.ppo import PPOConfig
from t2tl_jax.networks.actor_critic import NetworkConfig
from t2tl_jax.networks.context import ContextConfig
from t2tl_jax.networks.q_network import QNetworkConfig
from t2tl_jax.networks.transformer import TransformerConfig
from t2tl_jax.runs.convergence import ConvergenceConfig


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


def _default_cache() -> str:
    base = os.environ.get("XDG_CACHE_HOME") or os.path.join("~", ".cache")
    return os.path.join(base, "t2tl_jax", "xla")


@dataclass(frozen=True)
class RunConfig:
    """What happens around the training; none of it changes the numbers."""

    folder: str = "runs"
    """Runs are stored in FOLDER/<config>/<time>."""
    checkpoint_period: float = 120.0
    """Seconds between checkpoints; there is always one at the end."""
    evaluation_episodes: Count = 100
    """Episodes per seed and policy (deterministic, sampled) of the evaluation after training; 0 for none."""
    gif: bool = True
    """Draw one evaluated episode from above."""
    progress: bool = True
    """Show a progress bar."""
    compilation_cache: str = field(default_factory=_default_cache)
    """Folder where compiled programs are kept, so that the next run starts sooner; '' for none."""

    def __post_init__(self) -> None:
        if not self.checkpoint_period >= 0:  # inf is fine: none but the one at the end
            raise ValueError(f"checkpoint_period is in seconds and not negative, got {self.checkpoint_period}")
        checks.counts(self, "evaluation_episodes", least=0)


@dataclass(frozen=True)
class PoolConfig:
    """Random tasks: tables of many formulas of a family, one after another. Of a fixed task, nothing of this counts."""

    size: Count = 32
    """Formulas in a table; all seeds of a run have the same ones."""
    period: Count = 4
    """Iterations until the next table takes its place. Episodes under way then start anew."""
    rows: Count = 512
    """Rows of a table: what its formulas can become. Formulas that do not fit are drawn again."""
    length: Count = 48
    """Tokens of a row. Formulas that do not fit are drawn again."""
    seed: Count = 0
    """Which formulas are drawn. The pool for evaluation is another one in any case."""

    def __post_init__(self) -> None:
        checks.counts(self, "size", "period", "length")
        if self.rows < 3:
            raise ValueError(f"rows counts true, false and every open formula: at least 3, got {self.rows}")


@dataclass(frozen=True)
class Config:
    """Everything that a training run depends on. Of ``ppo`` and ``dqn`` one is there, with its kind of networks."""

    env: EnvConfig = field(default_factory=ZoneConfig)
    """The environment."""
    task: str = "phi_zone"
    """A formula such as 'F(Red & F White)', a task by name, a reward machine by name or file (needs one_hot), or a
    family such as Until_1_2_1_1: random tasks, see pool."""
    task_length: int = 0
    """Pad formulas to this many tokens; 0 for as many as the longest one has."""
    pool: PoolConfig = field(default_factory=PoolConfig)
    """How the tasks of a family are drawn."""
    simultaneous: float = 0.0
    """Share of training episodes that start at a random sub-task of the formula; evaluation never does."""
    network: NetworkConfig | QNetworkConfig = field(default_factory=NetworkConfig)
    """The networks: actor and critic for PPO, action values for DQN."""
    ppo: PPOConfig | None = field(default_factory=PPOConfig)
    """The learner for continuous actions, and for discrete ones."""
    dqn: DQNConfig | None = None
    """The learner for discrete actions."""
    frames: Count = 10_000_000
    """Environment steps of every seed; rounded up to whole iterations."""
    convergence: ConvergenceConfig = field(default_factory=ConvergenceConfig)
    """Stop before that when training has converged. Schedules over the run do not move."""
    pretrained: str = ""
    """Start with the task encoder (best parameters) of a pre-training run: its folder; or 'auto' to pre-train now on
    random formulas, 'auto:own' on this run's task, 'auto:TASK' on another task or family; '' starts fresh."""
    seeds: str = "1"
    """How many seeds (4 means 0, 1, 2, 3) or which (0,3,7; a single seed 7 is '7,'). All train in one program."""
    episode_length: Count = zones.EPISODE_LENGTH
    """Time limit of an episode, in steps."""
    run: RunConfig = field(default_factory=RunConfig)
    """Files and displays."""

    def __post_init__(self) -> None:
        if self.frames < 1:
            raise ValueError(f"frames must be at least 1, got {self.frames}")
        # One less than other counts: random lengths of first episodes are drawn from below the next number.
        checks.counts(self, "episode_length", most=checks.COUNTER_LIMIT - 1)
        checks.counts(self, "task_length", least=0)
        if not 0.0 <= self.simultaneous <= 1.0:
            raise ValueError(f"simultaneous is a share of episodes between 0 and 1, got {self.simultaneous}")
        if (self.ppo is None) == (self.dqn is None):
            given = "neither" if self.ppo is None else "both"
            raise ValueError(f"a configuration has one learner, ppo or dqn, and None for the other; got {given}")
        if self.frames > longest_run(self.learner):
            raise ValueError(
                f"frames must be at most {longest_run(self.learner):,} with these settings of the learner, "
                f"which counts in 32 bits, got {self.frames:,}"
            )
        needed = NetworkConfig if self.dqn is None else QNetworkConfig
        if not isinstance(self.network, needed):
            learner = "ppo" if self.dqn is None else "dqn"
            raise ValueError(f"{learner} needs network={needed.__name__}(...), got a {type(self.network).__name__}")
        if self.network.freeze_task_encoder and not self.pretrained and self.network.task_encoder != "one_hot":
            raise ValueError(
                "a frozen task encoder that was not pre-trained never learns anything, got "
                "network.freeze_task_encoder=True with pretrained=''; give --pretrained auto, or "
                "--network.freeze-task-encoder False"
            )
        if self.pretrained and self.network.task_encoder == "one_hot":
            raise ValueError(
                f"a one-hot code has no parameters to pre-train, got pretrained={self.pretrained!r} with "
                "network.task_encoder=one_hot; leave pretrained empty, or use a task encoder that reads formulas"
            )

    @property
    def learner(self) -> PPOConfig | DQNConfig:
        """Whichever of the two is there."""
        learner = self.ppo or self.dqn
        assert learner is not None  # checked when it was made
        return learner


def longest_run(learner: PPOConfig | DQNConfig) -> int:
    """The most frames for which no counter of the learner overflows.

    Both count iterations, and gradient steps where their size is annealed; DQN also counts steps of all environments
    (for ``learning_starts``), and gradient steps in any case (for ``target_period``).
    """
    if isinstance(learner, PPOConfig):
        counted = learner.epochs * learner.num_minibatches if learner.anneal_learning_rate else 1
    else:
        counted = learner.steps_per_iteration * max(learner.num_envs, learner.updates_per_step)
    return checks.COUNTER_LIMIT // counted * learner.frames_per_iteration


_ZONE = Config(network=NetworkConfig(context=ContextConfig()), pretrained="auto")

# Every departure of the published code from the paper's text, and its schedule. Its token padding counts as input.
_PUBLISHED = Config(
    task_length=25,
    pretrained="auto:phi_zone",
    network=NetworkConfig(
        transformer=TransformerConfig(
            norm="post", positions="none", masked=False, norm_after_pooling=True, t_fixup=True
        ),
        observation="raw",
        mean_scale=1.0,
        value_scale=1.0,
        context=ContextConfig(
            transformer=TransformerConfig(
                layers=2, norm="post", positions="none", masked=False, norm_after_pooling=True, t_fixup=True
            ),
            reset=False,
            aligned=False,
            halved=True,
            recompute=False,
            segment_length=1,
        ),
    ),
    ppo=PPOConfig(
        num_envs=16,
        rollout_steps=4096,
        epochs=10,
        minibatch_size=1024,
        discount=0.998,
        gae_lambda=0.95,
        learning_rate=3e-4,
        anneal_learning_rate=False,
        adam_epsilon=1e-8,
        clip=0.2,
        clip_value=True,
        value_coefficient=0.5,
        entropy_coefficient=0.003,
        noise_time=0.0,
        max_gradient_norm=0.5,
        normalise_advantage=False,
        timeout_is_terminal=True,
        staggered_start=False,
    ),
)

# Fixed codes, learned before on the task itself, as in the authors' DQN: there is a gradient step after every few steps
# of the environment, and with each the codes of all sub-tasks would move under the values.
_WATERWORLD = Config(
    env=WaterWorldConfig(layout="by_seed"),
    task="phi_water",
    pretrained="auto:own",
    network=QNetworkConfig(head="bilinear", task_layer=512, freeze_task_encoder=True),
    ppo=None,
    dqn=DQNConfig(),
    frames=2_500_000,
    episode_length=waterworld.EPISODE_LENGTH,
)

# The reward-machine experiments of JAIR 2022 in their own world: one environment, one update after every step. Their
# learning rate was 1e-5, and three layers of 1,024 read the state. Seed i runs on map i; their maps are 1 to 10.
_RM_DQN = DQNConfig(
    num_envs=1,
    steps_per_iteration=2000,
    batch_size=32,
    buffer_size=50_000,
    learning_starts=1000,
    target_period=100,
    discount=0.9,
    learning_rate=1e-4,
    epsilon_end=0.01,
    epsilon_fraction=0.1,
)

_RM_WATER = Config(
    env=WaterWorldConfig(colours=waterworld.LETTERS, layout="by_seed", delay=1),
    task="rm_water_published",
    network=QNetworkConfig(
        task_encoder="one_hot", one_hot_size=77, head="bilinear", state_layers=(512, 512), task_layer=512
    ),
    ppo=None,
    dqn=_RM_DQN,
    frames=2_000_000,
    seeds="1,2,3,4,5,6,7,8,9,10",
    episode_length=waterworld.EPISODE_LENGTH,
)

# The network sees nothing but the encoded task, through one linear layer, so that the encoder has to do the work.
PRETRAINING = Config(
    env=SingleStateConfig(),
    task="Eventually_1_5_1_4",
    network=NetworkConfig(env_layers=(), actor_layers=(), critic_layers=()),
    ppo=PPOConfig(
        num_envs=64,
        rollout_steps=32,
        epochs=4,
        minibatch_size=512,
        discount=0.9,
        gae_lambda=0.5,
        learning_rate=1e-3,
        clip=0.2,
        entropy_coefficient=0.01,
        noise_time=0.0,
        staggered_start=False,
    ),
    # Every gradient step encodes every row, which here is nearly all of the work.
    pool=PoolConfig(size=16, period=8, rows=192, length=40),
    frames=500_000,
    convergence=ConvergenceConfig(window=20),
    episode_length=single_state.EPISODE_LENGTH,
)

CONFIGS: dict[str, tuple[Config, str]] = {
    "zone_ppo": (
        _ZONE,
        "T2TL by PPO on phi_zone, ten million frames after pre-training on random formulas",
    ),
    "zone_ppo_published": (
        _PUBLISHED,
        "the same with the schedule and every choice of the published code: 16 environments x 4,096 steps",
    ),
    "zone_ppo_closed_form": (
        replace(_ZONE, env=ZoneConfig(physics="closed_form")),
        "zone_ppo with the motion in closed form instead of MuJoCo: many times faster on a CPU",
    ),
    "zone_ppo_random": (
        replace(_ZONE, env=ZoneConfig(layout="random")),
        "zone_ppo on random maps, a new one in every episode",
    ),
    "waterworld_dqn": (
        _WATERWORLD,
        "T1TL by double DQN on phi_water in WaterWorld, every sub-task learned from every step; 2.5 million frames "
        "after pre-training on the same task",
    ),
    "rm_water_crm": (
        _RM_WATER,
        "reward-machine benchmark: ten tasks, one update per step for every state (crm); seeds 1 to 10 are its maps",
    ),
    "rm_water_ql": (
        replace(
            _RM_WATER,
            # With targets of 32 samples instead of 32 x 77, the learning rate of crm is too large.
            dqn=replace(_RM_DQN, simultaneous=False, timeout_is_terminal=True, learning_rate=3e-5),
        ),
        "the same, but every step teaches only the machine's own state (ql)",
    ),
    "rm_water_parallel": (
        replace(
            _RM_WATER,
            dqn=replace(
                _RM_DQN,
                num_envs=32,
                steps_per_iteration=500,
                batch_size=512,
                buffer_size=100_000,
                learning_rate=3e-4,
            ),
        ),
        "the same tasks as rm_water_crm in 32 environments at once, with larger batches: sooner done, not as published",
    ),
    "pretrain_zone": (
        PRETRAINING,
        "pre-training of the task encoder on random formulas over ZoneEnv's colours; --task phi_zone as published",
    ),
    "pretrain_water": (
        replace(
            PRETRAINING,
            env=SingleStateConfig(waterworld.COLOURS),
            network=replace(PRETRAINING.network, transformer=QNetworkConfig().transformer),
        ),
        "the same over WaterWorld's colours, with its size of the encoded task",
    ),
}
"""Configuration and one line about it, by name."""
