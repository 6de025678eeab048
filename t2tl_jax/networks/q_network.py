"""Action values of every sub-task at once: the state is read once, and each row of the table only weighs the result.

Simultaneous learning updates all rows of the table on every transition. With the task at the input, as published, that
multiplies the whole network by the number of rows. Here the state passes a trunk that all rows share; then a row either
modulates the last two layers ("film"), or the state becomes a matrix that maps codes of tasks to values ("bilinear",
a universal value function of two streams, Schaul et al., 2015), which costs hardly more for 77 rows than for one. The
published form is there to compare with ("concat").
"""

from dataclasses import dataclass, field
from typing import Literal

import jax
import jax.numpy as jnp
from flax import linen as nn

from t2tl_jax import checks
from t2tl_jax.ltl import TaskTable
from t2tl_jax.networks.context import ContextEncoder, RecurrentNetwork
from t2tl_jax.networks.context_config import ContextConfig
from t2tl_jax.networks.state_encoder import StateEncoderConfig
from t2tl_jax.networks.state_encoders import FlatConfig, check_context, make_state_encoder
from t2tl_jax.networks.task_encoder import RowEncoder, TaskEncoder, TaskEncoderConfig
from t2tl_jax.networks.task_encoders import make_task_encoder
from t2tl_jax.networks.transformer import TransformerConfig
from t2tl_jax.networks.windows import Carry, Tokens
from t2tl_jax.objects import Objects

HE = nn.initializers.orthogonal(2**0.5)
XAVIER = nn.initializers.xavier_uniform()


@dataclass(frozen=True)
class QNetworkConfig:
    """Everything between an observation with a task row and the values of the actions."""

    task_encoder: TaskEncoderConfig = field(default_factory=lambda: TransformerConfig(output=32))
    """How a task becomes numbers, as in `NetworkConfig`; 32 of them as published for WaterWorld."""
    freeze_task_encoder: bool = False
    """Keep the task encoder as it is, for one that was pre-trained."""
    state: StateEncoderConfig = field(default_factory=FlatConfig)
    """What reads the observation first, as in `NetworkConfig`. One that reads the task as well makes all layers behind
    it layers of every task, as the head "concat" does."""
    state_layers: tuple[int, ...] = (512, 512)
    """Hidden sizes of the part that reads the state, shared by all tasks; behind the features of objects if it reads
    objects."""
    task_layer: int = 256
    """Size of the layer in which state and task meet; of the last hidden layer if they are concatenated."""
    head: Literal["film", "bilinear", "concat"] = "film"
    """How they meet: the task scales and shifts the state's features before one more layer; or the state's features are
    made into a matrix, and the values are its product with the task; or, as in the paper, state and task stand side by
    side before the first layer, so that every layer is computed for every task anew."""
    head_layers: tuple[int, ...] = ()
    """Hidden sizes of each of two heads, that of the advantages and that of the state's value, behind `task_layer`; the
    reward-machine experiments had (256,). With such layers the heads begin as published, those layers and the outputs
    Xavier-uniform; without them the outputs begin as Flax has it. The head "bilinear" takes none: it is a product."""
    dueling: bool = True
    """Value and advantage apart (Wang et al., 2016), as in the reward-machine experiments."""
    context: ContextConfig | None = None
    """The window of the last steps and who reads it (T2TL); its output joins the state's trunk behind the first layer,
    which also embeds the observations of the window. None for a policy without memory."""

    def __post_init__(self) -> None:
        checks.sizes(self, "state_layers", "head_layers")
        checks.counts(self, "task_layer")
        if self.context is not None and self.context.carried:
            raise ValueError(
                "DQN's replay holds windows of steps, and no states that were carried: network.context.carried=True is "
                "PPO's; use carried=False"
            )
        check_context(self.context, self.state, by_task=False)
        if self.state.reads_task and self.head == "bilinear":
            raise ValueError(
                f"the head 'bilinear' reads a state once for all tasks, and {type(self.state).__name__} reads it for "
                "each of them; use head=film, or network.state=flat"
            )
        if self.head_layers and self.head == "bilinear":
            raise ValueError(
                "the head 'bilinear' is a product of state and task, behind which no layers come, got head_layers="
                f"{self.head_layers}; use head=concat or head=film, or head_layers=()"
            )
        if self.context is not None and not self.context.aligned:
            raise ValueError("context.aligned=False is a mistake in PPO's order of samples; replay has no such order")
        if self.context is not None and self.context.first_token != "none":
            raise ValueError(
                f"context.first_token={self.context.first_token} is of PPO's windows when a training begins; DQN's "
                "begin empty: use first_token=none"
            )
        if self.context is not None and not self.state_layers:
            raise ValueError("a context needs a first layer of the state to embed observations, got state_layers=()")


class QNetwork(RecurrentNetwork):
    """Q(s, task, a). Call `embed` once per gradient step. Without context the carry is `()`, and may be left out."""

    config: QNetworkConfig
    num_actions: int
    objects: Objects | None = None  # what the environment says about its observation

    def setup(self) -> None:
        """Name the parts; parameters live under these names in checkpoints."""
        config = self.config
        self.task_encoder: TaskEncoder = make_task_encoder(config.task_encoder)
        self.state = make_state_encoder(config.state, self.objects, config.task_encoder)
        self.state_encoder = [nn.Dense(size, kernel_init=HE) for size in (*config.state_layers, config.task_layer)]
        if config.context is not None:
            self.context_encoder = ContextEncoder(config.context, self.num_actions)
        if config.head == "bilinear":
            # A matrix from the task's code and a constant to the actions' advantages and the state's value. Its entries
            # are one axis of the parameters: the few actions as the last axis make Adam several times slower on a CPU.
            codes, values = config.task_encoder.code_size + 1, self.num_actions + 1
            small = nn.initializers.variance_scaling(1.0 / codes, "fan_in", "truncated_normal")
            self.matrix = nn.Dense(codes * values, kernel_init=small)
        else:
            if config.head == "film":
                self.scale = nn.Dense(config.task_layer)
                self.shift = nn.Dense(config.task_layer)
                self.hidden = nn.Dense(config.task_layer, kernel_init=HE)
            else:
                # One layer on the concatenation of state and code is the sum of one on each: the state's share, which
                # is the same for all tasks, is computed once, and alone it embeds what a window has seen.
                first = (*config.state_layers, config.task_layer)[0]
                self.task_share = nn.Dense(first, use_bias=False, kernel_init=HE)
            self.advantage_layers = [nn.Dense(size, kernel_init=XAVIER) for size in config.head_layers]
            self.state_value_layers = [nn.Dense(size, kernel_init=XAVIER) for size in config.head_layers]
            begin = XAVIER if config.head_layers else nn.linear.default_kernel_init
            self.advantage = nn.Dense(self.num_actions, kernel_init=begin)
            self.state_value = nn.Dense(1, kernel_init=begin)

    def embed(self, table: TaskTable) -> jax.Array:
        """float32[rows, dim], one vector for every row of the table."""
        embedding = self.task_encoder(table)
        return jax.lax.stop_gradient(embedding) if self.config.freeze_task_encoder else embedding

    def embed_rows(self, table: TaskTable, rows: jax.Array, known: jax.Array | None = None) -> jax.Array:
        """float32[k, dim], those of some rows alone; only where the encoder's configuration says `rows_apart`."""
        reader: RowEncoder = self.task_encoder  # type: ignore[assignment]
        return reader.of_rows(table, rows, known)

    def see(self, obs: jax.Array) -> jax.Array:
        """The first layer of the state, of a network with context: obs [..., O] -> [..., state_layers[0]]."""
        return nn.relu(self.first_layer(obs))

    def first_layer(self, obs: jax.Array, task: jax.Array | None = None) -> jax.Array:
        """Before its activation: obs [..., O], and task [..., dim] if the state encoder reads it -> [..., size]."""
        return self.state_encoder[0](self.state(obs, task))

    def of_task(self, embedding: jax.Array) -> jax.Array:
        """What the head reads of codes [..., dim]."""
        return self.config.state.left_of(embedding, self.config.task_encoder)

    @nn.nowrap
    def blank(self, observation_size: int) -> tuple[jax.Array, int]:
        """An action, and the size of an embedded observation."""
        del observation_size
        return jnp.int32(0), self.config.state_layers[0]

    def features(self, obs: jax.Array, task: jax.Array, carry: Carry | Tokens = ()) -> jax.Array:
        """obs [B, O], carry of B environments -> [B, 1, task_layer], before the last activation.

        The same for all tasks, which see no window of their own but the one of the policy that acted; but of every
        task, [B, R, task_layer], if the state encoder reads it: task [R, dim] for every state or [B, R, dim], its own.
        """
        if self.config.state.reads_task:
            return self.deeper(self.first_layer(obs[:, None], task), None)
        return self.deeper(self.first_layer(obs), self.window_code(carry))[:, None]

    def window_code(self, carry: Carry | Tokens) -> jax.Array | None:
        """The context variable [..., output]; None without context."""
        return None if self.config.context is None else self.context(carry)

    def deeper(self, x: jax.Array, window: jax.Array | None) -> jax.Array:
        """What the first layer gave, before its activation, and the context variable -> [..., task_layer]."""
        for i, layer in enumerate(self.state_encoder[1:]):
            x = nn.relu(x)
            if i == 0 and window is not None:
                x = jnp.concatenate([x, window], axis=-1)
            x = layer(x)
        return x

    def concat(self, obs: jax.Array, task: jax.Array, carry: Carry | Tokens) -> tuple[jax.Array, jax.Array]:
        """obs [B, O], task [R, dim] for every state or [B, R, dim], its own -> [B, R, actions], [B, R, 1]."""
        first = self.first_layer(obs[:, None], task) if self.config.state.reads_task else self.first_layer(obs)[:, None]
        x = first + self.task_share(self.of_task(task))  # [B, R, first layer]
        window = self.window_code(carry)
        if window is not None:
            window = jnp.broadcast_to(window[:, None], (*x.shape[:-1], window.shape[-1]))
        return self.heads(nn.relu(self.deeper(x, window)))

    def film(self, features: jax.Array, task: jax.Array) -> tuple[jax.Array, jax.Array]:
        """features [..., task_layer] and task [..., dim], broadcast against each other -> [..., actions], [..., 1]."""
        x = nn.relu(features * (1.0 + self.scale(task)) + self.shift(task))
        return self.heads(nn.relu(self.hidden(x)))

    def heads(self, x: jax.Array) -> tuple[jax.Array, jax.Array]:
        """What both of them read, [..., task_layer] -> [..., actions], [..., 1]."""
        advantage = state_value = x
        for layer in self.advantage_layers:
            advantage = nn.relu(layer(advantage))
        for layer in self.state_value_layers:
            state_value = nn.relu(layer(state_value))
        return self.advantage(advantage), self.state_value(state_value)

    def matrices(self, features: jax.Array) -> jax.Array:
        """features [..., task_layer] -> [..., dim + 1, actions + 1], which maps a task's code to its values."""
        return self.matrix(nn.relu(features)).reshape(*features.shape[:-1], -1, self.num_actions + 1)

    def codes(self, embedding: jax.Array) -> jax.Array:
        """[rows, dim] -> [rows, dim + 1]: codes of about unit length, and a constant for what all tasks share.

        Learned codes are up to sqrt(dim) long, one-hot ones 1. Unscaled, a step of Adam on the matrix would move the
        values of learned codes many times as far, and no one learning rate would suit both.
        """
        if self.config.task_encoder.carries_over:
            embedding = embedding / embedding.shape[-1] ** 0.5
        return jnp.concatenate([embedding, jnp.ones_like(embedding[..., :1])], axis=-1)

    def dueling(self, advantage: jax.Array, state_value: jax.Array) -> jax.Array:
        """Q [..., actions] of the two heads, each [..., actions] or [..., 1]."""
        if not self.config.dueling:
            return advantage
        return state_value + advantage - advantage.mean(axis=-1, keepdims=True)

    def every_row(self, obs: jax.Array, embedding: jax.Array, carry: Carry | Tokens = ()) -> jax.Array:
        """Q of every row for each state: obs [B, O], embedding [rows, dim] -> [B, rows, actions].

        Of R rows of its own for each state where the embedding is [B, R, dim] -> [B, R, actions].
        """
        if self.config.head == "concat":
            return self.dueling(*self.concat(obs, embedding, carry))
        features = self.features(obs, embedding, carry)
        if self.config.head == "film":
            return self.dueling(*self.film(features, self.of_task(embedding)))
        matrices, codes = self.matrices(features[:, 0]), self.codes(embedding)
        both = jnp.einsum("bea,re->bra" if codes.ndim == 2 else "bea,bre->bra", matrices, codes)
        return self.dueling(both[..., 1:], both[..., :1])

    def __call__(self, obs: jax.Array, embedding: jax.Array, row: jax.Array, carry: Carry | Tokens = ()) -> jax.Array:
        """Q of one row for each state: obs [B, O], embedding [rows, dim], row int32[B] -> [B, actions]."""
        if self.config.head == "concat":
            return self.dueling(*self.concat(obs, embedding[row][:, None], carry))[:, 0]
        task = embedding[row][:, None]
        features = self.features(obs, task, carry)
        if self.config.head == "film":
            return self.dueling(*self.film(features, self.of_task(task)))[:, 0]
        both = jnp.einsum("bea,be->ba", self.matrices(features[:, 0]), self.codes(embedding)[row])
        return self.dueling(both[..., 1:], both[..., :1])

    def initialise(self, table: TaskTable, obs: jax.Array, carry: Carry | Tokens = ()) -> jax.Array:
        """Touch every part once: `init(key, table, obs, carry, method="initialise")` makes all parameters."""
        return self.every_row(obs, self.embed(table), carry)
