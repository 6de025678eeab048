"""What `experiments.evaluate` says of the rows of a task that training met: counted before, or of some pools now."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from experiments.reproduction.anytask import met as counted_before
from t2tl_jax.env import LabelledEnv
from t2tl_jax.evaluation.task_report import RowsMet
from t2tl_jax.ltl import Formula, LTLError, Share, TooLargeError, is_family, resolve_tasks
from t2tl_jax.registry import make_env
from t2tl_jax.runs import met
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.result import Result

BEFORE = "What the pre-training of the task encoder met is not counted."

Shares = dict[str, tuple[Share, Share]]
"""By task: in meaning, and under other names of propositions too."""

STRICT = (
    "A task is unseen in the strict sense, that of pool.held_out, if none of its rows was met. pool.unseen keeps only "
    "the task as a whole out of training, which may meet what is left of it."
)


def rows_met(result: Result, trained: Config, tasks: Sequence[str], pools: int) -> RowsMet:
    """What a training met of some tasks.

    What the run's folder holds was counted in every pool of the training. Of other tasks the first pools are drawn
    again, which is said before it begins.

    Args:
        result: the run.
        trained: the configuration that it was trained with.
        tasks: names or formulas.
        pools: as many are drawn at most; 0 draws none.
    """
    env = make_env(trained.env)
    found = {} if result.folder is None else stored(result.folder, tasks)
    notes = [f"From {counted_before.FILE}, which counts all pools of training: {_listed(found)}."] if found else []
    rest = [task for task in tasks if task not in found]
    if machines := [task for task in rest if _formula(task) is None]:
        notes.append(f"-: no formula, whose rows could be compared: {_listed(machines)}.")
    if others := [task for task in rest if task not in machines]:
        if not met.can_be_compared(trained, env):
            notes.append("-: rows of reward machines, or of another progression, are not compared.")
        else:
            counted, note = _count(result.iteration, trained, env, others, pools)
            found |= counted
            notes += [note] if note else []
    before = [BEFORE] if found and trained.pretrained else []
    return RowsMet(found, [*notes, *before, STRICT] if found else notes)


def stored(folder: Path, tasks: Sequence[str]) -> Shares:
    """What the folder of a run knows of some tasks, by their names or as the same formula."""
    shares = counted_before.read(folder)
    known = {name: name for name in shares["exactly"] if name in shares["renamed"]}
    by_formula = {formula: name for name in known if (formula := _formula(name)) is not None}
    found: Shares = {}
    for task in tasks:
        formula = _formula(task)
        name = known.get(task) or (None if formula is None else by_formula.get(formula))
        if name is not None:
            found[task] = (_share(shares["exactly"][name]), _share(shares["renamed"][name]))
    return found


def _count(iteration: int, trained: Config, env: LabelledEnv, tasks: Sequence[str], most: int) -> tuple[Shares, str]:
    """What the first pools of training, or its one task, hold of some tasks, and what the legend says of it."""
    drawn = counted = 0
    if is_family(trained.task, env.propositions):
        drawn = met.pools_drawn(trained, iteration)
        counted = met.pools_counted(trained, iteration, most)
        if counted == 0:
            return {}, f"-: not counted; --pools N counts the rows of N of the {drawn} pools that training drew."
        print(f"counting the rows of {counted} of the {drawn} pools drawn in training (--pools)", flush=True)
    try:
        found = met.met_in_training(trained, env, tasks, iteration, counted)
    except TooLargeError as error:
        return {}, f"-: not counted: {error}."
    assert found is not None
    shares = {task: (one.exactly, one.renamed) for task, one in found.by_task.items()}
    if counted == drawn:
        return shares, f"From all {drawn} pools of training: {_listed(tasks)}." if drawn else ""
    whole = f" --pools {drawn} counts all." if met.pools_counted(trained, iteration, drawn) == drawn else ""
    return shares, (
        f">=: at least so many, from {counted} of the {drawn} pools that training drew; the others may hold "
        f"more, so that no task is called new for a count of 0.{whole}"
    )


def _listed(tasks: Iterable[str]) -> str:
    return ", ".join(tasks)


def _formula(text: str) -> Formula | None:
    """The formula that a name stands for; None for what is none, such as the name of a set of tasks."""
    try:
        (formula,) = resolve_tasks([text]).values()
    except LTLError:
        return None
    return formula


def _share(text: str) -> Share:
    """What `str` of it gave."""
    met_rows, rows = text.split("/")
    return Share(int(met_rows), int(rows))
