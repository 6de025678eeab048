"""The state encoders, registered as a user's would be. A network's own layers come behind them."""

from dataclasses import dataclass
from typing import ClassVar

import jax
from flax import linen as nn

from t2tl_jax.networks.context_config import ContextConfig
from t2tl_jax.networks.gated import GatedConfig, GatedEncoder
from t2tl_jax.networks.merged import MergedConfig, MergedEncoder
from t2tl_jax.networks.objects import ObjectsConfig, ObjectsEncoder
from t2tl_jax.networks.state_encoder import Squash, StateEncoderConfig
from t2tl_jax.networks.task_encoder import TaskEncoderConfig
from t2tl_jax.objects import Objects
from t2tl_jax.registry import STATE_ENCODERS, register_state_encoder


@dataclass(frozen=True)
class FlatConfig(StateEncoderConfig):
    """The observation as it is, one vector."""

    in_windows: ClassVar[bool] = True


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


def check_context(context: ContextConfig | None, state: StateEncoderConfig, by_task: bool) -> None:
    """Whether a context window can hold such states, or a carried state remember them; those that read the task are
    kept as observations.

    Args:
        context: the network's context; without one nothing is wrong.
        state: what reads the observation first.
        by_task: whether the network can read a window by the task of the step that reads it.

    Raises:
        ValueError: for a network with context whose windows cannot hold what the state encoder makes.
    """
    if context is None or (not state.reads_task and (state.in_windows or context.carried)):
        return
    got = f"needs network.state=flat, got {STATE_ENCODERS.name_of(state)}"
    if not by_task:
        raise ValueError(
            f"the values of all tasks share one window, so DQN with context {got}; use flat, or "
            "network.context=None; PPO's windows can be merged, too"
        )
    if context.carried:
        if state.in_carried:
            return
        raise ValueError(
            "a state that is carried cannot read the task, which changes, and these states cannot be merged later: "
            f"network.context.carried=True {got}; use flat, or network.state=merged where lidars can be merged"
        )
    if not state.in_windows:
        raise ValueError(
            f"no context window can hold these states: it {got}; use flat, or network.state=merged where lidars can be "
            "merged, or network.context=None"
        )
    if not context.recompute:
        raise ValueError(
            "a window of states that read the task keeps observations, which mean something else to every task: "
            f"network.context.recompute=False {got}; use recompute=True, or flat"
        )


register_state_encoder("flat", FlatConfig, lambda config, objects, reader, squash: Flat(squash))
register_state_encoder("objects", ObjectsConfig, ObjectsEncoder)
register_state_encoder("merged", MergedConfig, MergedEncoder)
register_state_encoder("gated", GatedConfig, GatedEncoder)
