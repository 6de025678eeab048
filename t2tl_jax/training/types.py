"""What a learner offers to the runner, to evaluation and to the plots: a few pure functions.

Every function works on one seed and holds no state, so the runner vmaps it over seeds (and jits it once). What varies
between seeds and tasks comes in as an argument, `env_params`.
"""

import abc
import copy
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, NamedTuple, Protocol, Self

import jax
import jax.numpy as jnp
from flax import struct

from t2tl_jax import checks
from t2tl_jax.ltl import TaskTable
from t2tl_jax.networks.task_encoder import TaskEncoderConfig
from t2tl_jax.task_env import TaskParams

Params = Any  # the variables of a Flax module
AgentCarry = Any  # a pytree: what a policy takes from step to step of an episode


@struct.dataclass
class EpisodeTotals:
    """Sums over the episodes that finished during one iteration; all scalars, so that they add up over iterations.

    Every episode counts as exactly one of success, violation, timeout and env_termination. `discounted_return` is
    the sum of discount^t r_t from t = 0, whatever the rewards, and `total_reward` the sum of r_t; the paper's measure,
    the total reward times discount^(length - 1), equals the former where only the last step pays. Lengths count steps.
    """

    episodes: jax.Array  # int32
    successes: jax.Array  # int32, formula became true
    violations: jax.Array  # int32, formula became false
    timeouts: jax.Array  # int32, cut by the time limit
    env_terminations: jax.Array  # int32, ended by the environment itself while the task was open
    discounted_return: jax.Array  # float32
    total_reward: jax.Array  # float32
    length: jax.Array  # float32
    success_length: jax.Array  # float32, over successes only


@struct.dataclass
class TaskTotals:
    """Episodes that finished during one iteration by task, where pools take turns; K tasks a pool.

    First those of the present pool, then those of the one before. Starts in other rows are of no task.
    """

    episodes: jax.Array  # int32[2, K]
    successes: jax.Array  # int32[2, K]


@struct.dataclass
class Metrics:
    """What one iteration reports: finished episodes and named scalars (losses, entropy, gradient norm, ...)."""

    episodes: EpisodeTotals
    scalars: dict[str, jax.Array]
    tasks: TaskTotals | None = None  # where the table holds two pools, see `ltl/turns.py`
    fault: jax.Array | int = 0  # int32, for `training/guard.py` to fill in


class TrainState(Protocol):
    """The part of a learner's state that the runner reads; the rest is the learner's own."""

    params: Params  # current parameters of the network


@dataclass(frozen=True)
class LearnerConfig(abc.ABC):
    """What every learner's configuration has; the base class of PPO's, DQN's, and a user's own."""

    network: Any
    """The networks of the learner."""
    discount: float
    """Discount factor gamma."""

    traced: ClassVar[tuple[str, ...]] = ()
    """Fields with numbers that only enter arithmetic: no branch of Python and no shape depends on them. Where they are
    named, configurations that differ in nothing else share one compiled program. A field that holds None does not
    count."""

    @property
    def numbers(self) -> dict[str, float]:
        """The numbers that only enter arithmetic, by the names of their fields."""
        return {name: value for name in self.traced if (value := getattr(self, name)) is not None}

    def with_numbers(self, numbers: Mapping[str, Any]) -> Self:
        """The same with other values of some fields, which are not checked: those that a program is given later."""
        same = copy.copy(self)
        for name, value in numbers.items():
            object.__setattr__(same, name, value)
        return same

    @property
    def task_encoder(self) -> TaskEncoderConfig | None:
        """What reads the task; None for a learner that has nothing of the kind."""
        return None

    @property
    def freezes_task_encoder(self) -> bool:
        """Whether the task encoder is kept as it is, for one that was pre-trained."""
        return False

    @property
    @abc.abstractmethod
    def frames_per_iteration(self) -> int:
        """Environment steps in one iteration, of all environments together."""

    @property
    def unroll_length(self) -> int:
        """Steps of every environment in one iteration; by default there is one environment."""
        return self.frames_per_iteration

    def refuses_family(self, rows: int) -> str:
        """Why a family of tasks whose tables have so many rows cannot be learned; '' if it can, as by default."""
        return ""

    @property
    def max_frames(self) -> int:
        """The most frames for which no 32-bit counter overflows; by default iterations are all that is counted."""
        return checks.COUNTER_LIMIT * self.frames_per_iteration


def map_params(train_state: Any, function: Callable[[Params], Params]) -> Any:
    """The state with `function` applied to the parameters that every `TrainState` has."""
    return replace(train_state, params=function(train_state.params))


class Agent(NamedTuple):
    """A learner as pure functions of one seed.

    init(key, env_params) -> train_state
    iterate(train_state, env_params) -> (train_state, Metrics); advances training by `frames_per_iteration` environment
        steps
    embed(params, table) -> float32[rows, dim]: the task encoder's output for every row of the task table; or whatever
        else `act` reads of it
    begin() -> carry of one environment: what the policy takes from step to step, at the start of an episode; () for
        nothing
    act(params, embedding, carry, obs, row, key, deterministic) -> action; obs [..., O], row int32[...]
    decide(params, embedding, carry, obs, row) -> carry: what the policy makes up its mind about before it acts, and
        keeps in mind; arguments as for `act`, which then is given this carry. By default nothing.
    remember(params, carry, obs, action, reward) -> carry after a step: `action` was taken on `obs`, `reward` [...]
        followed. When the episode ends, go on with `begin()`.
    restart(train_state, env_params) -> train_state that goes on with other tasks, in a table of the same shapes:
        episodes under way are dropped. None for learners whose tasks are fixed.
    compare(params, carry, obs, task, other) -> (policy float32[B], value float32[B]): how much the policy changes and
        by how much the value rises at obs [B, O] when the code of the task is `other` instead of `task`, both [dim]. Of
        the policy, the KL divergence KL(task || other) in nats, or for action values 1 where the greedy action is
        another one, else 0. None for learners that do not offer it.
    value(params, embedding, carry, obs, row) -> float32[...]: what the critic expects of the policy in states of rows,
        arguments as for `act`; of action values the greatest. None for learners without a critic.
    map_params(train_state, function) -> train_state with `function` applied to every set of the network's parameters
        that it holds.
    num_envs: environments that `iterate` may spread over devices, where it marks its arrays by `devices.over_envs`; 1
        for learners that do not.
    devices_per_seed: devices that a seed has at most where the run does not say so; 0 as `devices.seed_sharding` has it
    replay: name of the field of the train state that holds what was experienced and only a training that goes on needs;
        '' for learners without one.
    given(env_params) -> the same learner with the numbers in `env_params`, if there are any, instead of those of its
        configuration. Not for a learner to define: see `training/numbers.py`.

    `env_params` are those of the `TaskEnv`; params are the network's. The arrays of a carry have the leading axes of
    `obs`.
    """

    init: Callable[[jax.Array, TaskParams], Any]
    iterate: Callable[[Any, TaskParams], tuple[Any, Metrics]]
    embed: Callable[[Params, TaskTable], Any]
    act: Callable[[Params, Any, AgentCarry, jax.Array, jax.Array, jax.Array, bool], jax.Array]
    frames_per_iteration: int
    begin: Callable[[], AgentCarry] = lambda: ()
    decide: Callable[[Params, Any, AgentCarry, jax.Array, jax.Array], AgentCarry] = (
        lambda params, embedding, carry, obs, row: carry
    )
    remember: Callable[[Params, AgentCarry, jax.Array, jax.Array, jax.Array], AgentCarry] = (
        lambda params, carry, obs, action, reward: carry
    )
    restart: Callable[[Any, TaskParams], Any] | None = None
    compare: Callable[[Params, AgentCarry, jax.Array, jax.Array, jax.Array], tuple[jax.Array, jax.Array]] | None = None
    value: Callable[[Params, Any, AgentCarry, jax.Array, jax.Array], jax.Array] | None = None
    map_params: Callable[[Any, Callable[[Params], Params]], Any] = map_params
    num_envs: int = 1
    devices_per_seed: int = 0
    replay: str = ""
    given: Callable[[TaskParams], "Agent"] | None = None


def repeated(carry: AgentCarry, size: int) -> AgentCarry:
    """The same carry for each of `size` environments, leading axis [size]."""
    return jax.tree.map(lambda x: jnp.broadcast_to(x, (size, *x.shape)), carry)
