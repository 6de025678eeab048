"""What a plan is worth to an agent: ``python -m experiments.benchmarks.plans RUN``.

The same parameters play the same formulas from the same starts, once as the policy is and once with ``--plan critic``.
Of `TRAPS` the way that is shortest in letters is closed on some maps: the goal stands where it can only be reached
across what is to be avoided. The other formulas are open on every map.
"""

import dataclasses
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import tyro

from experiments.benchmarks import json_file
from experiments.cli.errors import guarded
from t2tl_jax import checks
from t2tl_jax.flags import parse
from t2tl_jax.quiet import quiet_imports

TRAPS = (
    "(!(b|c|d|e|f|g|h) U a)|F(i & F j)",
    "(!(b|c|d|e|f|g|h|i|j|k) U a)|F(b & F(c & F d))",
)
"""Of LetterWorld: reach a past seven letters or ten, or go another way that is two letters or three."""

OPEN = ("F a|F(b & F c)", "F(a & F b)|F(c & F d)", "letters_1", "letters_2", "letters_3", "letters_4", "letters_5")

PLANS = ("none", "critic")


@dataclasses.dataclass(frozen=True)
class Arguments:
    """Play formulas with and without a plan, with the final parameters of a run in LetterWorld."""

    run: tyro.conf.Positional[Path]
    """Folder of the run."""
    episodes: int = 1000
    """Per seed, policy and formula."""
    json: Path | None = None
    """Also write the results to this file."""

    def __post_init__(self) -> None:
        checks.counts(self, "episodes")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0 done, 2 for input that cannot be used."""
    return guarded(lambda: _main(sys.argv[1:] if arguments is None else list(arguments)))


def _main(texts: list[str]) -> int:
    words = ["python", "-m", "experiments.benchmarks.plans", *texts]
    arguments = parse(Arguments, texts, "python -m experiments.benchmarks.plans", Arguments.__doc__)
    json_file.check(arguments.json)
    content = measure(arguments)
    print(table(content))
    if arguments.json is not None:
        json_file.write(arguments.json, {"where": json_file.where(words), **content})
    return 0


def measure(arguments: Arguments, formulas: Sequence[str] = (*TRAPS, *OPEN)) -> dict[str, Any]:
    """Play all formulas: ``tasks``, by formula, plan and policy, holds counts and means over the episodes of a seed."""
    with quiet_imports():
        from t2tl_jax import load

    found: dict[str, Any] = {formula: {} for formula in formulas}
    for plan in PLANS:
        result = load(arguments.run, plan=plan)
        for formula, reports in result.evaluate(tasks=formulas, episodes=arguments.episodes).items():
            found[formula][plan] = {policy: [_counts(seed) for seed in of.seeds] for policy, of in reports.items()}
    return {
        "run": str(arguments.run),
        "seeds": list(result.seeds),
        "episodes": arguments.episodes,
        "episode_length": result.config.episode_length,
        "tasks": found,
    }


def _counts(seed: Any) -> dict[str, Any]:
    return {
        "episodes": seed.success_rate.count,
        "successes": round(seed.success_rate.value * seed.success_rate.count),
        "steps": seed.success_length.value,
        "discounted_return": seed.discounted_return.value,
    }


def table(content: Mapping[str, Any]) -> str:
    """Markdown, a line for each formula: success and steps without and with a plan."""
    from t2tl_jax.evaluation.statistics import mean, mean_rate, rate

    def cell(made: Sequence[Mapping[str, Any]]) -> str:
        rates = [one["successes"] / one["episodes"] for one in made]
        success = mean_rate(rates) if made[1:] else rate(made[0]["successes"], made[0]["episodes"])
        steps = mean([one["steps"] for one in made if one["successes"]])
        return f"{success.text()}, {'-' if steps.value is None else format(steps.value, '.1f')}"

    columns = [(policy, plan) for policy in ("deterministic", "sampled") for plan in PLANS]
    named = {"none": "", "critic": ", plan"}
    lines = [["formula", *(f"{policy}{named[plan]}" for policy, plan in columns)], ["---"] * 5]
    for formula, made in content["tasks"].items():
        shown = formula.replace("|", "\\|")
        lines.append([f"`{shown}`", *(cell(made[plan][policy]) for policy, plan in columns)])
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


if __name__ == "__main__":
    sys.exit(main())
