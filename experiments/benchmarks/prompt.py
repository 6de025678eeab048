"""How long a formula that is typed waits for its first action: ``python -m experiments.benchmarks.prompt RUN...``.

Formulas are drawn from the family that the agent was trained on. Those by which a program had to compile, since none
before was as large, are the warming up, and are not counted.
"""

import dataclasses
import os
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import tyro

from experiments.benchmarks import json_file
from experiments.cli.errors import guarded
from t2tl_jax import checks
from t2tl_jax.errors import UserError
from t2tl_jax.flags import parse
from t2tl_jax.quiet import quiet_imports

LENGTH = 8
"""Steps of the episodes that follow a first action, and are not timed."""

QUANTILES = (0.5, 0.95, 1.0)

AIM = 5.0
"""Milliseconds from a text to the first action, once warmed up: how many formulas take longer is counted."""


@dataclasses.dataclass(frozen=True)
class Arguments:
    """Time formulas from their text to the table and to the first action, with the first seed's final parameters."""

    runs: tyro.conf.Positional[tuple[Path, ...]]
    """Folders of runs."""
    formulas: int = 200
    """Drawn for each run."""
    json: Path | None = None
    """Also write the results to this file."""

    def __post_init__(self) -> None:
        checks.counts(self, "formulas")
        if not self.runs:
            raise ValueError("give one run or more, such as results/any/any-zones")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0 done, 2 for input that cannot be used."""
    return guarded(lambda: _main(sys.argv[1:] if arguments is None else list(arguments)))


def _main(texts: list[str]) -> int:
    words = ["python", "-m", "experiments.benchmarks.prompt", *texts]
    arguments = parse(Arguments, texts, "python -m experiments.benchmarks.prompt", __doc__)
    json_file.check(arguments.json)
    found, load = {}, [os.getloadavg()[0]]  # with much other work beside it, a formula waits for that, too
    for run in arguments.runs:
        found[str(run)] = measure(run, arguments.formulas)
        print(run, found[str(run)], flush=True)
    if arguments.json is not None:
        from t2tl_jax.runs import provenance

        content = {
            "where": provenance.describe(words),
            "settings": {"formulas": arguments.formulas, "episode_length": LENGTH, "aim_ms": AIM},
            "load": [round(one, 2) for one in (*load, os.getloadavg()[0])],  # before and after, of a minute
            "results": found,
        }
        json_file.write(arguments.json, content)
        print(f"written: {arguments.json}")
    return 0


def measure(run: Path, formulas: int) -> dict[str, Any]:
    """Milliseconds of one run: how many formulas were drawn and counted, quantiles of both times, and how many first
    actions came later than was aimed at."""
    with quiet_imports():
        import experiments.configs  # noqa: F401, registers what runs are made of
        from t2tl_jax import load
        from t2tl_jax.ltl import make_sampler
        from t2tl_jax.runs.prompt import Prompt

    result = load(run)
    draw, rng = make_sampler(result.config.task, result.experiment.env.propositions), Random(0)
    prompt = Prompt(result, episode_length=LENGTH)
    played: list[Any] = []
    while len(played) < formulas:
        with suppress(UserError):  # no episode can satisfy it, or it is larger than what the network reads
            played.append(prompt.play(str(draw(rng))))
    counted = [one for one in played if not one.is_new_shape]
    times: Mapping[str, list[float]] = {
        "compile_ms": [one.compile_ms for one in counted],
        "action_ms": [one.action_ms for one in counted],
    }
    quantiles = {name: np.quantile(values, QUANTILES).round(3).tolist() for name, values in times.items() if values}
    late = sum(value >= AIM for value in times["action_ms"])
    return {"drawn": formulas, "counted": len(counted), "late": late, "quantiles": list(QUANTILES), **quantiles}


if __name__ == "__main__":
    sys.exit(main())
