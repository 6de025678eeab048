"""Parameters of some seeds of a run in one small file, for a run that is kept without its checkpoints.

The file is NumPy's compressed `.npz`, read without pickle: arrays by name, such as ``final/params/actor_0/kernel``. A
small file can say that it holds arrays of any size, so names, shapes and dtypes are compared before an array is read.
Where the best parameters are the final ones they are stored once, as the final ones. A file may also hold the final
ones alone, and in half precision, which is read as single precision.
"""

import math
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import jax
import numpy as np

from t2tl_jax.runs.checkpoints import CheckpointError
from t2tl_jax.runs.evaluations import WHICH, Which
from t2tl_jax.runs.folder import RunFolder
from t2tl_jax.training.types import Params

SEEDS, ITERATION, ALONE = "seeds", "iteration", "final_alone"
"""Names of the arrays that are no parameters: int64[seeds], int64[], and, where the best ones are left out, int64[]."""

FINAL, BEST = "final/", "best/"
"""What the names of their arrays begin with."""

MAX_ARRAYS = 10_000
"""Most arrays of a file."""

MAX_SEEDS = 10_000
"""Most seeds of a file, which is the most that a run may count."""

Kinds = dict[str, jax.ShapeDtypeStruct]
"""Shapes and dtypes of arrays by name."""


def stands_in(folder: RunFolder) -> bool:
    """Whether this file is what there is of a run's parameters, which has no checkpoints."""
    return folder.params.is_file() and not folder.checkpoints.is_dir()


def write(path: Path, params: Mapping[Which, Params], seeds: Sequence[int], iteration: int, half: bool = False) -> None:
    """Store parameters.

    Args:
        path: of the file.
        params: the final and the best ones, or the final ones alone, leading axis [seeds].
        seeds: their numbers.
        iteration: how many iterations led to the final ones.
        half: round numbers of single precision to half.

    Raises:
        ValueError: for a number that half precision cannot hold.
    """
    arrays = {name: np.asarray(leaf) for name, leaf in _by_name(params).items()}
    if half:
        arrays = {name: _halved(name, leaf) for name, leaf in arrays.items()}
    if "best" not in params:
        arrays[ALONE] = np.array(1, np.int64)
    final = {name.replace(FINAL, BEST, 1): leaf for name, leaf in arrays.items() if name.startswith(FINAL)}
    if "best" in params and all(np.array_equal(leaf, arrays[name], equal_nan=True) for name, leaf in final.items()):
        arrays = {name: leaf for name, leaf in arrays.items() if name not in final}
    arrays |= {SEEDS: np.array(seeds, np.int64), ITERATION: np.array(iteration, np.int64)}
    with path.open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]


def _halved(name: str, leaf: np.ndarray) -> np.ndarray:
    if leaf.dtype != np.float32:
        return leaf
    with np.errstate(over="ignore"):
        rounded = leaf.astype(np.float16)
    if (np.isfinite(leaf) & ~np.isfinite(rounded)).any():
        raise ValueError(f"{name} holds numbers up to {np.abs(leaf).max():g}, and half precision ends at 65504")
    return rounded


def seeds(path: Path) -> tuple[int, ...]:
    """Numbers of the seeds that a file holds.

    Raises:
        CheckpointError: if it cannot be read or does not say.
    """
    with _opened(path) as (archive, there):
        given = there.get(SEEDS)
        if given is None or given.dtype != np.int64 or len(given.shape) != 1 or not 1 <= given.shape[0] <= MAX_SEEDS:
            raise CheckpointError(f"{path} does not say of which seeds it holds parameters, {MAX_SEEDS:,} at most")
        return tuple(_array(archive, SEEDS).tolist())


def read(path: Path, like: Params) -> tuple[int, dict[Which, Params]]:
    """The iteration, and the final and the best parameters, or the final ones alone where the others were left out.

    Args:
        path: of the file.
        like: shapes and dtypes of either, leading axis [seeds]; numbers of half precision in the file become single.

    Raises:
        CheckpointError: if it cannot be read, or its arrays differ from ``like``.
    """
    with _opened(path) as (archive, there):
        stored: dict[Which, Which] = {which: which for which in WHICH}
        if ALONE in there:
            del stored["best"]
        elif not any(name.startswith(BEST) for name in there):
            stored["best"] = "final"
        want = _by_name(dict.fromkeys(stored.values(), like))
        wrong = [f"{name}: not expected" for name in there if name not in (*want, SEEDS, ITERATION, ALONE)]
        for name, leaf in want.items():
            got = there.get(name)
            if got is None or got.shape != leaf.shape or got.dtype not in (leaf.dtype, *_rounded_of(leaf)):
                found = "nothing" if got is None else f"{got.dtype}{list(got.shape)}"
                wrong.append(f"{name}: {found} in the file, {leaf.dtype}{list(leaf.shape)} expected")
        iteration = there.get(ITERATION)
        if iteration is None or iteration.shape != () or iteration.dtype != np.int64:
            wrong.append(f"{ITERATION}: a whole number expected")
        if wrong:
            raise CheckpointError(f"{path} belongs to another configuration or version:\n  " + "\n  ".join(wrong[:5]))
        tree = jax.tree.structure(like)
        return int(_array(archive, ITERATION)), {
            which: jax.tree.unflatten(
                tree, [_array(archive, name).astype(leaf.dtype) for name, leaf in _by_name({name_of: like}).items()]
            )
            for which, name_of in stored.items()
        }


def _rounded_of(leaf: Any) -> tuple[np.dtype, ...]:
    """In what else a file may hold numbers of this kind."""
    return (np.dtype(np.float16),) if leaf.dtype == np.float32 else ()


def _by_name(tree: Any) -> dict[str, Any]:
    """The leaves of a tree by their place in it, in its order."""
    leaves = jax.tree_util.tree_leaves_with_path(tree)
    return {jax.tree_util.keystr(path, simple=True, separator="/"): leaf for path, leaf in leaves}


@contextmanager
def _opened(path: Path) -> Iterator[tuple[zipfile.ZipFile, Kinds]]:
    """The archive, and what its arrays say of themselves; what cannot be read is a `CheckpointError`."""
    try:
        with zipfile.ZipFile(path) as archive:
            yield archive, _kinds(archive)
    except CheckpointError:
        raise
    except Exception as error:  # NumPy and zipfile raise many kinds for files that are damaged or something else
        raise CheckpointError(f"cannot read {path}: {error}\nIt is damaged, or no such file of parameters.") from error


def _kinds(archive: zipfile.ZipFile) -> Kinds:
    members = archive.infolist()
    if len(members) > MAX_ARRAYS:
        raise ValueError(f"it holds {len(members):,} arrays; the limit is {MAX_ARRAYS:,} (params_file.MAX_ARRAYS)")
    found: Kinds = {}
    for member in members:
        name = member.filename.removesuffix(".npy")
        if name in found:
            raise ValueError(f"it holds {name} twice")
        with archive.open(member) as file:
            version = np.lib.format.read_magic(file)
            if version != (1, 0):  # whose headers are short; NumPy writes later ones for records of many fields only
                raise ValueError(f"{name} is in version {version} of NumPy's format, expected (1, 0)")
            shape, _, dtype = np.lib.format.read_array_header_1_0(file)
            if dtype.hasobject:
                raise ValueError(f"{name} holds objects, which only pickle could read")
            if member.file_size != (size := file.tell() + math.prod(shape) * dtype.itemsize):
                raise ValueError(f"{name} has {member.file_size:,} bytes, and its header says {size:,}")
        found[name] = jax.ShapeDtypeStruct(shape, dtype)
    return found


def _array(archive: zipfile.ZipFile, name: str) -> np.ndarray:
    with archive.open(f"{name}.npy") as file:
        return np.lib.format.read_array(file)  # which refuses what only pickle could read
