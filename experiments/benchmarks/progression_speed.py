"""How fast formulas progress: random labels for a batch of rows, one step after another."""

import jax
import jax.numpy as jnp

from experiments.benchmarks.timing import Costs, Rate, compiled, rate
from t2tl_jax.ltl import TaskTable


def measure(table: TaskTable, batch: int, steps: int, repeats: int) -> tuple[Rate, Costs]:
    """Progressions/s of `batch` rows at a time, all rewards summed; what is decided begins anew."""

    def run(table: TaskTable, rows: jax.Array, key: jax.Array) -> tuple[jax.Array, jax.Array]:
        def step(rows: jax.Array, key: jax.Array) -> tuple[jax.Array, jax.Array]:
            labels = jax.random.bernoulli(key, 0.2, (batch, len(table.propositions)))
            rows, reward = table.step(rows, table.letter(labels))
            return jnp.where(table.is_open[rows], rows, table.initial_row[0]), reward.sum()

        rows, rewards = jax.lax.scan(step, rows, jax.random.split(key, steps))
        return rows, rewards.sum()

    rows = jnp.full(batch, table.initial_row[0])
    program, costs = compiled(lambda: jax.jit(run).lower(table, rows, jax.random.key(0)))
    return rate(lambda: program(table, rows, jax.random.key(0)), batch * steps, repeats), costs
