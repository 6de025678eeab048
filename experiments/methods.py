"""The methods that the paper compares, each as a few switches of one program: ``--method NAME`` on any configuration.

A method is how a task becomes numbers, whether the policy sees a context window, and whether every step teaches every
sub-task. Sizes, learner, budget and everything else stay those of the configuration.
"""

from dataclasses import dataclass, replace
from typing import Literal

from envs.single_state import SingleStateConfig
from experiments.configs import Config
from t2tl_jax.networks.context import ContextConfig


@dataclass(frozen=True)
class Method:
    """The switches of one method."""

    summary: str
    task_encoder: Literal["transformer", "one_hot", "rgcn"]
    context: bool
    simultaneous: bool


METHODS = {
    "t2tl": Method("Transformers on the formula and on the context window", "transformer", True, True),
    "t1tl": Method("a Transformer on the formula", "transformer", False, True),
    "gnn": Method("a relational graph network on the formula's tree", "rgcn", False, True),
    "rm": Method("the automaton's or reward machine's state, every state learned (CRM)", "one_hot", False, True),
    "dfa": Method("the automaton's state, only the own one learned", "one_hot", False, False),
    "dfa_cont": Method("dfa with the context window", "one_hot", True, False),
}

START_ANYWHERE = 0.5
"""Share of episodes that `rm` starts in a random state under PPO, which cannot learn from another state's steps."""

WINDOW = {"ppo": 8, "dqn": 12}
"""Published lengths of the context window, where the configuration has none."""


def apply(config: Config, name: str) -> Config:
    """The configuration with the switches of a method.

    Simultaneous learning needs a learner that can relabel steps. Under PPO, for which the authors' code has none
    either, only `rm` has its on-policy form: episodes that start in a random state. One-hot codes have nothing to
    pre-train, and in pre-training there is no context.
    """
    method = METHODS[name]
    context = None
    if method.context and not isinstance(config.env, SingleStateConfig):
        context = config.network.context or ContextConfig(length=WINDOW["ppo" if config.dqn is None else "dqn"])
    learned = method.task_encoder != "one_hot"
    network = replace(
        config.network,
        task_encoder=method.task_encoder,
        freeze_task_encoder=config.network.freeze_task_encoder and learned,
        context=context,
    )
    config = replace(config, pretrained=config.pretrained if learned else "", network=network)
    if config.dqn is not None:
        return replace(config, dqn=replace(config.dqn, simultaneous=method.simultaneous))
    return replace(config, simultaneous=START_ANYWHERE if name == "rm" else 0.0)
