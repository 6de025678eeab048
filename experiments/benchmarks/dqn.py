"""What learning every sub-task costs: ``python -m experiments.benchmarks.dqn``.

Times the training step of DQN (act, store, one gradient step) with and without counterfactual learning on the same
machine in the same process, for tasks of 6 and of 77 rows and both heads of the Q-network.
"""

import itertools
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

from experiments.cli.errors import guarded
from t2tl_jax import checks
from t2tl_jax.errors import explained
from t2tl_jax.flags import parse
from t2tl_jax.quiet import quiet_imports

Head = Literal["film", "bilinear"]
HEADS: tuple[Head, ...] = ("film", "bilinear")


@dataclass(frozen=True)
class Arguments:
    """Time DQN's training step with and without counterfactual learning."""

    num_envs: int = 16
    """Parallel environments."""
    batch_size: int = 512
    """Transitions of a gradient step."""
    steps: int = 200
    """Training steps in one call."""
    repeats: int = 5
    """Calls that are timed, after one that is not."""

    def __post_init__(self) -> None:
        checks.counts(self, "num_envs", "batch_size", "steps", "repeats")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0 done, 2 for input that cannot be used."""
    return guarded(lambda: _main(sys.argv[1:] if arguments is None else list(arguments)))


def _main(texts: list[str]) -> int:
    arguments = parse(Arguments, texts, prog="python -m experiments.benchmarks.dqn", description=Arguments.__doc__)
    with explained():
        _report(arguments)
    return 0


def _report(arguments: Arguments) -> None:
    with quiet_imports():
        import jax

        from t2tl_jax.agents.dqn_config import DQNConfig

    learner = DQNConfig(
        num_envs=arguments.num_envs,
        batch_size=arguments.batch_size,
        unroll_length=arguments.steps,
        learning_starts=1,
    )
    print(f"{jax.devices()[0].device_kind}, jax {jax.__version__}, {arguments.num_envs} environments, batch", end=" ")
    print(f"{arguments.batch_size}; microseconds per training step, median (minimum, maximum)")
    print(f"{'task':22} {'rows':>4} {'head':9} {'one row':>22} {'every row':>22} {'ratio':>6} {'compile':>8}")
    for (task, rows), head in itertools.product((("phi_water_6_1", 6), ("rm_water", 77)), HEADS):
        plain, compile_plain = _time(arguments, task, rows, head, replace(learner, counterfactual=False))
        every, compile_every = _time(arguments, task, rows, head, replace(learner, counterfactual=True))
        print(
            f"{task:22} {rows:4} {head:9} {_spread(plain):>22} {_spread(every):>22} "
            f"{every[len(every) // 2] / plain[len(plain) // 2]:6.2f} {compile_plain + compile_every:6.1f} s",
            flush=True,
        )


def _time(arguments: Arguments, task: str, rows: int, head: Head, learner: Any) -> tuple[list[float], float]:
    """Sorted microseconds per step, and seconds of compilation."""
    import time

    import jax

    from envs.waterworld import EPISODE_LENGTH, LETTERS, WaterWorld, WaterWorldConfig
    from t2tl_jax.agents.dqn import make_dqn
    from t2tl_jax.ltl import compile_named
    from t2tl_jax.networks.q_network import QNetworkConfig
    from t2tl_jax.networks.task_encoders import OneHotConfig
    from t2tl_jax.task_env import TaskEnv

    world = WaterWorld(WaterWorldConfig(colours=LETTERS) if task.startswith("rm") else WaterWorldConfig())
    env = TaskEnv(world, compile_named(task, world.propositions, world.alphabet))
    network = QNetworkConfig(task_encoder=OneHotConfig(rows), head=head, task_layer=512)
    agent = make_dqn(env, replace(learner, network=network), EPISODE_LENGTH, iterations=1 + arguments.repeats)
    env_params = jax.device_put(env.make_params(0))
    begin = time.perf_counter()
    init = jax.jit(agent.init).lower(jax.random.key(0), env_params).compile()
    state = init(jax.random.key(0), env_params)
    iterate = jax.jit(agent.iterate, donate_argnums=0).lower(state, env_params).compile()
    compiled = time.perf_counter() - begin
    seconds = []
    for _ in range(1 + arguments.repeats):
        begin = time.perf_counter()
        state, _ = iterate(state, env_params)
        jax.block_until_ready(state)
        seconds.append(time.perf_counter() - begin)
    return sorted(1e6 * second / arguments.steps for second in seconds[1:]), compiled


def _spread(values: list[float]) -> str:
    return f"{values[len(values) // 2]:.0f} ({values[0]:.0f}, {values[-1]:.0f})"


if __name__ == "__main__":
    sys.exit(main())
