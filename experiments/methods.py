"""The methods that the paper compares, each as a few switches of one program: ``--method NAME`` on any configuration.

A method is how a task becomes numbers, whether the policy sees a context window, and whether every step teaches every
sub-task. Sizes, learner, budget and everything else stay those of the configuration.
"""

from dataclasses import dataclass, replace
from typing import Any

from t2tl_jax.agents.dqn_config import DQNConfig
from t2tl_jax.agents.ppo_config import PPOConfig
from t2tl_jax.errors import UserError, explained, unknown
from t2tl_jax.networks.actor_critic import NetworkConfig
from t2tl_jax.networks.context_config import ContextConfig
from t2tl_jax.networks.q_network import QNetworkConfig
from t2tl_jax.networks.rgcn import RGCNConfig
from t2tl_jax.networks.task_encoder import TaskEncoderConfig
from t2tl_jax.networks.task_encoders import OneHotConfig
from t2tl_jax.networks.transformer import TransformerConfig
from t2tl_jax.runs.config import Config
from t2tl_jax.single_state import SingleStateConfig


@dataclass(frozen=True)
class Method:
    """The switches of one method."""

    summary: str
    task_encoder: type[TaskEncoderConfig]
    context: bool
    counterfactual: bool
    """Whether every step teaches every sub-task, as far as the learner can."""
    code_size: int | None = None
    """Numbers of a one-hot code where the method says how many; else as many as the configuration's has."""


METHODS = {
    "t2tl": Method("Transformers on the formula and on the context window", TransformerConfig, True, True),
    "t1tl": Method("a Transformer on the formula", TransformerConfig, False, True),
    "gnn": Method("a relational graph network on the formula's tree", RGCNConfig, False, True),
    "rm": Method("the automaton's or reward machine's state, every state learned (CRM)", OneHotConfig, False, True),
    "dfa": Method("the automaton's state, only the own one learned", OneHotConfig, False, False),
    "dfa_cont": Method("dfa with the context window", OneHotConfig, True, False),
    "dfa_number": Method(
        "dfa with the state's number as code, as in the paper's curves", OneHotConfig, False, False, 1
    ),
    "rm_6": Method("rm with a code of 6 numbers: the paper's curve", OneHotConfig, False, True, 6),
}

WINDOW = {PPOConfig: 8, DQNConfig: 12}
"""Published lengths of the context window, where the configuration has none."""


def apply(config: Config, name: str) -> Config:
    """The configuration with the switches of a method.

    Simultaneous learning needs a learner that can relabel steps. PPO cannot (nor does the authors'), so that under it
    `rm` is `dfa` by another name; its on-policy form, episodes that start in a random state, is a field of the
    configuration (`random_starts`) and the same for all methods. One-hot codes have nothing to pre-train, and in
    pre-training there is no context.

    Raises:
        UserError: for a method that is not known, or a learner that is not one of the paper's.
    """
    if name not in METHODS:
        raise unknown("method", name, METHODS)
    method = METHODS[name]
    learner: Any = config.learner
    if not isinstance(learner, PPOConfig | DQNConfig):
        raise UserError(f"methods are those of the paper's learners, PPO and DQN; this one is {type(learner).__name__}")
    network: Any = learner.network
    context = None
    if method.context and not isinstance(config.env, SingleStateConfig):
        context = network.context or ContextConfig(length=WINDOW[type(learner)])
    learned = method.task_encoder.learned
    with explained():  # a network over objects takes no context
        network = replace(
            network,
            task_encoder=_encoder(method, network),
            freeze_task_encoder=network.freeze_task_encoder and learned,
            context=context,
        )
    learner, pretrained = replace(learner, network=network), config.pretrained if learned else ""
    if isinstance(learner, DQNConfig):
        learner = replace(learner, counterfactual=method.counterfactual)
        return replace(config, pretrained=pretrained, learner=learner)
    return replace(config, pretrained=pretrained, learner=learner)


def _encoder(method: Method, network: NetworkConfig | QNetworkConfig) -> TaskEncoderConfig:
    """The encoder that the configuration has, if it is of this kind; else the network's own default, or the kind's."""
    kind = method.task_encoder
    if method.code_size is not None:
        return OneHotConfig(method.code_size)
    for candidate in (network, type(network)()):
        if isinstance(candidate.task_encoder, kind):
            return candidate.task_encoder
    return kind()
