"""Read a trained agent: ``python -m experiments.attention RUN``; which words of its task it attends to and needs."""

import dataclasses
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import tyro

from experiments.cli.errors import guarded
from experiments.cli.flags import check_picture, parse
from experiments.cli.plugins import import_modules
from t2tl_jax.errors import UserError, explained
from t2tl_jax.quiet import quiet_imports


@dataclass(frozen=True)
class Arguments:
    """Draw the attention that every token of a formula receives at the start and at the end of training, and what the
    decisions lose without it; store the numbers beside the picture, and print them."""  # fmt: skip

    run: tyro.conf.Positional[Path]
    """Folder of the run."""
    task: str | None = None
    """Another formula over the same propositions; the run's own by default."""
    row: int | None = None
    """A sub-task instead of the whole task: its row in the table that python -m t2tl_jax.ltl shows."""
    seed: int | None = None
    """Which of the run's seeds; the first one by default."""
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
        import jax

        import experiments.configs  # noqa: F401, registers what runs are made of
        from experiments.cli import compilation_cache
        from t2tl_jax.agents.ppo import PPOConfig
        from t2tl_jax.evaluation import attention as reading
        from t2tl_jax.evaluation.attention_figure import plot_attention
        from t2tl_jax.networks.task_encoders import TransformerTaskEncoder
        from t2tl_jax.networks.transformer import TransformerConfig
        from t2tl_jax.runs import folder as run_folder
        from t2tl_jax.runs import train
        from t2tl_jax.runs.policy import of_seed
        from t2tl_jax.training.seeds import EVALUATION, TRAINING, stream_keys

    folder, config = run_folder.open_existing(arguments.run)
    reader = config.learner.task_encoder
    if not isinstance(reader, TransformerConfig):
        raise UserError(_no_attention(reader))
    compilation_cache.use(config.run.compilation_cache)
    changes: dict[str, Any] = {} if arguments.task is None else {"task": arguments.task}
    result = train.load(arguments.run, **changes)
    index = result.index(arguments.seed)
    seed, experiment, config = result.seeds[index], result.experiment, result.config
    if experiment.pools is not None:
        raise UserError(
            f"{config.task} is a family of random tasks: choose the one to read, such as --task 'F(a & F b)'"
        )
    agent, table = experiment.agent, experiment.table
    row = _row(arguments.row, table)
    env_params = experiment.env_params("evaluation")
    env_params = dataclasses.replace(env_params, env=of_seed(env_params.env, index))

    end = of_seed(result.params[arguments.which], index)
    begin = jax.jit(lambda key: agent.init(key, env_params).params)(stream_keys([seed], TRAINING)[0])
    origin, start = _start(folder, config, seed, begin)
    encoder = TransformerTaskEncoder(reader)

    def received(params: Any) -> reading.Attention:
        own = params["params"]["task_encoder"]
        return reading.attention_received(encoder, own, table, row, arguments.layers or None, arguments.queries)

    before, after = received(start), received(end)
    key = stream_keys([seed], EVALUATION)[0]
    play = jax.jit(reading.meet, static_argnums=(0, 1, 5, 6, 7))
    met = play(experiment.task_env, agent, end, env_params, key, row, arguments.episodes, config.episode_length)
    codes = reading.codes_without_tokens(encoder, end["params"]["task_encoder"], table, row)
    removal = reading.removal_effects(agent, end, codes, met)

    continuous = isinstance(config.learner, PPOConfig)
    unit = "KL divergence (nats)" if continuous else "share of greedy actions that change"
    stages = {
        "start": f"start of training ({origin})",
        "end": f"{arguments.which}, iteration {result.iteration:,}",
    }
    what = {
        "task": config.task,
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
    print(_table(before, after, removal, unit))
    target = arguments.output or folder.path / "attention.png"
    title = f"{table.text(row)} ({folder.path}, seed {seed})"
    plot_attention(target, title, (stages["start"], before), (stages["end"], after), removal, unit)
    run_folder.write_json(target.with_suffix(".json"), what | _numbers(before, after, removal))
    print(f"drawn: {target}\nstored: {target.with_suffix('.json')}")


def _start(folder: Any, config: Any, seed: int, fresh: Any) -> tuple[str, Any]:
    """What training began with, in words, and its parameters: `fresh` ones, with the pre-trained encoder if any."""
    import jax

    from t2tl_jax.runs import pretraining, train
    from t2tl_jax.training import transfer

    if not config.pretrained:
        return "new network", fresh
    try:
        first = train.load(folder.path / pretraining.FOLDER if pretraining.is_auto(config) else config.pretrained)
        encoder = transfer.task_encoder(first.params["best"], transfer.seed_index(first.seeds, (seed,)))
    except UserError as error:
        print(f"note: the start is drawn for a new network, since its pre-trained encoder cannot be read: {error}")
        return "new network, before the pre-trained encoder", fresh
    own = jax.tree.map(lambda x: jax.numpy.asarray(x[0]), encoder)
    return "pre-trained encoder", {**fresh, "params": {**fresh["params"], transfer.PART: own}}


def _no_attention(reader: Any) -> str:
    from t2tl_jax.networks.transformer import TransformerConfig
    from t2tl_jax.registry import configs

    able = [
        name for name, (config, _) in configs().items() if isinstance(config.learner.task_encoder, TransformerConfig)
    ]
    return (
        f"this run reads its task with a {type(reader).__name__}, which has no attention; the Transformer has. "
        f"Configurations with it: {', '.join(able)}"
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


def _numbers(before: Any, after: Any, removal: Any) -> dict[str, Any]:
    def one(attention: Any) -> dict[str, Any]:
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
        "tokens": list(after.tokens),
        "attention_start": one(before),
        "attention_end": one(after),
        "removal_policy": removal.policy.tolist(),
        "removal_value": removal.value.tolist(),
    }


def _table(before: Any, after: Any, removal: Any, unit: str) -> str:
    """One line per token; the stars mark the paper's token*."""
    width = max(6, *map(len, after.tokens))
    lines = [f"{'':>3}  {'token':{width}}  {'start':>6}   {'end':>6}    policy    value"]
    for k, token in enumerate(after.tokens):
        cells = [f"{a.total[k]:.2f}{'*' if k == a.strongest else ' '}".rjust(7) for a in (before, after)]
        cells += [f"{effect[k]:7.4f}" for effect in (removal.policy, removal.value)]
        lines.append("  ".join([f"{k:>3}", token.ljust(width), *cells]))
    heads = len(after.weights)
    agreement = ["-" if x is None else f"{x:.2f}" for x in (removal.agreement(after, of) for of in ("policy", "value"))]
    where = "met in this row" if removal.met else "at starts of episodes, since none met this row"
    lines += [
        f"start, end: attention received, sum over {heads} heads; 1 / n gives {heads / len(after.tokens):.2f}; *: top",
        f"policy, value: change without the token, {unit} and absolute;",
        f"  mean over {removal.observations} observations {where}",
        f"rank correlation with the attention at the end: policy {agreement[0]}, value {agreement[1]}",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
