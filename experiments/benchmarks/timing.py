"""One way to time a compiled program: a call that warms up, then several that count."""

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import jax


@dataclass(frozen=True)
class Rate:
    """How much a program does in a second."""

    median: float
    """Of the calls."""
    slowest: float
    """The slowest call's."""
    fastest: float
    """The fastest call's."""


def rate(call: Callable[[], Any], amount: float, repeats: int) -> Rate:
    """Time `repeats` calls after one that is not timed; each does `amount` of whatever is counted.

    What a call returns is waited for.
    """
    seconds = []
    for _ in range(repeats + 1):
        started = time.perf_counter()
        jax.block_until_ready(call())
        seconds.append(time.perf_counter() - started)
    rates = [amount / spent for spent in seconds[1:]]
    return Rate(statistics.median(rates), min(rates), max(rates))


@dataclass(frozen=True)
class Costs:
    """What a program costs by the compiler's account, and what making it took."""

    trace_s: float
    """Seconds of tracing."""
    compile_s: float
    """Seconds of compiling."""
    gigaflop: float | None
    """Arithmetic of one call, in 10^9 operations; None where the compiler does not say. Loops count with all of their
    rounds only as far as the compiler knows how many there are."""
    gigabytes: float | None
    """Bytes read and written in one call, in 10^9."""
    memory_mib: float | None
    """Memory that a call needs, its arguments included, in MiB."""


def compiled(trace: Callable[[], Any]) -> tuple[Any, Costs]:
    """Trace and compile what ``trace()``, a call of ``jit(f).lower``, gives; the program and what it costs."""
    started = time.perf_counter()
    lowered = trace()
    traced = time.perf_counter()
    program = lowered.compile()
    ended = time.perf_counter()
    analysis, memory = program.cost_analysis() or {}, program.memory_analysis()
    return program, Costs(
        trace_s=traced - started,
        compile_s=ended - traced,
        gigaflop=_billions(analysis.get("flops")),
        gigabytes=_billions(analysis.get("bytes accessed")),
        memory_mib=None if memory is None else _bytes_needed(memory) / 2**20,
    )


def _billions(value: float | None) -> float | None:
    return None if value is None or value < 0 else value / 1e9


def _bytes_needed(memory: Any) -> int:
    held = memory.argument_size_in_bytes + memory.output_size_in_bytes - memory.alias_size_in_bytes
    return held + memory.temp_size_in_bytes
