"""Which token trained agents cannot do without: ``python -m experiments.benchmarks.removal RUN [RUN ...]``.

Every sub-task of the run's task is read without each of its tokens in turn, at steps that the agent itself meets. That
needs no attention, so that the graph network is read as the Transformer is. Of a stored run there is one seed.
"""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import tyro

from experiments.benchmarks import json_file
from experiments.cli.errors import guarded
from t2tl_jax import checks
from t2tl_jax.errors import UserError, explained
from t2tl_jax.flags import parse
from t2tl_jax.quiet import quiet_imports


@dataclass(frozen=True)
class Arguments:
    """Take the tokens of a task away, one at a time, and say without which one the policy moves most: the final
    parameters of the first seed of each run."""  # fmt: skip

    runs: tyro.conf.Positional[tuple[Path, ...]]
    """Folders of runs that read formulas."""
    episodes: int = 256
    """Episodes that are played for each sub-task, of each of which one step in that sub-task is used."""
    json: Path | None = None
    """Also write the results to this file."""

    def __post_init__(self) -> None:
        checks.counts(self, "episodes")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0 done, 2 for input that cannot be used."""
    return guarded(lambda: _main(sys.argv[1:] if arguments is None else list(arguments)))


def _main(texts: list[str]) -> int:
    words = ["python", "-m", "experiments.benchmarks.removal", *texts]
    arguments = parse(Arguments, texts, "python -m experiments.benchmarks.removal", Arguments.__doc__)
    if not arguments.runs:
        raise UserError("name at least one run folder")
    json_file.check(arguments.json)
    with explained():
        content = {"episodes": arguments.episodes, "agents": [read(run, arguments.episodes) for run in arguments.runs]}
    print(table(content))
    if arguments.json is not None:
        json_file.write(arguments.json, {"where": json_file.where(words), **content})
    return 0


def read(run: Path, episodes: int) -> dict[str, Any]:
    """One agent: ``sub_tasks`` holds, by sub-task, its tokens and what the policy does without each of them.

    `policy` is the mean change of the policy, in the unit of ``Agent.compare``; `most` counts the steps at which it
    moves most without this token, at each step one of them, and none where nothing changes; `most_named` likewise, if
    only propositions are taken away.
    """
    with quiet_imports():
        from functools import partial

        import jax
        import numpy as np

        import experiments.configs  # noqa: F401, registers what runs are made of
        from t2tl_jax import load
        from t2tl_jax.evaluation import attention
        from t2tl_jax.ltl.tokens import token_names
        from t2tl_jax.networks.task_encoders import make_task_encoder
        from t2tl_jax.runs.policy import seed_slice
        from t2tl_jax.training.seeds import EVALUATION, stream_keys

    result = load(run)
    kind = result.config.learner.task_encoder
    if kind is None or not kind.reads_tokens:
        raise UserError(f"{run} encodes its task by {type(kind).__name__}, which reads no tokens: nothing to take away")
    experiment = result.experiment
    if experiment.agent.compare is None:
        raise UserError(f"{run} has a learner that cannot compare the decisions that two codes of a task lead to")
    env, agent, params = experiment.task_env, experiment.agent, seed_slice(result.params_of("final"), 0)
    given = experiment.env_params("evaluation")
    given = replace(given, env=seed_slice(given.env, 0))
    key = stream_keys(result.seeds[:1], EVALUATION)[0]
    play = jax.jit(partial(attention.meet, env, agent), static_argnums=(4, 5))
    compare = jax.jit(experiment.agent.compare)
    encoder, own, sub_tasks = make_task_encoder(kind), params["params"]["task_encoder"], []
    whole, opened = int(env.table.initial_row[0]), np.flatnonzero(np.asarray(env.table.is_open)).tolist()
    for row in (whole, *(other for other in opened if other != whole)):
        met = play(params, given, key, row, episodes, result.config.episode_length)
        codes = attention.codes_without_tokens(encoder, own, env.table, row)
        effect = attention.removal_effects(agent, params, codes, met)
        reached = np.flatnonzero(np.asarray(met.steps) > 0) if effect.met else np.arange(episodes)
        carry, obs = jax.tree.map(lambda x, at=reached: x[at], (met.carry, met.obs))
        moved = np.stack([compare(params, carry, obs, codes[0], code)[0] for code in codes[1:]])
        tokens = token_names(env.table.tokens[row][env.table.mask[row]].tolist(), env.table.propositions)
        names_it = np.array([token in env.table.propositions for token in tokens])
        sub_tasks.append(
            {
                "formula": env.table.text(row),
                "tokens": tokens,
                "steps": effect.observations,
                "met": effect.met,
                "policy": effect.policy.tolist(),
                "most": counts(moved),
                "most_named": counts(np.where(names_it[:, None], moved, 0.0)),
            }
        )
    return {
        "run": str(run),
        "encoder": type(kind).__name__,
        "task": str(result.config.task),
        "seed": result.seeds[0],
        "iteration": result.iteration,
        "episode_length": result.config.episode_length,
        "sub_tasks": sub_tasks,
    }


def counts(moved: Any) -> list[int]:
    """At how many steps the policy moves most without each token, the first of equals; of float[tokens, steps]."""
    import numpy as np

    first = moved.argmax(axis=0)[moved.max(axis=0) > 0]
    return [int(count) for count in np.bincount(first, minlength=len(moved))]


def table(content: Mapping[str, Any]) -> str:
    """Markdown, a line for each agent and sub-task: the token that is needed most often and the proposition that is."""
    needed = ("moves most without", "at so many steps", "by")
    heading = ("agent", "sub-task", *needed, "of the propositions", *needed[1:])
    lines = ["| " + " | ".join(heading) + " |", "|" + "---|" * len(heading)]
    for agent in content["agents"]:
        for sub_task in agent["sub_tasks"]:
            name, formula = Path(agent["run"]).name, sub_task["formula"].replace("|", "\\|")
            cells = (*_needed(sub_task, "most"), *_needed(sub_task, "most_named"))
            lines.append("| " + " | ".join((name, f"`{formula}`", *cells)) + " |")
    return "\n".join(lines)


def _needed(sub_task: Mapping[str, Any], counted: str) -> tuple[str, str, str]:
    """The token that is counted most often, with its position; at which share of the steps; and the mean change."""
    from t2tl_jax.evaluation.statistics import rate

    most = sub_task[counted]
    at = max(range(len(most)), key=most.__getitem__)
    if not most[at]:
        return "-", "-", "-"
    share = rate(most[at], sub_task["steps"]).text(2)
    return f"{at}: {sub_task['tokens'][at]}", f"{share} of {sub_task['steps']}", f"{sub_task['policy'][at]:.2g}"


if __name__ == "__main__":
    sys.exit(main())
