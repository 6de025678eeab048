"""Parameters of some seeds of a run in one small file, for a run that is kept without its checkpoints.

The file is NumPy's compressed `.npz`, read without pickle: arrays by name, such as ``final/params/actor_0/kernel``.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np

from t2tl_jax.runs.checkpoints import CheckpointError
from t2tl_jax.runs.evaluations import WHICH, Which
from t2tl_jax.runs.folder import RunFolder
from t2tl_jax.training.types import Params

SEEDS, ITERATION = "seeds", "iteration"
"""Names of the two arrays that are no parameters: int64[seeds], and int64[]."""


def stands_in(folder: RunFolder) -> bool:
    """Whether this file is what there is of a run's parameters, which has no checkpoints."""
    return folder.params.is_file() and not folder.checkpoints.is_dir()


def write(path: Path, params: Mapping[Which, Params], seeds: Sequence[int], iteration: int) -> None:
    """Store parameters.

    Args:
        path: of the file.
        params: the final and the best ones, leading axis [seeds].
        seeds: their numbers.
        iteration: how many iterations led to the final ones.
    """
    arrays = {name: np.asarray(leaf) for name, leaf in _by_name(params).items()}
    arrays |= {SEEDS: np.array(seeds, np.int64), ITERATION: np.array(iteration, np.int64)}
    with path.open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]


def seeds(path: Path) -> tuple[int, ...]:
    """Numbers of the seeds that a file holds.

    Raises:
        CheckpointError: if it cannot be read or does not say.
    """
    given = _arrays(path).get(SEEDS, np.zeros(0))
    if given.ndim != 1 or not given.size or given.dtype != np.int64:
        raise CheckpointError(f"{path} does not say of which seeds it holds parameters")
    return tuple(given.tolist())


def read(path: Path, like: Params) -> tuple[int, dict[Which, Params]]:
    """The iteration, and the final and the best parameters.

    Args:
        path: of the file.
        like: shapes and dtypes of either, leading axis [seeds].

    Raises:
        CheckpointError: if it cannot be read, or its arrays differ from ``like``.
    """
    arrays = _arrays(path)
    want = _by_name(dict.fromkeys(WHICH, like))
    wrong = [f"{name}: not expected" for name in arrays if name not in (*want, SEEDS, ITERATION)]
    for name, leaf in want.items():
        got = arrays.get(name)
        if got is None or got.shape != leaf.shape or got.dtype != leaf.dtype:
            there = "nothing" if got is None else f"{got.dtype}{list(got.shape)}"
            wrong.append(f"{name}: {there} in the file, {leaf.dtype}{list(leaf.shape)} expected")
    iteration = arrays.get(ITERATION, np.zeros(1))
    if iteration.shape != () or iteration.dtype != np.int64:
        wrong.append(f"{ITERATION}: a whole number expected")
    if wrong:
        raise CheckpointError(f"{path} belongs to another configuration or version:\n  " + "\n  ".join(wrong[:5]))
    tree = jax.tree.structure(like)
    return int(iteration), {
        which: jax.tree.unflatten(tree, [arrays[name] for name in _by_name({which: like})]) for which in WHICH
    }


def _by_name(tree: Any) -> dict[str, Any]:
    """The leaves of a tree by their place in it, in its order."""
    leaves = jax.tree_util.tree_leaves_with_path(tree)
    return {jax.tree_util.keystr(path, simple=True, separator="/"): leaf for path, leaf in leaves}


def _arrays(path: Path) -> dict[str, np.ndarray]:
    try:
        with np.load(path) as file:  # which refuses what only pickle could read
            return {name: file[name] for name in file.files}
    except Exception as error:  # NumPy and zipfile raise many kinds for files that are damaged or something else
        raise CheckpointError(f"cannot read {path}: {error}\nIt is damaged, or no such file of parameters.") from error
