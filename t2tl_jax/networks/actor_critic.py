"""The actor-critic of the published code: environment encoder, task embedding, context, actor, critic."""

from dataclasses import dataclass, field
from typing import Any, Literal

import jax
import jax.numpy as jnp
from flax import linen as nn

from t2tl_jax import checks
from t2tl_jax.ltl import TaskTable
from t2tl_jax.networks.carried import CarriedEncoder
from t2tl_jax.networks.context import ContextEncoder, RecurrentNetwork
from t2tl_jax.networks.context_config import ContextConfig
from t2tl_jax.networks.distributions import Categorical, Distribution, Gaussian
from t2tl_jax.networks.initializers import unit_norm
from t2tl_jax.networks.state_encoder import StateEncoderConfig
from t2tl_jax.networks.state_encoders import FlatConfig, check_context, make_state_encoder
from t2tl_jax.networks.task_encoder import RowEncoder, TaskEncoder, TaskEncoderConfig
from t2tl_jax.networks.task_encoders import make_task_encoder
from t2tl_jax.networks.transformer import TransformerConfig
from t2tl_jax.networks.windows import Carried, Carry, Segment
from t2tl_jax.objects import Objects

MINIMUM_STD = 1e-3
MEAN_RANGE = 2.0


@dataclass(frozen=True)
class NetworkConfig:
    """Everything between an observation with a task row and an action with a value."""

    task_encoder: TaskEncoderConfig = field(default_factory=TransformerConfig)
    """How a task becomes numbers: its formula read by a Transformer (T1TL), a graph network or a recurrent one, the
    state of its automaton or reward machine as a unit vector (DFA, RM), or any other that is registered."""
    freeze_task_encoder: bool = False
    """Keep the task encoder as it is, for one that was pre-trained."""
    state: StateEncoderConfig = field(default_factory=FlatConfig)
    """What reads the observation first: nothing does (flat), or one small network reads every object in it, and the
    task's code beside it (objects), or any other that is registered."""
    env_layers: tuple[int, ...] = (128, 64)
    """Hidden sizes of the environment encoder, behind that; empty for none: the observation itself, which may be empty
    too, or the features of the objects."""
    actor_layers: tuple[int, ...] = (64, 64, 64)
    """Hidden sizes of the actor; empty for a single linear layer."""
    critic_layers: tuple[int, ...] = (64, 64)
    """Hidden sizes of the critic; empty for a single linear layer."""
    mean_scale: float = 1.0
    """Length of the initial weights of the head of means (or of logits): 1 as published, 0 for a robot that at first
    only explores."""
    value_scale: float = 0.0
    """Length of the value head's initial weights: 1 as published, 0 for a critic that starts without an opinion."""
    value_bias: float = 0.0
    """The value head's initial bias, by which all values are higher at first."""
    observation: Literal["symlog", "raw"] = "symlog"
    """Squash the numbers of observations by sign(x) log(1 + |x|) (the accelerometer reaches 18), or feed them raw as
    published."""
    context: ContextConfig | None = None
    """The window of the last steps and who reads it (T2TL), or a state that is carried; None for a policy without
    memory (T1TL). The state may be flat, or merged: what is remembered is then merged by the task of the step that
    reads it."""

    def __post_init__(self) -> None:
        checks.sizes(self, "env_layers", "actor_layers", "critic_layers")
        checks.not_negative(self, "mean_scale", "value_scale")
        checks.finite(self, "value_bias")
        check_context(self.context, self.state, by_task=True)

    @property
    def windows_by_task(self) -> bool:
        """Whether there are windows, and what they hold is read for the task of the step that reads them."""
        return self.context is not None and not self.context.carried and self.state.reads_task


def _mlp(x: jax.Array, sizes: tuple[int, ...], activation, name: str) -> jax.Array:
    for i, size in enumerate(sizes):
        x = activation(nn.Dense(size, kernel_init=unit_norm(), name=f"{name}_{i}")(x))
    return x


def symlog(x: jax.Array) -> jax.Array:
    """Large numbers made small, small ones hardly changed; any shape."""
    return jnp.sign(x) * jnp.log1p(jnp.abs(x))


class EnvironmentEncoder(nn.Module):
    """Observation -> features, ReLU after every layer."""

    config: NetworkConfig
    objects: Objects | None = None

    def setup(self) -> None:
        """Name the part; its parameters live under this name in checkpoints."""
        squash = symlog if self.config.observation == "symlog" else (lambda x: x)
        self.state = make_state_encoder(self.config.state, self.objects, self.config.task_encoder, squash)

    @nn.compact
    def __call__(self, obs: jax.Array, task: jax.Array | None = None) -> jax.Array:
        """obs [..., O], and task [..., dim] if the state encoder reads it -> [..., env_layers[-1]]."""
        return _mlp(self.state(obs, task), self.config.env_layers, nn.relu, "dense")

    def before_layers(self, obs: jax.Array, task: jax.Array) -> jax.Array:
        """What the state encoder makes of obs [..., O] and task [..., dim], which the layers read: [..., D]."""
        return self.state(obs, task)

    def of_objects(self, obs: jax.Array) -> jax.Array:
        """Of states that read the task, each object for no task: obs [..., O] -> [..., n, E]."""
        return self.state.of_objects(obs)

    def of_remembered(self, remembered: jax.Array, task: jax.Array) -> jax.Array:
        """What was remembered of each object [..., n, H], merged by the task [..., dim] -> [..., D]."""
        return self.state.of_remembered(remembered, task)


class Actor(nn.Module):
    """Features -> distribution of the action: a choice of actions by logits, or a diagonal Gaussian.

    As published: mean = 2 tanh(.), std = softplus(tanh(.)) + 0.001, so std lies in [0.314, 1.314].
    """

    layers: tuple[int, ...]
    action_size: int
    output_scale: float
    discrete: bool = False

    @nn.compact
    def __call__(self, features: jax.Array) -> Distribution:
        """features [..., D] -> distribution of float32[..., action_size], or of one of action_size actions."""
        x = _mlp(features, self.layers, nn.relu, "dense")
        if self.discrete:
            return Categorical(nn.Dense(self.action_size, kernel_init=unit_norm(self.output_scale), name="logits")(x))
        mean = MEAN_RANGE * jnp.tanh(
            nn.Dense(self.action_size, kernel_init=unit_norm(self.output_scale), name="mean")(x)
        )
        std = nn.softplus(jnp.tanh(nn.Dense(self.action_size, kernel_init=unit_norm(), name="std")(x))) + MINIMUM_STD
        return Gaussian(mean, std)


class Critic(nn.Module):
    """Features -> value."""

    layers: tuple[int, ...]
    output_scale: float
    output_bias: float

    @nn.compact
    def __call__(self, features: jax.Array) -> jax.Array:
        """features [..., D] -> [...]."""
        x = _mlp(features, self.layers, nn.tanh, "dense")
        weights, bias = unit_norm(self.output_scale), nn.initializers.constant(self.output_bias)
        return nn.Dense(1, kernel_init=weights, bias_init=bias, name="value")(x)[..., 0]


class ActorCritic(RecurrentNetwork):
    """Policy and value of (observation, task embedding, carry); the task encoder is one of its parts.

    Call `embed` once per gradient step (or per rollout), then index the embedding by row. Without context the carry is
    `()`, and may be left out.
    """

    config: NetworkConfig
    action_size: int  # dimensions of a continuous action, or number of discrete actions
    discrete: bool = False
    objects: Objects | None = None  # what the environment says about its observation

    def setup(self) -> None:
        """Name the parts; parameters live under these names in checkpoints."""
        self.task_encoder: TaskEncoder = make_task_encoder(self.config.task_encoder)
        self.environment_encoder = EnvironmentEncoder(self.config, self.objects)
        self.actor = Actor(self.config.actor_layers, self.action_size, self.config.mean_scale, self.discrete)
        self.critic = Critic(self.config.critic_layers, self.config.value_scale, self.config.value_bias)
        if self.config.context is not None:
            encoder: Any = CarriedEncoder if self.config.context.carried else ContextEncoder
            self.context_encoder = encoder(self.config.context, self.action_size if self.discrete else None)

    def embed(self, table: TaskTable) -> jax.Array:
        """float32[rows, dim], one vector for every row of the table."""
        embedding = self.task_encoder(table)
        return jax.lax.stop_gradient(embedding) if self.config.freeze_task_encoder else embedding

    def embed_rows(self, table: TaskTable, rows: jax.Array, known: jax.Array | None = None) -> jax.Array:
        """float32[k, dim], those of some rows alone; only where the encoder's configuration says `rows_apart`."""
        reader: RowEncoder = self.task_encoder  # type: ignore[assignment]
        return reader.of_rows(table, rows, known)

    def see(self, obs: jax.Array, task: jax.Array | None = None) -> jax.Array:
        """The environment encoder: obs [..., O], and task [..., dim] if it reads it -> [..., env_layers[-1]]."""
        return self.environment_encoder(obs, task)

    def see_for(self, obs: jax.Array, task: jax.Array) -> jax.Array:
        """Of remembered observations, the state encoder alone: `env_layers` on every slot would cost K times more."""
        return self.environment_encoder.before_layers(obs, task)

    def see_apart(self, obs: jax.Array) -> jax.Array:
        """What a carried state learns of obs [..., O]: its embedding [..., E], or of states that read the task each
        object [..., n, E]."""
        return self.environment_encoder.of_objects(obs) if self.config.state.reads_task else self.see(obs)

    def of_task(self, task: jax.Array) -> jax.Array:
        """What actor and critic read of codes [..., dim]."""
        return self.config.state.left_of(task, self.config.task_encoder)

    @nn.nowrap
    def blank(self, observation_size: int) -> tuple[jax.Array, int]:
        """An action, and the size of an embedded observation."""
        action = jnp.int32(0) if self.discrete else jnp.zeros(self.action_size)
        return action, (observation_size, *self.config.env_layers)[-1]

    @property
    @nn.nowrap
    def apart(self) -> tuple[int, ...]:
        """The number of objects, of states that read the task."""
        return (len(self.objects.numbers),) if self.objects is not None and self.config.state.reads_task else ()

    def features(self, obs: jax.Array, task: jax.Array, carry: Carry | Segment = ()) -> jax.Array:
        """obs [..., O], task [..., dim], carry of [...] environments -> [..., D], shared by actor and critic.

        The carry may also be segments of [...] without the last axis, which then is that of their steps.
        """
        embedding = self.see(obs, task)
        return jnp.concatenate([embedding, self.of_task(task), *self.recalled(carry, obs, task, embedding)], axis=-1)

    def policy(self, obs: jax.Array, task: jax.Array, carry: Carry = ()) -> Distribution:
        """Distribution of the action, leading axes [...]."""
        return self.actor(self.features(obs, task, carry))

    def value(self, obs: jax.Array, task: jax.Array, carry: Carry | Segment = ()) -> jax.Array:
        """Value [...]."""
        return self.critic(self.features(obs, task, carry))

    def value_after(self, obs: jax.Array, next_obs: jax.Array, next_task: jax.Array, carry: Segment | tuple[()]):
        """Value [..., S] of the states that the steps of segments led to, before any new episode."""
        seen = None if self.config.context is None or self.config.state.reads_task else self.see(obs)
        recalled = self.recalled(carry, obs, next_task, seen, after=True)
        return self.critic(
            jnp.concatenate([self.see(next_obs, next_task), self.of_task(next_task), *recalled], axis=-1)
        )

    def recalled(
        self, carry: Carry | Segment, obs: jax.Array, task: jax.Array, embedding: jax.Array | None, after: bool = False
    ) -> list[jax.Array]:
        """The context variable [..., output] for the `task` [..., dim], which not all memories need; none without
        context. `embedding` [..., E] is that of obs [..., O], which states that read the task do not need."""
        if self.config.context is None:
            return []
        if self.config.context.carried:
            return [self.context_carried(carry, obs, task, embedding, after)]
        if self.config.windows_by_task:
            return [self.context_for(carry, obs, task, after)]
        return [self.context(carry, embedding, after)]

    def context_carried(
        self, carry: Carry | Segment, obs: jax.Array, task: jax.Array, embedding: jax.Array | None, after: bool
    ) -> jax.Array:
        """`recalled` of a state that was carried, or of segments that begin with one."""
        if not isinstance(carry, Carried | Segment):
            raise ValueError(f"a network with carried=True needs the state that it carries, got {type(carry).__name__}")
        by_task = self.config.state.reads_task
        if isinstance(carry, Carried):
            state = carry.state
        else:
            seen = self.see_apart(obs) if by_task or embedding is None else embedding
            state = self.context_encoder.states(carry, seen, after)
        return self.context_encoder(self.environment_encoder.of_remembered(state, task) if by_task else state)

    def __call__(self, obs: jax.Array, task: jax.Array, carry: Carry | Segment = ()) -> tuple[Distribution, jax.Array]:
        """Distribution of the action and value from one pass through the shared features."""
        features = self.features(obs, task, carry)
        return self.actor(features), self.critic(features)

    def initialise(
        self, table: TaskTable, obs: jax.Array, row: jax.Array, carry: Carry = ()
    ) -> tuple[Distribution, jax.Array]:
        """Touch every part once: `init(key, table, obs, row, carry, method="initialise")` makes all parameters."""
        if isinstance(carry, Carried):  # reading a state does not touch what makes it
            action, _ = self.blank(obs.shape[-1])
            none = jnp.zeros((*obs.shape[:-1], *action.shape), action.dtype)
            self.remember(carry, obs, none, jnp.zeros(obs.shape[:-1]))
        return self(obs, self.embed(table)[row], carry)
