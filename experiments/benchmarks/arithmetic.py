"""What a program computes, by the compiler's account: ``python -m experiments.benchmarks.arithmetic --json FILE``.

A substep of ZoneEnv's physics as MJX has it and written out in a straight line, and a gradient step of PPO by sample.
Counts do not depend on the machine; seconds do, and are this one's processor time, whatever else it does.
"""

import re
import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

from experiments.benchmarks import json_file
from experiments.cli.errors import guarded
from t2tl_jax import checks
from t2tl_jax.errors import explained
from t2tl_jax.flags import parse
from t2tl_jax.quiet import quiet_imports

OBSERVATION, ACTIONS, CODE, SAMPLES = 76, 2, 16, 512
"""Sizes of ZoneEnv's observation, action and code, and how many samples are counted together."""


@dataclass(frozen=True)
class Arguments:
    """Count what a substep of MJX and a gradient step of PPO compute."""

    num_envs: int = 1024
    """Robots whose substeps are timed together."""
    substeps: int = 200
    """Substeps of one timed call."""
    repeats: int = 5
    """Timed calls; their median is reported."""
    json: Path | None = None
    """Also write the results to this file."""

    def __post_init__(self) -> None:
        checks.counts(self, "num_envs", "substeps", "repeats")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0 done, 2 for input that cannot be used."""
    return guarded(lambda: _main(sys.argv[1:] if arguments is None else list(arguments)))


def _main(texts: list[str]) -> int:
    arguments = parse(Arguments, texts, prog="python -m experiments.benchmarks.arithmetic", description=__doc__)
    json_file.check(arguments.json)
    with quiet_imports():
        import jax

        from envs.straight_line import layout, straight_line
        from envs.zones.point_mjx import MjxPoint
    plain = jax.jit(MjxPoint().mujoco_substep)  # traced once for all that follows
    number = jax.ShapeDtypeStruct((), jax.numpy.float32)
    straight = straight_line(plain, *[number] * 8)
    with explained():
        forms = {"MJX as it is": substep(plain, arguments), "in a straight line": substep(straight, arguments)}
        with patch.dict(layout.ROWS_LAST_UP_TO, dict.fromkeys(layout.ROWS_LAST_UP_TO, 0)):
            forms["the same, rows before the batch"] = substep(straight, arguments)
        found = {"substep": forms, "gradient_step": gradient_steps()}
    for part, rows in found.items():
        for name, row in rows.items():
            print(f"{part}, {name}: {row}")
    json_file.store(arguments, "experiments.benchmarks.arithmetic", texts, **found)
    return 0


def substep(form: Callable[..., Any], arguments: Arguments) -> dict[str, float]:
    """Operations of one robot's substep as they are traced and as they are compiled, and what they take here."""
    import jax
    import jax.numpy as jnp
    import numpy as np

    number = jax.ShapeDtypeStruct((), jnp.float32)
    traced = _operations(jax.make_jaxpr(form)(*[number] * 8).jaxpr)
    given = jnp.asarray(np.random.default_rng(0).uniform(-1, 1, (8, arguments.num_envs)), jnp.float32)

    def many(given: jax.Array) -> jax.Array:
        def one(motion: jax.Array, _: None) -> tuple[jax.Array, None]:
            after = jax.vmap(form)(*motion, *given[6:])
            return jnp.stack(after[:6]), None

        return jax.lax.scan(one, given[:6], None, arguments.substeps)[0]

    begin = time.process_time()
    single = jax.jit(jax.vmap(form)).lower(*given).compile()
    compiled = time.process_time() - begin
    costs, text = single.cost_analysis() or {}, single.as_text() or ""
    program = jax.jit(many).lower(given).compile()
    seconds = []
    for _ in range(1 + arguments.repeats):  # the first one warms up
        begin = time.process_time()
        jax.block_until_ready(program(given))
        seconds.append(time.process_time() - begin)
    per_substep = float(np.median(seconds[1:])) / arguments.num_envs / arguments.substeps
    return {
        "traced": sum(traced.values()),
        "gathers": traced["gather"] + traced["dynamic_slice"],
        "scatters": sum(count for name, count in traced.items() if name.startswith("scatter")),
        "products": traced["dot_general"],
        "factorisations": traced["cholesky"] + traced["triangular_solve"],
        "fused_loops": len(re.findall(r" fusion\(", text)),
        "kilobytes": costs.get("bytes accessed", float("nan")) / arguments.num_envs / 1e3,
        "kiloflop": costs.get("flops", float("nan")) / arguments.num_envs / 1e3,
        "compile_s": compiled,
        "microseconds": 1e6 * per_substep,
    }


def gradient_steps() -> dict[str, dict[str, float]]:
    """kFLOP of a gradient step of PPO by sample, for T1TL and for T2TL with segments of several lengths."""
    from t2tl_jax.networks.context_config import ContextConfig

    contexts = {"T1TL": None, "T2TL, segments of 8 steps (the default)": ContextConfig()}
    contexts |= {f"T2TL, segments of {n} step{'s' * (n > 1)}": ContextConfig(segment_length=n) for n in (64, 1)}
    return {name: {"kiloflop": gradient_of_ppo(context) / 1e3} for name, context in contexts.items()}


def gradient_of_ppo(context: Any) -> float:
    """FLOP of a gradient step in ZoneEnv by sample; the task's code comes from outside. Nothing is compiled for it."""
    import jax
    import jax.numpy as jnp

    from t2tl_jax.agents.ppo_config import PPOConfig
    from t2tl_jax.agents.ppo_learning import Batch, ppo_loss
    from t2tl_jax.ltl import compile_tasks
    from t2tl_jax.networks.actor_critic import ActorCritic, NetworkConfig
    from t2tl_jax.networks.windows import Segment
    from t2tl_jax.training.types import repeated

    network, table = ActorCritic(NetworkConfig(context=context), ACTIONS), compile_tasks(["F a"], ("a",))
    steps = 1 if context is None else context.segment_length
    count = SAMPLES // steps

    def of(*shape: int, dtype: Any = jnp.float32) -> Any:  # stands for an array
        return jax.ShapeDtypeStruct((count, steps, *shape), dtype)

    def initial() -> tuple[Any, Any]:
        carry = repeated(network.begin(OBSERVATION), count)
        obs, row = jnp.zeros((count, OBSERVATION)), jnp.zeros(count, int)
        return carry, network.init(jax.random.key(0), table, obs, row, carry, method="initialise")

    start, params = jax.eval_shape(initial)
    segment: Any = () if context is None else Segment(start, of(ACTIONS), of(), of(dtype=bool), None)
    batch = Batch(of(OBSERVATION), of(dtype=jnp.int32), of(ACTIONS), of(), of(), of(), segment)

    def loss(params: Any, task: Any, batch: Any) -> Any:
        return ppo_loss(PPOConfig(), network, params, task, batch)[0]

    lowered = jax.jit(jax.grad(loss, argnums=(0, 1))).lower(params, of(CODE), batch)
    return float((lowered.cost_analysis() or {})["flops"]) / SAMPLES


def _operations(jaxpr: Any) -> Counter[str]:
    """How many there are of each by name, those inside of loops and calls included, once each."""
    import jax

    found: Counter[str] = Counter()
    for equation in jaxpr.eqns:
        inner = jax.tree.leaves(equation.params, is_leaf=lambda x: hasattr(x, "jaxpr"))
        parts = [part.jaxpr for part in inner if hasattr(part, "jaxpr")]
        found[equation.primitive.name] += not parts
        for part in parts:
            found += _operations(part)
    return found


if __name__ == "__main__":
    sys.exit(main())
