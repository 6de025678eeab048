"""Numbers that only enter arithmetic, such as rates and discounts, as arguments of the program instead of constants.

Configurations that differ in nothing else are then one program, which is compiled once, and may train side by side in
it. A learner names such fields (`LearnerConfig.traced`) and is written as if they were plain numbers: inside the traced
program it is made anew from a configuration that holds the arguments in their place.
"""

from collections.abc import Callable
from typing import Any

from t2tl_jax.task_env import TaskEnv, TaskParams
from t2tl_jax.training.types import Agent, LearnerConfig, Metrics

RANDOM_STARTS = "random_starts"
"""The one number of the task environment among those of the learner."""


def numbers_of(config: LearnerConfig, random_starts: float) -> dict[str, float]:
    """The numbers that only enter arithmetic, by name.

    Args:
        config: of the learner.
        random_starts: share of episodes that start anywhere. Where there are none, the program has no such starts.
    """
    if not config.traced:  # a learner that names none takes its environment as it is, too
        return {}
    return config.numbers | ({RANDOM_STARTS: random_starts} if random_starts > 0.0 else {})


def make_given(
    make: Callable[..., Agent], env: TaskEnv, config: LearnerConfig, episode_length: int, iterations: int
) -> Agent:
    """What ``make(env, config, episode_length, iterations)`` gives, which trains with the numbers in `env_params`.

    Where these hold none, and outside of training, the numbers are those of the configuration.
    """
    own = make(env, config, episode_length, iterations)

    def given(env_params: TaskParams) -> Agent:
        numbers = dict(env_params.numbers)
        if not numbers:
            return own
        share = numbers.pop(RANDOM_STARTS, None)
        there = env if share is None else env.with_random_starts(share)
        return make(there, config.with_numbers(numbers), episode_length, iterations)

    def init(key: Any, env_params: TaskParams) -> Any:
        return given(env_params).init(key, env_params)

    def iterate(state: Any, env_params: TaskParams) -> tuple[Any, Metrics]:
        return given(env_params).iterate(state, env_params)

    def restart(state: Any, env_params: TaskParams) -> Any:
        again = given(env_params).restart
        assert again is not None  # as of its own
        return again(state, env_params)

    return own._replace(init=init, iterate=iterate, restart=None if own.restart is None else restart, given=given)
