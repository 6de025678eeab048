"""The constants of double DQN, checked, and the sizes that follow from them."""

from dataclasses import dataclass, field
from typing import ClassVar

from t2tl_jax import checks
from t2tl_jax.agents.row_codes import LARGE
from t2tl_jax.networks.q_network import QNetworkConfig
from t2tl_jax.networks.task_encoder import TaskEncoderConfig
from t2tl_jax.training.optimizer import AdamLearnerConfig


@dataclass(frozen=True)
class DQNConfig(AdamLearnerConfig):
    """Double DQN's network and constants."""

    network: QNetworkConfig = field(default_factory=QNetworkConfig)
    """The network of action values."""
    num_envs: int = 16
    """Parallel environments."""
    unroll_length: int = 500
    """Steps of every environment in one iteration."""
    updates_per_step: int = 1
    """Gradient steps after every step of all environments."""
    batch_size: int = 512
    """Transitions of one gradient step; with counterfactual learning each counts for every open row."""
    buffer_size: int = 200_000
    """Transitions that are kept."""
    learning_starts: int = 5_000
    """Environment steps before the first gradient step."""
    target_period: int = 100
    """Gradient steps between copies to the target network."""
    discount: float = 0.98
    """Discount factor gamma."""
    learning_rate: float = 1e-4
    """Step size of Adam."""
    anneal_learning_rate: bool = True
    """Decay the learning rate linearly to zero over the run."""
    max_gradient_norm: float = 10.0
    """Norm at which gradients are clipped, by default the global one."""
    epsilon_start: float = 1.0
    """Share of random actions at the start."""
    epsilon_end: float = 0.02
    """Share of random actions at the end."""
    epsilon_fraction: float = 0.1
    """Share of the run over which it falls linearly."""
    counterfactual: bool = True
    """Learn every open row from every transition: the paper's simultaneous learning, CRM of the reward-machine paper.
    False is plain DQN on the row that the agent was in."""
    rows_per_transition: int = 0
    """Counterfactual learning of so many open rows at each use of a transition: the row that the agent was in, and
    others that are drawn. 0 is all of them, which is out of reach for tables of thousands of rows."""
    double: bool = True
    """Choose the next action by the online network and value it by the target network (van Hasselt et al., 2016)."""
    printed_argmax: bool = False
    """Choose the next action for the old formula, as the paper prints, instead of for the progressed one."""
    timeout_is_terminal: bool = False
    """Treat the time limit as an end of the task instead of bootstrapping."""
    shaping: bool = False
    """Learn from rewards shaped by a potential of the table's rows (Toro Icarte et al., 2022), which changes no best
    policy; see `agents/shaping.py`. What is reported stays unshaped."""

    traced: ClassVar[tuple[str, ...]] = (
        *AdamLearnerConfig.traced,
        *("discount", "learning_rate", "max_gradient_norm", "epsilon_start", "epsilon_end", "epsilon_fraction"),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.counts(self, "num_envs", "unroll_length", "updates_per_step", "batch_size", "buffer_size")
        checks.counts(self, "target_period", "updates_per_iteration")
        checks.counts(self, "learning_starts", "rows_per_transition", least=0)
        checks.shares(self, "discount", "epsilon_start", "epsilon_end")
        checks.positive(self, "max_gradient_norm")
        checks.not_negative(self, "learning_rate")
        if max(self.batch_size, self.num_envs) > self.buffer_size:
            raise ValueError(
                f"buffer_size must hold at least one batch and one step of all environments, got "
                f"buffer_size={self.buffer_size}, batch_size={self.batch_size}, num_envs={self.num_envs}"
            )
        if self.rows_per_transition and not self.counterfactual:
            raise ValueError(
                "plain DQN learns the row that the agent was in, and no others, got counterfactual=False with "
                f"rows_per_transition={self.rows_per_transition}; leave that at 0"
            )
        if self.shaping and self.discount >= 1.0:
            raise ValueError(f"shaping needs discount below 1, or values may have no bound, got {self.discount}")
        if not 0.0 < self.epsilon_fraction <= 1.0:
            raise ValueError(f"epsilon_fraction is a share of the run above 0, got {self.epsilon_fraction}")

    @property
    def task_encoder(self) -> TaskEncoderConfig:
        """What reads the task."""
        return self.network.task_encoder

    @property
    def freezes_task_encoder(self) -> bool:
        """Whether it is kept as it is."""
        return self.network.freeze_task_encoder

    @property
    def rows_drawn(self) -> int:
        """Rows that are drawn at each use of a transition; 0 where none are: every open one learns, or the own one."""
        return self.rows_per_transition if self.counterfactual else 0

    def refuses_family(self, rows: int) -> str:
        """Plain DQN does, whose replay would hold rows of tables that are gone; and tables too large for all rows."""
        if not self.counterfactual:
            return (
                "plain DQN learns the row that the agent was in, and of a family, whose tasks change, replay holds "
                "rows that are gone, got counterfactual=False; train families with learner.counterfactual=True, or "
                "give a single task"
            )
        if not self.rows_per_transition and rows > LARGE:
            return (
                f"the tables of this family have {rows:,} rows, and every transition is to be learned for all of "
                f"them, which is out of reach above {LARGE:,}; learn some of them: learner.rows_per_transition=8"
            )
        return ""

    @property
    def frames_per_iteration(self) -> int:
        """Environment steps in one iteration."""
        return self.num_envs * self.unroll_length

    @property
    def updates_per_iteration(self) -> int:
        """Gradient steps in one iteration."""
        return self.unroll_length * self.updates_per_step
