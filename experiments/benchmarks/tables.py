"""What the rows of a table cost in training: ``python -m experiments.benchmarks.tables --json FILE``.

PPO in the world of a single state, whose own time is small, so that nearly all of it is reading tasks and learning. The
same training is timed on tables of random formulas that differ in the number of rows alone.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

from experiments.benchmarks import json_file
from experiments.cli.errors import guarded
from t2tl_jax import checks
from t2tl_jax.errors import explained
from t2tl_jax.flags import parse

MinibatchesOf = Literal["steps", "environments"]


@dataclass(frozen=True)
class Arguments:
    """Time PPO on tables of more and more rows."""

    rows: tuple[int, ...] = (64, 256, 1024, 10240)
    """Rows of the tables."""
    num_envs: int = 64
    """Parallel environments, each with a task of its own at a time."""
    unroll_length: int = 32
    """Steps of an iteration."""
    minibatch_size: int = 256
    """Samples of a gradient step."""
    repeats: int = 5
    """Timed iterations; their median is reported."""
    json: Path | None = None
    """Also write the results to this file."""

    def __post_init__(self) -> None:
        checks.counts(self, "num_envs", "unroll_length", "minibatch_size", "repeats")
        if not self.rows or min(self.rows) < 16:
            raise ValueError(f"rows are one or more numbers of at least 16, got {self.rows}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0 done, 2 for input that cannot be used."""
    return guarded(lambda: _main(sys.argv[1:] if arguments is None else list(arguments)))


def _main(texts: list[str]) -> int:
    arguments = parse(Arguments, texts, prog="python -m experiments.benchmarks.tables", description=__doc__)
    json_file.check(arguments.json)
    found = []
    with explained():
        for rows in arguments.rows:
            for kind in get_args(MinibatchesOf):
                found.append({"rows": rows, "minibatches_of": kind} | measure(rows, kind, arguments))
                print(found[-1], flush=True)
                json_file.store_so_far(arguments, "experiments.benchmarks.tables", texts, results=found)
    json_file.store(arguments, "experiments.benchmarks.tables", texts, results=found)
    return 0


def measure(rows: int, kind: MinibatchesOf, arguments: Arguments) -> dict[str, Any]:
    """Seconds of an iteration on one table: the median and both ends; and what the table holds."""
    import jax

    from experiments.benchmarks.timing import compiled, rate
    from t2tl_jax.agents.ppo import make_ppo
    from t2tl_jax.agents.ppo_config import PPOConfig
    from t2tl_jax.ltl import compile_pool
    from t2tl_jax.networks.actor_critic import NetworkConfig
    from t2tl_jax.networks.transformer import TransformerConfig
    from t2tl_jax.single_state import SingleState, SingleStateConfig
    from t2tl_jax.task_env import TaskEnv

    world = SingleState(SingleStateConfig(tuple("abcdefghijkl")))
    names, alphabet = world.propositions, world.alphabet
    table = compile_pool("Until_1_3_1_2", names, alphabet, 0, size=rows // 8, rows=rows, length=48)
    env = TaskEnv(world, table)
    encoder = TransformerConfig(layers=2, width=32, heads=4, feed_forward=64)
    network = NetworkConfig(task_encoder=encoder, env_layers=(), actor_layers=(64,), critic_layers=(64,))
    sizes = {name: getattr(arguments, name) for name in ("num_envs", "unroll_length", "minibatch_size")}
    agent = make_ppo(env, PPOConfig(network=network, minibatches_of=kind, **sizes), 75, 1 + arguments.repeats)
    given = jax.device_put(env.make_params(0))
    state = jax.jit(agent.init)(jax.random.key(0), given)
    iterate, costs = compiled(lambda: jax.jit(agent.iterate, donate_argnums=0).lower(state, given))

    def once() -> Any:
        nonlocal state
        state, metrics = iterate(state, given)
        return metrics

    speed = rate(once, agent.frames_per_iteration, arguments.repeats)
    seconds = [agent.frames_per_iteration / one for one in (speed.median, speed.fastest, speed.slowest)]
    taken = int(table.is_open.sum())
    return {"open_rows": taken, "seconds": seconds[0], "fastest": seconds[1], "slowest": seconds[2]} | {
        "memory_mib": costs.memory_mib
    }


if __name__ == "__main__":
    sys.exit(main())
