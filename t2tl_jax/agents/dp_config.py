"""The constants of learning by dynamic programming, checked, and the sizes that follow from them."""

from dataclasses import dataclass, field
from typing import ClassVar

from t2tl_jax import checks
from t2tl_jax.networks.actor_critic import NetworkConfig
from t2tl_jax.networks.task_encoder import TaskEncoderConfig
from t2tl_jax.training.optimizer import AdamLearnerConfig


@dataclass(frozen=True)
class DPConfig(AdamLearnerConfig):
    """Dynamic programming's network and constants. Nothing is played: a frame is a row that a gradient step reads."""

    network: NetworkConfig = field(
        default_factory=lambda: NetworkConfig(env_layers=(), actor_layers=(), critic_layers=())
    )
    """Actor and critic. They see nothing but the encoded task, through one linear layer, so that the encoder does the
    work."""
    minibatch_size: int = 512
    """Rows of one gradient step, each once: of a smaller table all of them."""
    updates_per_iteration: int = 2
    """Gradient steps in one iteration."""
    discount: float = 0.9
    """Discount factor gamma of the values that are computed. The lower it is, the worse is a detour."""
    temperature: float = 0.05
    """Of the policy that is learned, which prefers actions by exp(value / temperature): the best one, and how much the
    others lose by it."""
    learning_rate: float = 1e-3
    """Step size of Adam."""
    anneal_learning_rate: bool = True
    """Decay the learning rate linearly to zero over the run."""
    adam_epsilon: float = 1e-8
    """Epsilon of Adam."""
    value_coefficient: float = 1.0
    """Weight of the value loss."""
    max_gradient_norm: float = 1.0
    """Norm at which gradients are clipped, by default the global one."""

    traced: ClassVar[tuple[str, ...]] = (
        *AdamLearnerConfig.traced,
        *("discount", "temperature", "learning_rate", "adam_epsilon", "value_coefficient", "max_gradient_norm"),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.counts(self, "minibatch_size", "updates_per_iteration", "frames_per_iteration")
        checks.shares(self, "discount")
        checks.positive(self, "temperature", "adam_epsilon", "max_gradient_norm")
        checks.not_negative(self, "learning_rate", "value_coefficient")
        if self.discount >= 1.0:
            raise ValueError(f"discount must be less than 1, so that a detour costs something, got {self.discount}")
        if self.network.context is not None:
            raise ValueError("nothing is played here, so there is no context to read; set network.context to None")

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
        """Rows that the gradient steps of one iteration read."""
        return self.minibatch_size * self.updates_per_iteration

    @property
    def unroll_length(self) -> int:
        """One, since no episode is cut."""
        return 1

    @property
    def max_frames(self) -> int:
        """Iterations are counted, and gradient steps where their size is annealed."""
        counted = self.updates_per_iteration if self.anneal_learning_rate else 1
        return checks.COUNTER_LIMIT // counted * self.frames_per_iteration
