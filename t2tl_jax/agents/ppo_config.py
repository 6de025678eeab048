"""The constants of PPO, checked, and the sizes that follow from them."""

from dataclasses import dataclass, field
from typing import ClassVar, Literal

from t2tl_jax import checks
from t2tl_jax.networks.actor_critic import NetworkConfig
from t2tl_jax.networks.task_encoder import TaskEncoderConfig
from t2tl_jax.training.optimizer import AdamLearnerConfig


@dataclass(frozen=True)
class PPOConfig(AdamLearnerConfig):
    """PPO's networks and constants. The defaults were tuned on `phi_zone`; `zone_ppo_published` has the paper's."""

    network: NetworkConfig = field(default_factory=NetworkConfig)
    """Actor and critic."""
    num_envs: int = 2048
    """Parallel environments."""
    unroll_length: int = 64
    """Steps of every environment in one iteration."""
    epochs: int = 4
    """Passes over the rollout in one iteration."""
    minibatch_size: int = 8192
    """Samples of one gradient step; must divide num_envs x unroll_length."""
    minibatches_of: Literal["steps", "environments"] = "steps"
    """A minibatch is of steps drawn from the whole rollout, or of all steps of some environments. The second holds few
    rows of a large table, which then is encoded at the speed of a small one."""
    discount: float = 0.998
    """Discount factor gamma."""
    gae_lambda: float = 0.97
    """Lambda of generalised advantage estimation."""
    learning_rate: float = 3e-4
    """Step size of Adam."""
    anneal_learning_rate: bool = False
    """Decay the learning rate linearly to zero over the run."""
    adam_epsilon: float = 1e-8
    """Epsilon of Adam."""
    clip_eps: float = 0.2
    """Clipping range of the probability ratio and of the value."""
    clip_value: bool = True
    """Clip the value loss around the old value (the larger of the two squared errors counts)."""
    value_coefficient: float = 0.5
    """Weight of the value loss."""
    entropy_coefficient: float = 0.0
    """Weight of the entropy, which is averaged over action dimensions as published."""
    noise_time: float = 33.0
    """Correlation time of the exploration noise at the start of the run, in steps; 0 is white noise as published.
    Continuous actions only: discrete ones are drawn independently."""
    noise_decay: float = 0.5
    """Share of the run over which the correlation time falls linearly to 0."""
    max_gradient_norm: float = 0.5
    """Norm at which gradients are clipped, by default the global one."""
    normalise_advantage: bool = False
    """Standardise advantages within a minibatch."""
    timeout_is_terminal: bool = False
    """Treat the time limit as an end of the task (published code) instead of bootstrapping from the last state."""
    staggered_start: bool = True
    """Cut the very first episode of each environment at a random length, so that resets do not come in step."""

    traced: ClassVar[tuple[str, ...]] = (
        *AdamLearnerConfig.traced,
        *("discount", "gae_lambda", "learning_rate", "adam_epsilon", "max_gradient_norm"),
        *("clip_eps", "value_coefficient", "entropy_coefficient", "noise_time", "noise_decay"),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.counts(self, "num_envs", "unroll_length", "epochs", "minibatch_size", "batch_size")
        checks.shares(self, "discount", "gae_lambda")
        checks.positive(self, "adam_epsilon", "clip_eps", "noise_decay", "max_gradient_norm")
        checks.not_negative(self, "learning_rate", "value_coefficient", "entropy_coefficient", "noise_time")
        if self.batch_size % self.minibatch_size:
            raise ValueError(
                f"minibatch_size must divide num_envs x unroll_length = {self.num_envs} x {self.unroll_length} = "
                f"{self.batch_size}, got minibatch_size={self.minibatch_size}"
            )
        if self.minibatches_of == "environments" and self.num_envs % self.num_minibatches:
            raise ValueError(
                f"minibatches of whole environments must be of equally many, got num_envs={self.num_envs} for "
                f"{self.num_minibatches} minibatches; set minibatch_size to a multiple of unroll_length = "
                f"{self.unroll_length} that divides num_envs x unroll_length"
            )
        for name, size in (("unroll_length", self.unroll_length), ("minibatch_size", self.minibatch_size)):
            if size % self.segment_length:
                raise ValueError(
                    f"network.context.segment_length must divide {name}, got segment_length={self.segment_length} and "
                    f"{name}={size}; 1 fits always"
                )

    @property
    def task_encoder(self) -> TaskEncoderConfig:
        """What reads the task."""
        return self.network.task_encoder

    @property
    def freezes_task_encoder(self) -> bool:
        """Whether it is kept as it is."""
        return self.network.freeze_task_encoder

    @property
    def frames_per_iteration(self) -> int:
        """Environment steps in one iteration."""
        return self.num_envs * self.unroll_length

    @property
    def max_frames(self) -> int:
        """Iterations are counted, and gradient steps where their size is annealed."""
        counted = self.epochs * self.num_minibatches if self.anneal_learning_rate else 1
        return checks.COUNTER_LIMIT // counted * self.frames_per_iteration

    @property
    def batch_size(self) -> int:
        """Samples of one epoch, which are all steps of the iteration."""
        return self.frames_per_iteration

    @property
    def segment_length(self) -> int:
        """Successive steps that stay together in the minibatches; 1 without context."""
        return 1 if self.network.context is None else self.network.context.segment_length

    @property
    def num_minibatches(self) -> int:
        """Gradient steps in one epoch."""
        return self.batch_size // self.minibatch_size
