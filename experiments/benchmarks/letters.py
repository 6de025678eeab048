"""What many propositions cost: ``python -m experiments.benchmarks.letters --json FILE``.

With n propositions, every subset being a letter, there are 2^n letters. Tables of formulas over all of them are
compiled and looked up in: three goals, each of them a third of the propositions at once, which are five rows whatever n
is; and formulas with more to remember.
"""

import sys
import tracemalloc
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from experiments.benchmarks import json_file
from experiments.cli.errors import guarded
from t2tl_jax import checks
from t2tl_jax.errors import explained
from t2tl_jax.flags import parse

MOST = 31
"""Propositions that can hold at once, which are the bits of a letter."""


@dataclass(frozen=True)
class Arguments:
    """Compile one task over more and more propositions, and time its steps."""

    propositions: tuple[int, ...] = (10, 18, 20, 24)
    """How many; every subset of them is a letter."""
    batch: int = 65_536
    """Transitions looked up at a time, each with a letter of its own, all equally likely."""
    steps: int = 20
    """Batches in a call that is timed."""
    repeats: int = 9
    """Tables compiled and calls timed; the medians are reported."""
    json: Path | None = None
    """Also write the results to this file."""

    def __post_init__(self) -> None:
        checks.counts(self, "batch", "steps", "repeats")
        if not self.propositions or not 3 <= min(self.propositions) <= max(self.propositions) <= MOST:
            raise ValueError(f"propositions are one or more numbers from 3 to {MOST}, got {self.propositions}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0 done, 2 for input that cannot be used."""
    return guarded(lambda: _main(sys.argv[1:] if arguments is None else list(arguments)))


def _main(texts: list[str]) -> int:
    arguments = parse(Arguments, texts, prog="python -m experiments.benchmarks.letters", description=__doc__)
    json_file.check(arguments.json)
    found = []
    with explained():
        for shape in SHAPES:
            for count in arguments.propositions:
                found.append(measure(shape, count, arguments))
                print(found[-1], flush=True)
                json_file.store_so_far(arguments, "experiments.benchmarks.letters", texts, results=found)
    json_file.store(arguments, "experiments.benchmarks.letters", texts, results=found)
    return 0


def thirds(names: Sequence[str]) -> str:
    """``F(A & F(B & F C))``, where A, B and C are the conjunctions of every third name."""
    return chain([" & ".join(names[start::3]) for start in range(3)])


def chain(goals: Sequence[str]) -> str:
    """``F(a & F(b & ...))``."""
    text = f"F({goals[-1]})"
    for goal in reversed(goals[:-1]):
        text = f"F({goal} & {text})"
    return text


def pairs(names: Sequence[str]) -> str:
    """``F((a & m) | (b & n) | ...)``: each of the first half with one of the second, far apart in a letter."""
    half = len(names) // 2
    return f"F({' | '.join(f'({a} & {b})' for a, b in zip(names[:half], names[half:], strict=False))})"


SHAPES: Mapping[str, Callable[[Sequence[str]], str]] = {"thirds": thirds, "chain": chain, "pairs": pairs}
"""Formulas by their shape, of names."""


def measure(shape: str, count: int, arguments: Arguments) -> dict[str, Any]:
    """What one table takes to compile, and nanoseconds of a letter that is looked up in one row, and in all of them.

    Args:
        shape: of the formula, a name of `SHAPES`.
        count: of propositions.
        arguments: of the command.
    """
    import jax
    import jax.numpy as jnp

    from experiments.benchmarks.timing import rate
    from t2tl_jax.ltl import TaskTable, compile_tasks

    names = tuple(f"p{number}" for number in range(count))
    make = partial(compile_tasks, SHAPES[shape](names), names)
    compiling = rate(make, 1, arguments.repeats)
    table, peak = _peak(make)
    shape_of_letters = (arguments.steps, arguments.batch)
    letters = jax.random.randint(jax.random.key(count), shape_of_letters, 0, table.num_letters, jnp.int32)

    @jax.jit
    def one(table: TaskTable, letters: jax.Array) -> jax.Array:
        def step(rows: jax.Array, letter: jax.Array) -> tuple[jax.Array, jax.Array]:
            rows, reward = table.step(rows, letter)
            return jnp.where(table.is_open[rows], rows, table.initial_row[0]), reward.sum()

        return jax.lax.scan(step, jnp.full(arguments.batch, table.initial_row[0]), letters)[1]

    @jax.jit
    def every(table: TaskTable, letters: jax.Array) -> jax.Array:
        def step(total: jax.Array, letter: jax.Array) -> tuple[jax.Array, None]:
            rows, rewards = table.step_all(letter)
            return total + rows.sum() + rewards.sum(), None

        return jax.lax.scan(step, jnp.float32(0), letters)[0]

    found: dict[str, Any] = {
        "shape": shape,
        "propositions": count,
        "rows": table.num_rows,
        "parts": len(table.branches),
        "compile_s": {"median": 1 / compiling.median, "slowest": 1 / compiling.slowest},
        "peak_mib": peak / 2**20,
        "table_mib": sum(array.nbytes for array in jax.tree.leaves(table)) / 2**20,
    }
    for name, call in {"step": one, "step_all": every}.items():
        speed = rate(partial(call, table, letters), letters.size, arguments.repeats)
        ends = {"median": speed.median, "fastest": speed.fastest, "slowest": speed.slowest}
        found[f"{name}_ns"] = {of: 1e9 / each for of, each in ends.items()}
    return found


def _peak(make: Callable[[], Any]) -> tuple[Any, int]:
    """What it makes, and the most bytes of Python's and NumPy's that it held meanwhile."""
    tracemalloc.start()
    made = make()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return made, peak


if __name__ == "__main__":
    sys.exit(main())
