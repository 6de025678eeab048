"""What steps towards speed were to gain, and did: ``python -m experiments.benchmarks.gains --json FILE``.

Each compares two forms of the same work, whose results are equal or as good. The gain that is predicted is the ratio of
their arithmetic; the measured one that of their times, which are taken by turns within one process.
"""

import math
import statistics
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

from scipy import stats

from experiments.benchmarks import json_file
from experiments.cli.errors import guarded
from t2tl_jax import checks
from t2tl_jax.errors import UserError, did_you_mean, explained
from t2tl_jax.flags import parse


@dataclass(frozen=True)
class Arguments:
    """Time forms of the same work beside each other, and count their arithmetic."""

    steps: tuple[str, ...] = ()
    """Which of them, such as guard or next_state; by default all but those for GPUs, from shared_tokens_12 on."""
    repeats: int = 5
    """Timed calls of each form; the median of the ratios of neighbouring calls is reported, from six calls on with its
    interval."""
    in_a_row: int = 1
    """Calls that are timed together, each started while the one before it may still run, as the iterations of a run are
    on a GPU: what the host does to start one is hidden then."""
    json: Path | None = None
    """Also write the results to this file."""

    def __post_init__(self) -> None:
        checks.counts(self, "repeats", "in_a_row")
        for name in self.steps:
            if name not in KNOWN:
                raise ValueError(f"steps: there is no {name!r}{did_you_mean(name, KNOWN)}; known: {', '.join(KNOWN)}")


@dataclass(frozen=True)
class Form:
    """One form of some work."""

    call: Callable[[], Any]
    """Does it once, compiled."""
    flop: float
    """Its arithmetic."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0 done, 2 for input that cannot be used."""
    return guarded(lambda: _main(sys.argv[1:] if arguments is None else list(arguments)))


def _main(texts: list[str]) -> int:
    arguments = parse(Arguments, texts, prog="python -m experiments.benchmarks.gains", description=__doc__)
    json_file.check(arguments.json)
    found = {}
    for name in arguments.steps:
        if name in ON_GPUS:
            _check_gpu(name)
    with explained():
        for name in arguments.steps or STEPS:
            found[name] = compare(*KNOWN[name](), arguments.repeats, arguments.in_a_row)
            print(f"{name}: {found[name]}", flush=True)
            json_file.store_so_far(arguments, "experiments.benchmarks.gains", texts, steps=found)
    json_file.store(arguments, "experiments.benchmarks.gains", texts, steps=found)
    return 0


def _check_gpu(name: str) -> None:
    from t2tl_jax.training.compiler_options import GRAPHS, compiler_options

    if compiler_options() != GRAPHS:
        raise UserError(
            f"{name} is a step on NVIDIA GPUs, and there is none here, or XLA_FLAGS names one of its options, or this "
            "version of XLA does not know one"
        )


def compare(before: Form, after: Form, repeats: int, in_a_row: int = 1) -> Mapping[str, float | None]:
    """How many times as long `before` takes as `after`, by arithmetic and by the clock.

    `low` and `high` enclose the median with 95 % by ranks, whatever the ratios are distributed like; None where there
    are too few of them.
    """
    ratios = []
    for turn in range(repeats + 1):
        slow, fast = (_seconds(form.call, in_a_row) for form in (before, after))
        ratios += [slow / fast] * (turn > 0)  # the first calls warm up
    interval = stats.quantile_test(ratios).confidence_interval()
    return {
        "predicted": before.flop / after.flop,
        "measured": statistics.median(ratios),
        "low": _finite(interval.low),
        "high": _finite(interval.high),
        "least": min(ratios),
        "most": max(ratios),
    }


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _seconds(call: Callable[[], Any], in_a_row: int) -> float:
    import jax

    started = time.perf_counter()
    jax.block_until_ready([call() for _ in range(in_a_row)])
    return time.perf_counter() - started


def segments() -> tuple[Form, Form]:
    """An iteration of T2TL whose windows are embedded step by step, and in segments of eight steps."""
    from experiments.benchmarks.trainings import training

    config = training("zone_ppo:t2tl:closed_form")
    network = config.learner.network
    forms = []
    for length in (1, network.context.segment_length):
        context = replace(network.context, segment_length=length)
        learner = replace(config.learner, network=replace(network, context=context))
        forms.append(_iteration(replace(config, learner=learner, seeds="1")))
    return forms[0], forms[1]


def next_values() -> tuple[Form, Form]:
    """An iteration of T1TL that computes V(s') of every step, and one that takes most from the next step's V(s)."""
    import jax
    import jax.numpy as jnp

    from experiments.benchmarks.trainings import training
    from t2tl_jax.agents import ppo

    def every_step(truncated: jax.Array, episode_length: int) -> jax.Array:
        return jnp.broadcast_to(jnp.arange(len(truncated))[:, None], truncated.shape)

    config = replace(training("zone_ppo:t1tl:closed_form"), seeds="1")
    with patch.object(ppo, "last_steps", every_step):
        before = _iteration(config)
    return before, _iteration(config)


def next_state() -> tuple[Form, Form]:
    """A gradient of double DQN that also flows through the values at s', with a weight of zero, and one that does not.

    So it was when s and s' went through the network together.
    """
    import jax
    import jax.numpy as jnp

    from experiments.benchmarks.trainings import training
    from t2tl_jax.agents.dqn_config import DQNConfig
    from t2tl_jax.agents.td_learning import Transition, dqn_loss
    from t2tl_jax.networks.q_network import QNetwork
    from t2tl_jax.runs.experiment import build
    from t2tl_jax.task_env import Shared

    experiment = build(replace(training("waterworld_dqn:t1tl"), seeds="1"))
    env, config = experiment.task_env, experiment.config.learner
    assert isinstance(config, DQNConfig) and env.num_actions is not None
    network: Any = QNetwork(config.network, env.num_actions, env.objects)
    state = experiment.agent.init(jax.random.key(0), experiment.task_env.make_params(0))
    table, params = env.table, state.params
    embedding = network.apply(params, table, method="embed")
    count, keys = config.batch_size, jax.random.split(jax.random.key(1), 3)
    obs, after = (jax.random.normal(key, (count, env.observation_size)) for key in keys[:2])
    zero, never = jnp.zeros(count, jnp.int32), jnp.zeros(count, bool)
    letter = jax.random.randint(keys[2], (count,), 0, 4)
    batch = Transition(obs, zero, after, zero, Shared(letter, jnp.zeros(count), never), never)

    target = jax.tree.map(jnp.copy, params)

    def gradient(through: bool) -> Form:
        def loss(params: Any, embedding: Any, target: Any, batch: Any, weight: jax.Array) -> jax.Array:
            value, _ = dqn_loss(config, network, table, params, embedding, target, embedding, batch)
            if through:
                value += weight * network.apply(params, batch.next_obs, embedding, (), method="every_row").sum()
            return value

        given = params, embedding, target, batch, jnp.float32(0)
        program = jax.jit(jax.grad(loss)).lower(*given).compile()
        costs: Any = program.cost_analysis()
        return Form(lambda: program(*given), costs["flops"])

    return gradient(True), gradient(False)


def shared_tokens(seeds: int) -> tuple[Form, Form]:
    """An iteration of double DQN with context that makes the tokens of the windows at s' anew, and one that takes most
    of them from the windows at s."""
    from experiments.benchmarks.trainings import training
    from t2tl_jax.agents import td_learning
    from t2tl_jax.networks.windows import without_newest, without_oldest

    def anew(config: Any, network: Any, params: Any, steps: Any) -> tuple[Any, Any]:
        return without_newest(steps), without_oldest(steps)

    config = replace(training("waterworld_dqn:t2tl"), seeds=str(seeds))
    with patch.object(td_learning, "read_once", anew):
        before = _iteration(config)
    return before, _iteration(config)


def token_parts(seeds: int) -> tuple[Form, Form]:
    """An iteration of double DQN with context that puts what a token is made of side by side, and one that does not."""
    import jax.numpy as jnp
    from flax import linen as nn

    from experiments.benchmarks.trainings import training
    from t2tl_jax.networks import context

    class Concatenated(nn.Dense):
        def __call__(self, parts: Any) -> Any:
            size = jnp.broadcast_shapes(*(part.shape[:-1] for part in parts))
            return super().__call__(jnp.concatenate([jnp.broadcast_to(x, (*size, x.shape[-1])) for x in parts], -1))

    config = replace(training("waterworld_dqn:t2tl"), seeds=str(seeds))
    with patch.object(context, "DenseOfParts", Concatenated):
        before = _iteration(config)
    return before, _iteration(config)


def guard(text: str, seeds: int) -> tuple[Form, Form]:
    """An iteration that freezes seeds whose numbers are not finite, and one that does not: what that costs.

    Args:
        text: the training.
        seeds: how many.
    """
    from experiments.benchmarks.trainings import training
    from t2tl_jax.runs import experiment

    config = replace(training(text), seeds=str(seeds))
    with patch.object(experiment, "watched", lambda agent: agent):
        without = _iteration(config)
    return _iteration(config), without


def graphs(text: str, seeds: int) -> tuple[Form, Form]:
    """An iteration whose kernels the host starts one after another, and one as CUDA graphs; alike but on NVIDIA GPUs.

    Args:
        text: the training.
        seeds: how many.
    """
    from experiments.benchmarks.trainings import training
    from t2tl_jax.training import kept_trace, program

    config = replace(training(text), seeds=str(seeds))
    with patch.object(program, "compiler_options", dict), patch.object(kept_trace, "compiler_options", dict):
        before = _iteration(config)
    return before, _iteration(config)


def rows_last(text: str, seeds: int) -> tuple[Form, Form]:
    """An iteration whose physics has the rows of MJX's contacts before the batch, and one that has them as a run does:
    behind it, unless a GPU has a long batch.

    Args:
        text: the training.
        seeds: how many.
    """
    from envs.straight_line import layout
    from experiments.benchmarks.trainings import training

    config = replace(training(text), seeds=str(seeds))
    with patch.dict(layout.ROWS_LAST_UP_TO, dict.fromkeys(layout.ROWS_LAST_UP_TO, 0)):
        before = _iteration(config)
    return before, _iteration(config)


def cut_rows(text: str, seeds: int) -> tuple[Form, Form]:
    """An iteration that sums up the rows of MJX's contacts whole, and one that cuts them into parts first, as a run
    does where a GPU has a long batch.

    Args:
        text: the training.
        seeds: how many.
    """
    from envs.straight_line import layout
    from experiments.benchmarks.trainings import training

    config = replace(training(text), seeds=str(seeds))
    with patch.object(layout, "PARTS", 1):
        before = _iteration(config)
    return before, _iteration(config)


def few_kernels(text: str, seeds: int) -> tuple[Form, Form]:
    """An iteration that takes each array of a network by itself, for the norm of the gradient and for what a single
    number decides on, and one that does not.

    Args:
        text: the training.
        seeds: how many.
    """
    import optax

    from experiments.benchmarks.trainings import training
    from t2tl_jax.training import few_kernels as of_many

    config = replace(training(text), seeds=str(seeds))
    with patch.multiple(of_many, global_norm=optax.tree.norm, read_by_many=lambda number: number):
        before = _iteration(config)
    return before, _iteration(config)


def _iteration(config: Any) -> Form:
    import jax

    from experiments.benchmarks.operations import count
    from t2tl_jax.runs.compilation import Compilation
    from t2tl_jax.runs.experiment import build

    experiment = build(config)
    program = experiment.program
    compiled = Compilation(program, fresh=True).result()
    current = compiled.init(program.keys, program.env_params)

    def once() -> Any:
        nonlocal current
        current, metrics = compiled.iterate(current, program.env_params)
        return metrics

    given = experiment.task_env.make_params(experiment.seeds[0])
    first = jax.eval_shape(experiment.agent.init, jax.random.key(0), given)
    work = count(jax.make_jaxpr(experiment.agent.iterate)(first, given), lambda path: "")
    return Form(once, work[""].flop)


STEPS: dict[str, Callable[[], tuple[Form, Form]]] = {
    "segments": segments,
    "next_values": next_values,
    "next_state": next_state,
    "shared_tokens": partial(shared_tokens, 1),
    "token_parts": partial(token_parts, 1),
    "guard": partial(guard, "zone_ppo:t1tl:closed_form", 1),
    "rows_t1tl": partial(rows_last, "zone_ppo:t1tl", 1),
    "rows_t2tl": partial(rows_last, "zone_ppo:t2tl", 1),
    "kernels_t1tl": partial(few_kernels, "zone_ppo:t1tl", 1),
}
"""Both forms of each step, the slow one first."""

FOR_GPUS: dict[str, Callable[[], tuple[Form, Form]]] = {
    "shared_tokens_12": partial(shared_tokens, 12),
    "token_parts_12": partial(token_parts, 12),
    "guard_12": partial(guard, "zone_ppo:t1tl:closed_form", 12),
    "guard_mjx": partial(guard, "zone_ppo_long:t1tl", 12),
    "guard_t2tl": partial(guard, "zone_ppo_long:t2tl", 12),
    "guard_dqn": partial(guard, "waterworld_dqn:t1tl", 12),
    "rows_long": partial(rows_last, "zone_ppo_long:t1tl", 1),
    "rows_12": partial(rows_last, "zone_ppo:t1tl", 12),
    "kernels_closed_form": partial(few_kernels, "zone_ppo:t1tl:closed_form", 1),
    "kernels_t2tl": partial(few_kernels, "zone_ppo:t2tl", 1),
    "kernels_dqn": partial(few_kernels, "waterworld_dqn:t1tl", 1),
    "kernels_12": partial(few_kernels, "zone_ppo_long:t1tl", 12),
}
"""Likewise, of a size that takes long without a GPU; these are done only where they are named."""

ON_GPUS: dict[str, Callable[[], tuple[Form, Form]]] = {
    "graphs_t1tl": partial(graphs, "zone_ppo_long:t1tl", 12),
    "graphs_t2tl": partial(graphs, "zone_ppo_long:t2tl", 12),
    "graphs_closed_form": partial(graphs, "zone_ppo_long:t1tl:closed_form", 12),
    "graphs_dqn": partial(graphs, "waterworld_dqn:t1tl", 12),
    "cut_t1tl": partial(cut_rows, "zone_ppo_long:t1tl", 12),
    "cut_t2tl": partial(cut_rows, "zone_ppo_long:t2tl", 12),
    "cut_large": partial(cut_rows, "zone_ppo_long:t1tl:mjx:65536", 1),
}
"""Likewise; these are steps on NVIDIA GPUs alone."""

KNOWN = STEPS | FOR_GPUS | ON_GPUS
"""All of them."""


if __name__ == "__main__":
    sys.exit(main())
