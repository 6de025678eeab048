"""Read a trained agent: ``python -m experiments.attention RUN``; which words of its task it attends to and needs."""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import tyro

from experiments.cli.errors import guarded
from experiments.cli.plugins import import_modules
from t2tl_jax.errors import UserError, explained
from t2tl_jax.flags import check_picture, parse
from t2tl_jax.quiet import quiet_imports


@dataclass(frozen=True)
class Arguments:
    """Draw the attention that every token of a formula receives at the start and at the end of training, and what the
    decisions lose without it; store the numbers beside the picture, and print them. An encoder without attention is
    read by the latter alone. A second picture shows the out-projection weights of the attention layers at both times,
    and their change."""  # fmt: skip

    run: tyro.conf.Positional[Path]
    """Folder of the run."""
    task: str | None = None
    """Another formula over the same propositions; the run's own by default."""
    row: int | None = None
    """A sub-task instead of the whole task: its row in the table that python -m t2tl_jax.ltl shows."""
    seed: int | None = None
    """Which of the run's seeds; the first one by default."""
    all_seeds: bool = False
    """Also read every seed at the start and at the end of training, in every sub-task: token*, the token that the
    policy needs, whether they agree, and what is entered first; as a table (.csv) and summed up (.json)."""
    which: Literal["final", "best"] = "final"
    """The parameters at the end of training, or those that did best in episodes played to choose between them."""
    layers: tuple[int, ...] = ()
    """Layers, from 0, whose weights are averaged; all by default."""
    queries: Literal["all", "root"] = "all"
    """Whose attention: the mean over all tokens, or that of the formula's first one."""
    episodes: int = 256
    """Episodes that are played to meet observations, of each of which one is used."""
    output: Path | None = None
    """Picture to write, attention.png in the run by default; the numbers go beside it as .json."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command (``arguments`` of the command line by default) and return its exit code: 0 done, 2 bad input."""
    return guarded(lambda: _main(sys.argv[1:] if arguments is None else list(arguments)))


def _main(texts: list[str]) -> int:
    arguments = parse(
        Arguments, import_modules(texts), prog="python -m experiments.attention", description=Arguments.__doc__
    )
    if arguments.episodes < 1:
        raise UserError(f"--episodes must be at least 1, got {arguments.episodes}")
    check_picture("--output", arguments.output)
    try:
        with explained():
            _read(arguments)
    except OSError as error:
        raise UserError(f"cannot write: {error}") from error
    return 0


def _read(arguments: Arguments) -> None:
    with quiet_imports():
        import experiments.configs  # noqa: F401, registers what runs are made of
        from experiments.cli import compilation_cache
        from t2tl_jax.agents.ppo_config import PPOConfig
        from t2tl_jax.evaluation.attention_figure import plot_attention
        from t2tl_jax.evaluation.attention_seeds import Reader
        from t2tl_jax.ltl.tokens import token_names
        from t2tl_jax.networks.task_encoders import make_task_encoder
        from t2tl_jax.runs import folder as run_folder
        from t2tl_jax.runs import train
        from t2tl_jax.runs.policy import seed_slice
        from t2tl_jax.runs.start import start_params
        from t2tl_jax.training.seeds import EVALUATION, stream_keys

    folder, config = run_folder.open_existing(arguments.run)
    kind = config.learner.task_encoder
    if kind is None or not kind.reads_tokens:
        raise UserError(_no_tokens(kind))
    compilation_cache.use(config.run.compilation_cache)
    changes: dict[str, Any] = {} if arguments.task is None else {"task": arguments.task}
    result = train.load(arguments.run, **changes)
    index = result.index(arguments.seed)
    seed, experiment, config = result.seeds[index], result.experiment, result.config
    if experiment.pools is not None:
        raise UserError(
            f"{config.task} is a family of random tasks: choose the one to read, such as --task 'F(a & F b)'"
        )
    table = experiment.table
    row = _row(arguments.row, table)
    env_params = experiment.env_params("evaluation")
    env_params_of = [replace(env_params, env=seed_slice(env_params.env, k)) for k in range(len(result.seeds))]

    end = result.params_of(arguments.which)
    begun = start_params(result)
    if begun.problem:
        print(f"note: the start is drawn for a new network, since its pre-trained encoder is missing: {begun.problem}")
    reader = Reader(
        experiment.task_env,
        experiment.agent,
        make_task_encoder(kind),
        arguments.episodes,
        config.episode_length,
        arguments.layers or None,
        arguments.queries,
    )
    before, after = (reader.attention(seed_slice(params, index), row) for params in (begun.params, end))
    keys = stream_keys(result.seeds, EVALUATION)
    removal = reader.removal(seed_slice(end, index), env_params_of[index], keys[index], row)

    continuous = isinstance(config.learner, PPOConfig)
    unit = "KL divergence (nats)" if continuous else "share of greedy actions that change"
    stages = {
        "start": f"start of training ({begun.origin})",
        "end": f"{arguments.which}, iteration {result.iteration:,}",
    }
    what = {
        "task": str(config.task),
        "row": row,
        "formula": table.text(row),
        "seed": seed,
        "checkpoint": arguments.which,
        "iteration": result.iteration,
        **stages,
        "layers": list(arguments.layers) or "all",
        "queries": arguments.queries,
        "policy_change": unit,
        "observations": removal.observations,
        "observations_met_in_row": removal.met,
    }
    tokens = token_names(table.tokens[row][table.mask[row]].tolist(), table.propositions)
    print(_table(tokens, before, after, removal, unit))
    target = arguments.output or folder.path / "attention.png"
    title = f"{table.text(row)} ({folder.path}, seed {seed})"
    drawn = [(stages[name], one) for name, one in (("start", before), ("end", after)) if one is not None]
    plot_attention(target, title, tokens, drawn, removal, unit)
    numbers = what | _numbers(tokens, before, after, removal)
    print(f"drawn: {target}")
    if before is not None:
        start = seed_slice(begun.params, index)
        _draw_projections(target, title, (stages["start"], start), (stages["end"], seed_slice(end, index)))
    if arguments.all_seeds:
        stages_of_params = {"start": begun.params, "end": end}
        numbers["over_seeds"] = _all_seeds(reader, result.seeds, stages_of_params, env_params_of, keys, row, target)
        if before is not None:
            numbers["out_projection_change"] = _projection_changes(result.seeds, begun.params, end)
    run_folder.write_json(target.with_suffix(".json"), numbers)
    print(f"stored: {target.with_suffix('.json')}")


def _draw_projections(target: Path, title: str, start: tuple[str, Any], end: tuple[str, Any]) -> None:
    """The weights behind the attention, in files beside its picture; `start` and `end` are names and parameters."""
    import numpy as np

    from t2tl_jax.evaluation.projections import Projections, out_projections, plot_projections

    weights = Projections(*(out_projections(params["params"]["task_encoder"]) for _, params in (start, end)))
    picture = target.with_name(f"{target.stem}_projections.png")
    plot_projections(picture, f"out-projection weights: {title}", (start[0], end[0]), weights)
    change = weights.relative_change
    np.savez(picture.with_suffix(".npz"), start=weights.start, end=weights.end, relative_change=change)
    print(
        f"change of the out-projections, by layer: {', '.join(f'{x:.3f}' for x in change.mean(axis=1))} of their size"
    )
    print(f"drawn: {picture}\nstored: {picture.with_suffix('.npz')}")


def _projection_changes(seeds: Sequence[int], start: Any, end: Any) -> dict[str, Any]:
    """How far the out-projections of each seed's layers moved, over their size at the start, as means over heads."""
    from t2tl_jax.evaluation.projections import Projections, out_projections
    from t2tl_jax.runs.policy import seed_slice

    by_layer = []
    for k in range(len(seeds)):
        weights = (out_projections(seed_slice(params, k)["params"]["task_encoder"]) for params in (start, end))
        by_layer.append(Projections(*weights).relative_change.mean(axis=1).tolist())
    return {"seeds": list(seeds), "by_layer": by_layer}


def _all_seeds(
    reader: Any,
    seeds: Sequence[int],
    stages: Mapping[str, Any],
    env_params: Sequence[Any],
    keys: Any,
    row: int,
    target: Path,
) -> dict[str, Any]:
    """Read every seed at both stages in every sub-task, print the table, store it as CSV, and return the summary."""
    from t2tl_jax.evaluation import attention_seeds
    from t2tl_jax.runs.policy import seed_slice

    table = reader.env.table
    rows = [row, *(other for other in range(2, table.num_rows) if other != row)]
    readings = [
        found
        for stage, params in stages.items()
        for k, seed in enumerate(seeds)
        for found in reader.read(seed, stage, seed_slice(params, k), env_params[k], keys[k], rows)
    ]
    print(attention_seeds.table(readings))
    attention_seeds.write_csv(target.with_suffix(".csv"), readings)
    print(f"stored: {target.with_suffix('.csv')}")
    return attention_seeds.summarise(readings)


def _no_tokens(kind: Any) -> str:
    from t2tl_jax.registry import configs

    readers = {name: config.learner.task_encoder for name, (config, _) in configs().items()}
    able = [name for name, reader in readers.items() if reader is not None and reader.reads_tokens]
    return (
        f"this run encodes its task by {type(kind).__name__}, which reads no tokens, so there is nothing to attend "
        f"to or to take away. Configurations that read formulas: {', '.join(able)}"
    )


def _row(asked: int | None, table: Any) -> int:
    """The row to read; by default the task's first one."""
    from t2tl_jax.ltl.errors import no_formulas

    if table.states:
        raise no_formulas()
    if asked is None:
        return int(table.initial_row[0])
    if not 2 <= asked < table.num_rows:
        rows = "\n  ".join(f"{row}: {table.text(row)}" for row in range(2, table.num_rows))
        raise UserError(f"--row {asked} is no sub-task of this task; its rows:\n  {rows}")
    return asked


def _numbers(tokens: Sequence[str], before: Any, after: Any, removal: Any) -> dict[str, Any]:
    def one(attention: Any) -> dict[str, Any] | None:
        if attention is None:
            return None
        return {
            "by_head": attention.weights.tolist(),
            "total": attention.total.tolist(),
            "token_star": {"position": attention.strongest, "token": attention.tokens[attention.strongest]},
            "rank_correlation_with_removal": {
                "policy": removal.agreement(attention, "policy"),
                "value": removal.agreement(attention, "value"),
            },
        }

    return {
        "tokens": list(tokens),
        "attention_start": one(before),
        "attention_end": one(after),
        "removal_policy": removal.policy.tolist(),
        "removal_value": removal.value.tolist(),
    }


def _table(tokens: Sequence[str], before: Any, after: Any, removal: Any, unit: str) -> str:
    """One line per token; the stars mark the paper's token*."""
    width = max(6, *map(len, tokens))
    attentions = [attention for attention in (before, after) if attention is not None]
    heading = f"  {'start':>6}   {'end':>6} " if attentions else ""
    lines = [f"{'':>3}  {'token':{width}}{heading}   policy    value"]
    for k, token in enumerate(tokens):
        cells = [f"{a.total[k]:.2f}{'*' if k == a.strongest else ' '}".rjust(7) for a in attentions]
        cells += [f"{effect[k]:7.4f}" for effect in (removal.policy, removal.value)]
        lines.append("  ".join([f"{k:>3}", token.ljust(width), *cells]))
    where = "met in this row" if removal.met else "at starts of episodes, since none met this row"
    legend = [
        f"policy, value: change without the token, {unit} and absolute;",
        f"  mean over {removal.observations} observations {where}",
    ]
    if not attentions:
        return "\n".join([*lines, *legend])
    heads = len(after.weights)
    agreement = ["-" if x is None else f"{x:.2f}" for x in (removal.agreement(after, of) for of in ("policy", "value"))]
    return "\n".join(
        [
            *lines,
            f"start, end: attention received, sum over {heads} heads; 1 / n gives {heads / len(tokens):.2f}; *: top",
            *legend,
            f"rank correlation with the attention at the end: policy {agreement[0]}, value {agreement[1]}",
        ]
    )


if __name__ == "__main__":
    sys.exit(main())
