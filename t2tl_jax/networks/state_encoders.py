"""The state encoders, registered as a user's would be. A network's own layers come behind them."""

from dataclasses import dataclass

import jax
from flax import linen as nn

from t2tl_jax.networks.merged import MergedConfig, MergedEncoder
from t2tl_jax.networks.objects import ObjectsConfig, ObjectsEncoder
from t2tl_jax.networks.state_encoder import Squash, StateEncoderConfig
from t2tl_jax.networks.task_encoder import TaskEncoderConfig
from t2tl_jax.objects import Objects
from t2tl_jax.registry import STATE_ENCODERS, register_state_encoder


@dataclass(frozen=True)
class FlatConfig(StateEncoderConfig):
    """The observation as it is, one vector."""


class Flat(nn.Module):
    """The numbers of the observation, whatever they mean; no parameters."""

    squash: Squash

    def __call__(self, obs: jax.Array, task: jax.Array | None) -> jax.Array:
        """obs [..., O] -> [..., O]."""
        del task
        return self.squash(obs)


def make_state_encoder(
    config: StateEncoderConfig, objects: Objects | None, reader: TaskEncoderConfig, squash: Squash = lambda x: x
) -> nn.Module:
    """The module that a configuration stands for: (obs [..., O], task [..., dim]) -> features [..., D].

    Leading axes of observation and task are broadcast against each other. What does not read the task takes None.

    Raises:
        ValueError: if its class is not registered, or if it cannot read such observations.
    """
    config.check(objects, reader)
    return STATE_ENCODERS.maker(config)(config, objects, reader, squash)


def check_context(context: object, state: StateEncoderConfig) -> None:
    """A context window holds embedded observations, and no task to embed them for.

    Raises:
        ValueError: for a network with context whose state is not read flat.
    """
    if context is not None and not isinstance(state, FlatConfig):
        raise ValueError(
            f"a context window embeds observations by themselves, so it needs network.state=flat, got "
            f"{type(state).__name__}; use flat, or network.context=None"
        )


register_state_encoder("flat", FlatConfig, lambda config, objects, reader, squash: Flat(squash))
register_state_encoder("objects", ObjectsConfig, ObjectsEncoder)
register_state_encoder("merged", MergedConfig, MergedEncoder)
