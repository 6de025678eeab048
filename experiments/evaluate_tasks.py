"""What `experiments.evaluate` does with a list of tasks: one table for all, or a certificate of each."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from experiments.cli.words import counted
from experiments.evaluate_rows import rows_met
from t2tl_jax.errors import UserError
from t2tl_jax.evaluation.task_report import tasks_table
from t2tl_jax.runs import certificates, evaluations
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.evaluations import Which
from t2tl_jax.runs.folder import RunFolder, read_json, write_json
from t2tl_jax.runs.result import Result


def listed(text: str) -> list[str]:
    """The tasks of `--tasks`: a file with one on each line (`#` begins a comment), or a list separated by commas.

    Raises:
        UserError: for a file that cannot be read, or an empty list.
    """
    path = Path(text)
    try:
        lines = path.read_text(encoding="utf-8").splitlines() if len(text) < 256 and path.is_file() else text.split(",")
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"cannot read the tasks in {path}: {error}") from error
    words = [word for line in lines if (word := line.partition("#")[0].strip())]
    if not words:
        raise UserError(f"--tasks {text!r} holds no task; give names or formulas, such as z1,z2, or a file of them")
    return words


def evaluate(
    result: Result, trained: Config, tasks: Sequence[str], which: Sequence[Which], episodes: int, pools: int
) -> dict[Which, Any]:
    """Play every task with both policies of every seed, and print the table.

    Args:
        result: the run.
        trained: the configuration that it was trained with.
        tasks: names or formulas.
        which: of the parameters.
        episodes: per seed, policy and task.
        pools: of the training whose rows are counted, at most.

    Returns:
        Reports by the name of the parameters, of the task and of the policy.
    """
    tables = result.tables(tasks)
    params = {name: result.params_of(name) for name in which}
    what = f"{counted(len(tables), 'task')}, {counted(episodes, 'episode')}"
    print(f"playing {what} of each per seed and policy", flush=True)
    played = evaluations.evaluate_tables(
        result.experiment, params, list(tables.values()), episodes, result.config.episode_length
    )
    reports = {name: dict(zip(tables, of, strict=True)) for name, of in played.items()}
    policies = {
        f"{name} {policy}": {task: of[policy] for task, of in reports[name].items()}
        for name in which
        for policy in evaluations.POLICIES
    }
    print(tasks_table(policies, rows_met(result, trained, tasks, pools)), flush=True)
    return reports


def certify(
    result: Result,
    trained: Config,
    tasks: Sequence[str] | None,
    which: Which,
    seed: int | None,
    policy: str,
    episodes: int,
    pools: int,
) -> dict[str, Any]:
    """Bound how often one seed's policy carries out each task, by default the one of `result`, and print the table.

    Returns:
        The same for the record.
    """
    index, own = result.index(seed), result.experiment.table
    if tasks is None and own.num_tasks > 1:
        raise UserError(
            f"{result.config.task} stands for several tasks: choose which to certify, such as --tasks z1,z2"
        )
    tables = {str(result.config.task): own} if tasks is None else result.tables(tasks)
    found = certificates.certify(
        result.experiment,
        result.params_of(which),
        index,
        tables,
        episodes,
        result.config.episode_length,
        evaluations.POLICIES[policy],
    )
    print(f"seed: {result.seeds[index]}  policy: {which} {policy}")
    print(certificates.table(found, rows_met(result, trained, list(tables), pools)), flush=True)
    return {"seed": result.seeds[index], "policy": policy} | found.as_json()


def store_certificates(folder: RunFolder, settings: Mapping[str, Any], made: Mapping[str, Any]) -> None:
    """Add certificates to those of the run, in place of older ones of the same settings and tasks.

    Raises:
        UserError: if the file is damaged or cannot be written.
    """
    entry = {"settings": {name: value for name, value in settings.items() if name != "task"}, **made}

    def what(one: Mapping[str, Any]) -> Any:
        return [one.get("settings"), one.get("seed"), one.get("policy"), list(one.get("by_task", {}))]

    known = read_json(folder.certificates).get("certificates", [])
    kept = [one for one in known if what(one) != what(entry)]
    try:
        write_json(folder.certificates, {"certificates": [*kept, entry]})
    except OSError as error:
        raise UserError(f"cannot write {folder.certificates}: {error.strerror or error}") from error
