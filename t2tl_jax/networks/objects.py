"""A network over objects: one small network reads every object, and what it says is pooled.

It learns once what a ball is, and not for each of sixteen balls and for every place in the observation anew. Objects of
one proposition may be exchanged, and parameters do not depend on how many there are.
"""

from dataclasses import dataclass
from typing import ClassVar, Literal

import jax
import jax.numpy as jnp
import numpy as np
from flax import linen as nn

from t2tl_jax import checks
from t2tl_jax.networks.state_encoder import Squash, StateEncoderConfig
from t2tl_jax.networks.task_encoder import TaskEncoderConfig
from t2tl_jax.objects import Objects

HE = nn.initializers.orthogonal(2**0.5)
NEAREST = 1e-6
"""Below this distance an object has no direction."""
MOST_SLICES = 32
"""An observation is taken apart by so many slices at most."""


@dataclass(frozen=True)
class ObjectsConfig(StateEncoderConfig):
    """The objects of an environment that describes them, such as WaterWorld's balls."""

    reads_task: ClassVar[bool] = True

    layers: tuple[int, ...] = (128, 128)
    """Hidden sizes of the network that all objects share."""
    pooling: Literal["maximum_mean", "attention"] = "maximum_mean"
    """How objects become one vector. Either the shared network reads the task's code beside every object, and of what
    it says maximum and mean are taken. Or it reads objects alone, and the code asks for some of them by attention: a
    learner that values a state for every row of a table, as double DQN, then reads objects once and asks once a row."""
    heads: int = 4
    """Questions that attention asks at once; they share the last of the layers."""
    identity: Literal["proposition", "role"] = "proposition"
    """What is said of an object beside its numbers: which proposition it stands for, as a unit vector, and the whole
    code of the task. Or its role: only what the code says of this proposition, so that propositions may be renamed and
    others may come. That takes a code that speaks of each proposition by itself, such as lookahead."""
    place_scale: float = 5.0
    """By how much an object's place is multiplied, since what is near matters most; distance and direction are added
    to it."""

    def __post_init__(self) -> None:
        checks.sizes(self, "layers")
        checks.counts(self, "heads")
        checks.positive(self, "place_scale")
        if not self.layers:
            raise ValueError("objects are read by at least one layer, got state.layers=()")
        if self.pooling == "attention" and self.layers[-1] % self.heads:
            raise ValueError(
                f"heads share the last layer: state.heads must divide {self.layers[-1]}, got heads={self.heads}"
            )

    @property
    def by_role(self) -> bool:
        """As `identity` says."""
        return self.identity == "role"

    def check(self, objects: Objects | None, reader: TaskEncoderConfig) -> None:
        """There have to be objects, and of roles the code has to speak."""
        check_objects("network.state=objects", objects)
        if self.identity == "role":
            check_roles("network.state.identity=role", objects, reader)

    def left_of(self, task: jax.Array, reader: TaskEncoderConfig) -> jax.Array:
        """All of the code; where objects have roles, what it says of no proposition in particular."""
        return task if self.identity == "proposition" else reader.by_proposition(task)[1]


def check_objects(who: str, objects: Objects | None) -> Objects:
    """The objects; ValueError if `who` needs some and the environment describes none."""
    if objects is None:
        raise ValueError(
            f"{who} needs an environment that says which numbers of its observation are objects "
            "(LabelledEnv.objects), and this one does not; use network.state=flat"
        )
    return objects


def check_roles(who: str, objects: Objects | None, reader: TaskEncoderConfig) -> Objects:
    """The objects; ValueError unless the code says of each of them what it is to the task."""
    objects, room = check_objects(who, objects), reader.propositions_told
    if room is None:
        raise ValueError(
            f"{who} needs a code that speaks of each proposition by itself, got one of {type(reader).__name__}; use "
            "network.task_encoder=lookahead or roles, alone or in one that is joined"
        )
    most = max(objects.proposition) + 1
    if most > room:
        raise ValueError(
            f"the code tells of {room} propositions, and objects stand for {most}; set task_encoder.propositions to "
            f"{most} or more"
        )
    return objects


def object_features(obs: jax.Array, objects: Objects, place_scale: float) -> tuple[jax.Array, jax.Array]:
    """What is the agent's own, [..., own], and each object's numbers, [..., n, size + 1 + place].

    The place is scaled, and joined by its distance (scaled likewise) and the unit vector of its direction; an object
    that says nothing of its place has its numbers alone, [..., n, size].
    """
    numbers = np.array(objects.numbers)
    own = _taken(obs, np.setdiff1d(np.arange(obs.shape[-1]), numbers))
    each = _taken(obs, numbers.reshape(-1)).reshape(*obs.shape[:-1], *numbers.shape)
    if not objects.place:
        return own, each
    place = place_scale * each[..., : objects.place]
    distance = jnp.linalg.norm(place, axis=-1, keepdims=True)
    direction = place / jnp.maximum(distance, NEAREST)
    return own, jnp.concatenate([place, distance, direction, each[..., objects.place :]], axis=-1)


def _taken(obs: jax.Array, numbers: np.ndarray) -> jax.Array:
    """obs[..., numbers], where a few slices are enough without a gather, which would not fuse with what follows."""
    runs = [run for run in np.split(numbers, np.flatnonzero(np.diff(numbers) != 1) + 1) if len(run)]
    if not 0 < len(runs) <= MOST_SLICES:
        return obs[..., numbers]
    return jnp.concatenate([obs[..., run[0] : run[-1] + 1] for run in runs], axis=-1)


class ObjectsEncoder(nn.Module):
    """Observation and code -> features of the objects as the task sees them."""

    config: ObjectsConfig
    objects: Objects
    reader: TaskEncoderConfig
    squash: Squash

    @nn.compact
    def __call__(self, obs: jax.Array, task: jax.Array) -> jax.Array:
        """obs [..., O] and task [..., dim], broadcast against each other -> [..., D].

        D is twice the last layer for maximum and mean, and the last layer for attention.
        """
        config, which = self.config, jnp.array(self.objects.proposition)
        own, each = (self.squash(x) for x in object_features(obs, self.objects, config.place_scale))
        own = jnp.broadcast_to(own[..., None, :], (*each.shape[:-1], own.shape[-1]))
        parts = [each, own]
        if config.identity == "proposition":
            unit = jax.nn.one_hot(which, max(self.objects.proposition) + 1)
            parts.append(jnp.broadcast_to(unit, (*each.shape[:-1], unit.shape[-1])))
            said = task[..., None, :]  # the same to every object: [..., 1, dim]
        else:
            told, rest = self.reader.by_proposition(task)
            told = told[..., which, :]
            rest = jnp.broadcast_to(rest[..., None, :], (*told.shape[:-1], rest.shape[-1]))
            said = jnp.concatenate([told, rest], axis=-1)  # [..., n, told and rest]
        x = jnp.concatenate(parts, axis=-1)
        return self.attention(x, said) if config.pooling == "attention" else self.maximum_mean(x, said)

    def maximum_mean(self, x: jax.Array, said: jax.Array) -> jax.Array:
        """x [..., n, F], said [..., n or 1, dim] -> [..., 2 layers[-1]]."""
        # One layer on both side by side is the sum of one on each; what is the same for all is computed once.
        first = self.config.layers[0]
        asked = nn.Dense(first, use_bias=False, kernel_init=HE, name="said")(said)
        x = self.shared(x, asked)
        return jnp.concatenate([x.max(axis=-2), x.mean(axis=-2)], axis=-1)

    def attention(self, x: jax.Array, said: jax.Array) -> jax.Array:
        """x [..., n, F], said [..., n or 1, dim] -> [..., layers[-1]].

        A question may also find nothing: beside the objects there is one of weight exp(0) that says 0.
        """
        width, heads = self.config.layers[-1], self.config.heads

        def by_head(name: str, of: jax.Array) -> jax.Array:
            return nn.Dense(width, name=name)(of).reshape(*of.shape[:-1], heads, width // heads)

        x = self.shared(x)
        key, value, query = by_head("key", x), by_head("value", x), by_head("query", said)
        query = query / (width // heads) ** 0.5
        if self.config.identity == "proposition":
            score = jnp.einsum("...hk,...nhk->...nh", query[..., 0, :, :], key)
        else:
            score = (query * key).sum(axis=-1)
        nothing = jnp.zeros_like(score[..., :1, :])
        weight = nn.softmax(jnp.concatenate([score, nothing], axis=-2), axis=-2)[..., :-1, :]
        read = jnp.einsum("...nh,...nhk->...hk", weight, value)
        return read.reshape(*read.shape[:-2], width)

    def shared(self, x: jax.Array, asked: jax.Array | float = 0.0) -> jax.Array:
        """The network of one object, [..., n, F] -> [..., n, layers[-1]]; `asked` is added in its first layer."""
        for i, size in enumerate(self.config.layers):
            x = nn.Dense(size, kernel_init=HE, name=f"dense_{i}")(x)
            x = nn.relu(x + asked if i == 0 else x)
        return x
