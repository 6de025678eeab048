"""Train agents to carry out tasks written in temporal logic, end to end in JAX (after T2TL, RA-L 2023).

The names below are the library's face. They are imported when they are first used, so that ``import t2tl_jax`` loads
neither JAX nor MuJoCo.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from t2tl_jax.quiet import quiet_imports

import_module("t2tl_jax.loaded")  # notes the time

if TYPE_CHECKING:
    from t2tl_jax.agents.dp import make_dp
    from t2tl_jax.agents.dp_config import DPConfig
    from t2tl_jax.agents.dqn import make_dqn
    from t2tl_jax.agents.dqn_config import DQNConfig
    from t2tl_jax.agents.ppo import make_ppo
    from t2tl_jax.agents.ppo_config import PPOConfig
    from t2tl_jax.env import EnvConfig, LabelledEnv
    from t2tl_jax.errors import UserError
    from t2tl_jax.ltl import Formula, LTLError, TaskTable, compile_tasks, parse, progress, register_family, sample
    from t2tl_jax.networks.actor_critic import NetworkConfig
    from t2tl_jax.networks.context_config import ContextConfig
    from t2tl_jax.networks.objects import ObjectsConfig
    from t2tl_jax.networks.q_network import QNetworkConfig
    from t2tl_jax.networks.state_encoder import StateEncoderConfig
    from t2tl_jax.networks.task_encoder import TaskEncoderConfig
    from t2tl_jax.networks.task_encoders import OneHotConfig
    from t2tl_jax.networks.transformer import TransformerConfig
    from t2tl_jax.objects import Objects
    from t2tl_jax.registry import (
        make_env,
        register_agent,
        register_config,
        register_context_reader,
        register_env,
        register_state_encoder,
        register_task_encoder,
    )
    from t2tl_jax.runs.callbacks import Callback, Row, TrainingProgress
    from t2tl_jax.runs.config import Config
    from t2tl_jax.runs.interrupts import Interrupted
    from t2tl_jax.runs.policy import Policy
    from t2tl_jax.runs.prompt import Prompt
    from t2tl_jax.runs.result import Result
    from t2tl_jax.runs.train import evaluate, load, resume, train
    from t2tl_jax.task_env import TaskEnv
    from t2tl_jax.training.types import Agent, LearnerConfig
    from t2tl_jax.wrappers import TaskInObservation

_HOME = {
    "Agent": "training.types",
    "Callback": "runs.callbacks",
    "Config": "runs.config",
    "ContextConfig": "networks.context_config",
    "DPConfig": "agents.dp_config",
    "DQNConfig": "agents.dqn_config",
    "EnvConfig": "env",
    "Formula": "ltl",
    "Interrupted": "runs.interrupts",
    "LabelledEnv": "env",
    "LTLError": "ltl",
    "LearnerConfig": "training.types",
    "NetworkConfig": "networks.actor_critic",
    "Objects": "objects",
    "ObjectsConfig": "networks.objects",
    "OneHotConfig": "networks.task_encoders",
    "PPOConfig": "agents.ppo_config",
    "Policy": "runs.policy",
    "Prompt": "runs.prompt",
    "QNetworkConfig": "networks.q_network",
    "Result": "runs.result",
    "Row": "runs.callbacks",
    "StateEncoderConfig": "networks.state_encoder",
    "TaskEncoderConfig": "networks.task_encoder",
    "TaskEnv": "task_env",
    "TaskInObservation": "wrappers",
    "TaskTable": "ltl",
    "TrainingProgress": "runs.callbacks",
    "TransformerConfig": "networks.transformer",
    "UserError": "errors",
    "compile_tasks": "ltl",
    "evaluate": "runs.train",
    "load": "runs.train",
    "make_dp": "agents.dp",
    "make_dqn": "agents.dqn",
    "make_env": "registry",
    "make_ppo": "agents.ppo",
    "parse": "ltl",
    "progress": "ltl",
    "register_agent": "registry",
    "register_config": "registry",
    "register_env": "registry",
    "register_family": "ltl",
    "register_state_encoder": "registry",
    "register_task_encoder": "registry",
    "register_context_reader": "registry",
    "resume": "runs.train",
    "sample": "ltl",
    "train": "runs.train",
}
"""The module of this package that each name comes from."""

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    """Import a name of the face when it is first used."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    with quiet_imports():
        value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*globals(), *_HOME]
