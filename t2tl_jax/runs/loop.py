"""The host side of training: dispatch, record, save, stop. Everything else happens inside the compiled program."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import jax

from t2tl_jax.training import hosts
from t2tl_jax.training.devices import fetched
from t2tl_jax.training.types import Metrics

MOST = 0.05
"""Share of the time that training may stand still for checkpoints, but for the last one."""


@dataclass(frozen=True)
class Hooks:
    """What the loop calls; all with iterations counted from 1."""

    after: Callable[[int, Any], None]
    """``(iteration, train state)``, once behind every iteration, before it is recorded."""
    record: Callable[[int, Metrics], None]
    """``(iteration, metrics on the host)``, once for every iteration, in order."""
    save: Callable[[int, Any], None]
    """``(iteration, train state)``; everything up to this iteration has been recorded. The last one comes once the loop
    has ended."""
    stop: Callable[[], bool]
    """Whether to finish early."""
    prepare: Callable[[int, Any], tuple[Any, Any]]
    """``(iterations behind us, train state)`` to the state that the next iteration starts from, and the environments'
    parameters that it takes."""


def run_loop(
    iterate: Callable[[Any, Any], tuple[Any, Metrics]],
    train_state: Any,
    done: int,
    total: int,
    checkpoint_period: float,
    hooks: Hooks,
) -> tuple[int, Any]:
    """Iterate from ``done`` to ``total`` iterations, or until asked to stop, and save at the end in both cases.

    On accelerators the next iteration is dispatched before the metrics of the last one are fetched, so that the device
    never waits for the host. A CPU gains nothing from that, and would take an iteration longer to stop.

    Args:
        iterate: the compiled program; it may reuse the memory of the state it is given.
        train_state: after ``done`` iterations.
        done: iterations behind us.
        total: iterations in all.
        checkpoint_period: seconds between checkpoints, at least; more where they would take over 5 % of the time. 0 is
            one after every iteration.
        hooks: see there.

    Returns:
        The iteration reached and its state.
    """
    ahead = jax.default_backend() != "cpu"
    pending: tuple[int, Metrics] | None = None
    saved_at, saved_iteration, wait = time.monotonic(), done, checkpoint_period
    iteration, stopping = done, hooks.stop()
    while iteration < total and not stopping:
        train_state, metrics = iterate(*hooks.prepare(iteration, train_state))
        iteration += 1
        hooks.after(iteration, train_state)
        if pending is not None:
            _record(pending, hooks)
        pending = (iteration, metrics)
        due = hosts.any_of(time.monotonic() - saved_at >= wait)
        if due or not ahead:
            _record(pending, hooks)
            pending = None
        stopping = hooks.stop()
        if due and iteration < total and not stopping:
            begin = time.monotonic()
            hooks.save(iteration, train_state)
            saved_at, saved_iteration = time.monotonic(), iteration
            wait = checkpoint_period and max(checkpoint_period, (saved_at - begin) / MOST)
    if pending is not None:
        _record(pending, hooks)
    if iteration > saved_iteration:
        hooks.save(iteration, train_state)
    return iteration, train_state


def _record(pending: tuple[int, Metrics], hooks: Hooks) -> None:
    iteration, metrics = pending
    hooks.record(iteration, fetched(metrics))  # waits for the device
