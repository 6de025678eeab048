"""What CONFIG:METHOD:PHYSICS:ENVIRONMENTS means, of which all but the first may be left out or empty."""

from dataclasses import replace
from typing import Any

from t2tl_jax.errors import UserError

FORM = "CONFIG, CONFIG:METHOD, CONFIG:METHOD:PHYSICS or CONFIG:METHOD:PHYSICS:ENVIRONMENTS"


def training(text: str) -> Any:
    """The configuration that a text of the form `FORM` means.

    With more environments a minibatch is larger by the same factor, so that an iteration keeps its number of gradient
    steps: this is how one seed fills several devices.

    Raises:
        UserError: for a name that is not known, an environment that has no choice of physics, or a number of
            environments that is none or does not suit the learner.
    """
    from experiments import configs, methods  # noqa: F401, registers the configurations
    from t2tl_jax.registry import named_config

    name, method, physics, num_envs, *more = (*text.split(":"), "", "", "")
    if any(more):
        raise UserError(f"a training is {FORM}, got {text!r}")
    config = named_config(name)
    if method:
        config = methods.apply(config, method)
    if physics:
        if not hasattr(config.env, "physics"):
            raise UserError(f"{text}: {type(config.env).__name__} has no choice of physics")
        config = replace(config, env=replace(config.env, physics=physics))
    if num_envs:
        config = replace(config, learner=with_num_envs(config.learner, num_envs, text))
    return config


def with_num_envs(learner: Any, num_envs: str, text: str) -> Any:
    """The same learner with so many environments, and minibatches that grow or shrink with them.

    Raises:
        UserError: for no positive whole number, or a learner that cannot have so many, as `training` says; `text` is
            what the message begins with.
    """
    if not num_envs.isdecimal() or int(num_envs) < 1:
        raise UserError(
            f"{text}: the number of environments is a whole number of at least 1, such as 16384, got {num_envs!r}"
        )
    if not (hasattr(learner, "num_envs") and hasattr(learner, "minibatch_size")):
        raise UserError(
            f"{text}: {type(learner).__name__} has no minibatches that could grow with the number of environments; "
            "give it for a training by PPO, such as zone_ppo_long:t1tl:mjx:16384"
        )
    size, rest = divmod(learner.minibatch_size * int(num_envs), learner.num_envs)
    if rest or not size:
        raise UserError(
            f"{text}: a minibatch has {learner.minibatch_size:,} samples for {learner.num_envs:,} environments, which "
            f"makes no whole number for {int(num_envs):,}; take a multiple of {learner.num_envs:,}"
        )
    try:
        return replace(learner, num_envs=int(num_envs), minibatch_size=size)
    except ValueError as error:
        raise UserError(f"{text}: {error}") from error
