"""A configuration of the plan that is another one in some fields."""

from dataclasses import replace
from typing import Any

from experiments.reproduction import rates
from t2tl_jax.networks.gru import GRUConfig
from t2tl_jax.networks.task_encoder import TaskEncoderConfig
from t2tl_jax.runs.config import Config


def with_rate(config: Config, which: str) -> Config:
    """The configuration with a learning rate of the search, by its name."""
    learner: Any = config.learner
    return replace(config, learner=changed_learner(learner, learning_rate=rates.scaled(learner.learning_rate, which)))


def with_encoder(config: Config, **changes: Any) -> Config:
    """The configuration with other sizes of its task encoder."""
    learner: Any = config.learner
    encoder: TaskEncoderConfig = replace(learner.network.task_encoder, **changes)
    return replace(config, learner=changed_learner(learner, network=replace(learner.network, task_encoder=encoder)))


def with_gru_reader(config: Config) -> Config:
    """The configuration with a GRU instead of a Transformer over its context window."""
    return with_context(config, reader=GRUConfig(width=32))


def with_context(config: Config, **changes: Any) -> Config:
    """The configuration with a context window that is another one in some fields."""
    learner: Any = config.learner
    context = replace(learner.network.context, **changes)
    return replace(config, learner=changed_learner(learner, network=replace(learner.network, context=context)))


def changed_learner(learner: Any, **changes: Any) -> Any:
    """The learner of any kind with other values of some fields."""
    return replace(learner, **changes)
