"""Checkpoints with Orbax: the whole training state for exact resumption, and the parameters alone for evaluation.

A checkpoint is written under a temporary name and renamed when it is complete, so a killed process leaves the previous
one intact. Nothing in it is code: arrays, and one JSON object.
"""

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, get_args

import jax
import numpy as np
import orbax.checkpoint as ocp

Item = Literal["latest", "best", "selection"]
"""Sets of parameters: the latest ones, the best ones if the run ends here, and what it has selected if it goes on."""

KEPT = 2
"""How many checkpoints a run keeps: the latest, and the one before it in case the disk loses a file."""


class CheckpointError(ValueError):
    """A checkpoint is missing, incomplete or made for something else; the message says what to do."""


class Checkpoints:
    """The checkpoints of one run, numbered by iteration. Use as a context manager, or call ``close``.

    Every array has a leading axis [seeds]. On disk are these items per checkpoint: ``state``, ``latest``, ``best`` and
    perhaps ``selection`` (parameters), ``info`` (JSON).
    """

    def __init__(self, folder: Path) -> None:
        self.folder = Path(folder).absolute()
        # Orbax reports every handler and commit at level INFO or WARNING; a user has no use for it.
        logging.getLogger("absl").setLevel(logging.ERROR)
        options = ocp.CheckpointManagerOptions(max_to_keep=KEPT, create=False, enable_async_checkpointing=False)
        handlers = {name: ocp.StandardCheckpointHandler() for name in ("state", *get_args(Item))}
        self._manager: ocp.CheckpointManager | None = None
        self._arguments = {"item_names": (*handlers, "info"), "options": options}
        self._arguments["item_handlers"] = {**handlers, "info": ocp.JsonCheckpointHandler()}

    def __enter__(self) -> "Checkpoints":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release Orbax's threads."""
        if self._manager is not None:
            self._manager.close()
            self._manager = None

    def latest_iteration(self) -> int | None:
        """Number of the newest complete checkpoint; None if there is none."""
        if not self.folder.is_dir():
            return None
        return self._open().latest_step()

    def save(
        self, iteration: int, train_state: Any, info: Mapping[str, Any], best: Any = None, selection: Any = None
    ) -> None:
        """Write a checkpoint and return when it is complete on disk.

        Args:
            iteration: how many iterations led to this state.
            train_state: see ``t2tl_jax.training.types.TrainState``, with leading axis [seeds].
            info: anything that JSON can hold.
            best: parameters, by default those of the state.
            selection: parameters, if there are any.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        items = {
            "state": ocp.args.StandardSave(_to_host(train_state)),
            "latest": ocp.args.StandardSave(_to_host(train_state.params)),
            "best": ocp.args.StandardSave(_to_host(train_state.params if best is None else best)),
            "info": ocp.args.JsonSave(dict(info)),
        }
        if selection is not None:
            items["selection"] = ocp.args.StandardSave(_to_host(selection))
        manager = self._open()
        manager.save(iteration, args=ocp.args.Composite(**items), force=True)
        manager.wait_until_finished()

    def restore(self, like: Any) -> tuple[int, Any]:
        """The newest training state, as NumPy arrays and typed keys, and its iteration.

        Args:
            like: shapes and dtypes of the state (``Program.state``).

        Raises:
            CheckpointError: if there is none, it cannot be read, or its arrays differ from ``like``.
        """
        iteration = self._require_latest()
        return iteration, self._read(iteration, "state", like)

    def restore_params(self, which: Item, like: Any) -> tuple[int, Any]:
        """One set of parameters of every seed, and the iteration of the checkpoint that holds them.

        Raises:
            CheckpointError: as for ``restore``.
        """
        iteration = self._require_latest()
        return iteration, self._read(iteration, which, like)

    def info(self) -> dict[str, Any]:
        """The JSON object of the newest checkpoint.

        Raises:
            CheckpointError: if there is no readable checkpoint.
        """
        iteration = self._require_latest()
        return self._restore_item(iteration, "info", ocp.args.JsonRestore())

    def _open(self) -> ocp.CheckpointManager:
        if self._manager is None:
            self._manager = ocp.CheckpointManager(self.folder, **self._arguments)
        return self._manager

    def _require_latest(self) -> int:
        iteration = self.latest_iteration()
        if iteration is None:
            raise CheckpointError(
                f"{self.folder} holds no complete checkpoint: the run was stopped before its first one, or kept for "
                "its figures alone, as those in results/ of this project are"
            )
        return iteration

    def _read(self, iteration: int, item: str, like: Any) -> Any:
        shapes = jax.eval_shape(_unwrap_keys, like)
        target = jax.tree.map(lambda x: _storable(np.zeros(x.shape, x.dtype)), shapes)
        restored = self._restore_item(iteration, item, ocp.args.StandardRestore(target))
        wrong = [
            f"{jax.tree_util.keystr(path)}: {np.shape(got)} on disk, {want.shape} expected"
            for (path, want), got in zip(
                jax.tree_util.tree_leaves_with_path(target), jax.tree.leaves(restored), strict=True
            )
            if np.shape(got) != want.shape or np.asarray(got).dtype != want.dtype
        ]
        if wrong:
            raise CheckpointError(
                f"checkpoint {self.folder / str(iteration)} belongs to another configuration or version:\n  "
                + "\n  ".join(wrong[:5])
            )
        return jax.tree.map(_rewrap_key, like, restored)

    def _restore_item(self, iteration: int, item: str, argument: Any) -> Any:
        try:
            return self._open().restore(iteration, args=ocp.args.Composite(**{item: argument}))[item]
        except Exception as error:  # Orbax raises many kinds, from OSError to plain ValueError, for damaged files
            reason = str(error).strip().splitlines()[0][:300] if str(error).strip() else type(error).__name__
            raise CheckpointError(
                f"cannot read '{item}' of checkpoint {self.folder / str(iteration)}: {reason}\n"
                "It is damaged, or was written by another version or configuration. Checkpoints present: "
                f"{', '.join(map(str, self._open().all_steps()))}; without the damaged folder the one before is used."
            ) from error


def _is_key(x: Any) -> bool:
    return jax.dtypes.issubdtype(x.dtype, jax.dtypes.prng_key)


def _unwrap_keys(tree: Any) -> Any:
    """Typed keys as their ``uint32`` data, which every version of Orbax can store."""
    return jax.tree.map(lambda x: jax.random.key_data(x) if _is_key(x) else x, tree)


def _rewrap_key(like: Any, value: np.ndarray) -> Any:
    if _is_key(like):
        return jax.random.wrap_key_data(jax.numpy.asarray(value))
    return value if like.size else np.zeros(like.shape, like.dtype)


def _storable(x: np.ndarray) -> np.ndarray:
    """Orbax refuses arrays without entries, such as the observations of an environment that shows nothing."""
    return x if x.size else np.zeros(1, x.dtype)


def _to_host(tree: Any) -> Any:
    # A copy: on CPU a plain transfer is a view of memory that the next iteration may overwrite.
    return jax.tree.map(lambda x: _storable(np.array(x, copy=True)), jax.device_get(_unwrap_keys(tree)))
