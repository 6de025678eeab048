"""Checkpoints with Orbax: the whole training state for exact resumption, and the parameters alone for evaluation.

A checkpoint is written beside the training, in a thread, under a temporary name, and renamed when it is complete: a
killed process or a full disk leaves the previous ones intact. It holds a checksum of every array, so that one that was
damaged later is told, and the one before it is taken. Nothing in it is code: arrays, and one JSON object.
"""

import errno
import logging
import os
import shutil
import warnings
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, get_args

import jax
import orbax.checkpoint as ocp

from t2tl_jax.errors import Note
from t2tl_jax.quiet import quiet_left_loops
from t2tl_jax.runs import host_arrays
from t2tl_jax.runs.checkpoint_info import STORED, problem
from t2tl_jax.runs.config_files import MOST_BYTES
from t2tl_jax.runs.host_arrays import checksum, checksums
from t2tl_jax.training import hosts

Item = Literal["latest", "best", "selection"]
"""Sets of parameters: the latest ones, the best ones if the run ends here, and what it has selected if it goes on."""

KEPT = 2
"""How many checkpoints a run keeps: the latest, and the one before it in case the disk loses a file. Where a seed
broke, the last one from before stays beside them."""

STATE, REPLAY = "state", "replay"
"""Names on disk: the training state, and what of it is replay."""

UNFINISHED = "*.orbax-checkpoint-tmp*"
"""What a killed process leaves of the checkpoint that it was writing."""

ASIDE = "damaged_checkpoints"
"""Folder beside the checkpoints, for those that a resumed run could not read."""

OF_THE_DISK = tuple(map(os.strerror, (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EIO)))
"""What the system says of a disk that cannot be written."""

OTHER_REPLAY = (
    "It may be of an earlier version, which kept a replay with context in another form: such a run can be loaded, "
    "evaluated and compared, but not trained further."
)


class CheckpointError(ValueError):
    """A checkpoint is missing, incomplete or made for something else; the message says what to do."""


class Damaged(CheckpointError):
    """A checkpoint cannot be read although it is there."""


@dataclass(frozen=True)
class Stored:
    """What was read of a checkpoint."""

    iteration: int
    """How many iterations led to it."""
    info: dict[str, Any]
    """Its JSON object."""
    items: dict[str, Any]
    """By name, as NumPy arrays and typed keys."""
    damaged: tuple[int, ...] = ()
    """Later checkpoints that could not be read, of which a `Note` was given."""

    @property
    def lacks_replay(self) -> bool:
        """Whether the replay of its state was left out: it cannot be trained further."""
        return self.info.get(STORED, {}).get(REPLAY) == "left out"


class Checkpoints:
    """The checkpoints of one run, numbered by iteration. Use as a context manager, or call ``close``.

    Every array has a leading axis [seeds]. On disk are these items per checkpoint: ``state``, ``latest``, ``best`` and
    perhaps ``selection`` (parameters) and ``replay`` (part of the state), ``info`` (JSON).
    """

    def __init__(self, folder: Path) -> None:
        self.folder = Path(folder).absolute()
        # Orbax reports every handler and commit at level INFO or WARNING, and what fails with tracebacks at ERROR,
        # which is raised as well; a user has no use for it.
        logging.getLogger("absl").setLevel(logging.CRITICAL)
        # Of several processes each is on its own for Orbax: one writes, and all of them may read.
        me = hosts.index()
        alone = ocp.options.MultiprocessingOptions(me, {me}, f"process{me}")
        options = ocp.CheckpointManagerOptions(
            create=False, enable_async_checkpointing=False, multiprocessing_options=alone
        )
        names = (STATE, REPLAY, *get_args(Item))
        handlers = {name: ocp.StandardCheckpointHandler(multiprocessing_options=alone) for name in names}
        self._handlers = handlers
        self._manager: ocp.CheckpointManager | None = None
        self._arguments = {"item_names": (*handlers, "info"), "options": options}
        info = ocp.JsonCheckpointHandler(multiprocessing_options=alone)
        self._arguments["item_handlers"] = {**handlers, "info": info}
        self._writer = ThreadPoolExecutor(max_workers=1, thread_name_prefix="checkpoint")
        self._writing: Future[None] | None = None

    def __enter__(self) -> "Checkpoints":
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        try:
            self.close()
        except CheckpointError:
            if kind is None:  # else what went wrong before is what there is to say
                raise

    def close(self) -> None:
        """Wait for what is being written, and release Orbax's threads; raises as `wait`."""
        try:
            self.wait()
        finally:
            self._writer.shutdown()
            self._close_manager()

    def wait(self) -> None:
        """Return when the last `save` is complete on disk.

        Raises:
            CheckpointError: if it could not be written; earlier checkpoints are as they were.
        """
        writing, self._writing = self._writing, None
        if writing is not None:
            writing.result()

    def latest_iteration(self) -> int | None:
        """Number of the newest complete checkpoint; None if there is none."""
        return max(self.iterations(), default=None)

    def iterations(self) -> list[int]:
        """Numbers of the complete checkpoints, in order."""
        self.wait()
        return sorted(self._open().all_steps()) if self.folder.is_dir() else []

    def save(
        self,
        iteration: int,
        train_state: Any,
        info: Mapping[str, Any],
        best: Any = None,
        selection: Any = None,
        replay: str = "",
        last: bool = False,
        seeds: int | None = None,
        broken: int | None = None,
    ) -> None:
        """Copy what belongs to a checkpoint to the host, and write it in a thread. Waits for the one before it.

        Args:
            iteration: how many iterations led to this state.
            train_state: see ``t2tl_jax.training.types.TrainState``, with leading axis [seeds]; its memory may be used
                for something else as soon as this returns.
            info: anything that JSON can hold.
            best: parameters, by default those of the state.
            selection: parameters, if there are any.
            replay: field of the state that holds what was experienced; '' if none does.
            last: leave the replay out, here and in the checkpoint before: nothing is to follow.
            seeds: how many there are, where leading axes of the state are filled up beyond that; by default all.
            broken: the iteration in which a seed broke, the first one; the last checkpoint from before it is kept.

        Raises:
            CheckpointError: if the checkpoint before this one could not be written.
        """
        self.wait()
        sets = {"latest": train_state.params, "best": train_state.params if best is None else best}
        trees = {STATE: _without(train_state, replay)} | sets
        trees |= {} if selection is None else {"selection": selection}
        trees |= {} if last or not replay else {REPLAY: getattr(train_state, replay)}
        kept = "" if not replay else "left out" if last else "kept"
        on_host = {name: host_arrays.copied(tree, seeds) for name, tree in trees.items()}
        if not hosts.is_first():
            return
        about = dict(info)  # the training goes on, and may change its own
        self._writing = self._writer.submit(self._write, iteration, on_host, about, kept, broken)

    def read(self, wanted: Callable[[dict[str, Any]], Mapping[str, Any]], replay: str = "") -> Stored:
        """Some items of the newest checkpoint in which all of them can be read.

        Args:
            wanted: what to read, with its shapes and dtypes, given the JSON object of the checkpoint.
            replay: as in `save`; where it was left out, that field of the state is ``()``.

        Raises:
            CheckpointError: if there is none, none can be read, or arrays differ from what is wanted.
        """
        problems: dict[int, Damaged] = {}
        info: dict[str, Any] = {STORED: {}}
        for iteration in reversed(self._require_some()):
            try:
                info = self._info(iteration)
                items = {name: self._item(iteration, name, like, info, replay) for name, like in wanted(info).items()}
            except Damaged as error:
                problems[iteration] = error
                continue
            if problems:
                first = next(iter(problems.values()))
                warnings.warn(f"{first}\nThe one before is used, of iteration {iteration:,}.", Note, stacklevel=2)
            return Stored(iteration, info, items, tuple(problems))
        first = next(iter(problems.values()))
        if replay and STORED not in info:
            raise CheckpointError(f"{first}\n{OTHER_REPLAY}") from first
        raise first

    def restore(self, like: Any) -> tuple[int, Any]:
        """The newest training state that can be read, and its iteration; `like` and errors as for `read`."""
        stored = self.read(lambda _: {STATE: like})
        return stored.iteration, stored.items[STATE]

    def put_aside(self, iterations: tuple[int, ...]) -> None:
        """Move checkpoints out of the way of a training that goes on before them; they are not deleted."""
        for iteration in iterations:
            place = self.folder.parent / ASIDE / str(iteration)
            place.parent.mkdir(exist_ok=True)
            shutil.rmtree(place, ignore_errors=True)
            (self.folder / str(iteration)).rename(place)
        self._close_manager()

    def clean(self) -> None:
        """Remove what killed processes or a full disk left of unfinished checkpoints. Only who trains may do so."""
        for unfinished in self.folder.glob(UNFINISHED):
            shutil.rmtree(unfinished, ignore_errors=True)

    def _open(self) -> ocp.CheckpointManager:
        if self._manager is None:
            self._manager = ocp.CheckpointManager(self.folder, **self._arguments)
        return self._manager

    def _close_manager(self) -> None:
        if self._manager is not None:
            self._manager.close()
            self._manager = None

    def _require_some(self) -> list[int]:
        iterations = self.iterations()
        if not iterations:
            raise CheckpointError(
                f"{self.folder} holds no complete checkpoint: the run was stopped before its first one, or kept for "
                "its figures alone, as most in results/ of this project are; those with a file params.npz, such as "
                "results/paper/zone-t2tl, can be played"
            )
        return iterations

    def _write(
        self, iteration: int, trees: Mapping[str, Any], info: dict[str, Any], kept: str, broken: int | None
    ) -> None:
        """The work of the thread."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            stored: dict[str, Any] = {
                "checksums": {name: checksums(tree) for name, tree in trees.items()},
                REPLAY: kept,
                "iteration": iteration,
            }
            info = {**info, STORED: stored}
            items = {name: ocp.args.StandardSave(tree) for name, tree in trees.items()}
            items["info"] = ocp.args.JsonSave({**info, "checksum": checksum(info)})
            manager = self._open()
            with quiet_left_loops():
                manager.save(iteration, args=ocp.args.Composite(**items), force=True)
                manager.wait_until_finished()
            for step in superfluous(manager.all_steps(), broken):
                manager.delete(step)
            if kept == "left out":
                for other in self.folder.glob(f"*/{REPLAY}"):
                    shutil.rmtree(other, ignore_errors=True)
        except Exception as error:  # Orbax raises many kinds; a full disk is an OSError or a ValueError
            self.clean()
            raise CheckpointError(
                f"cannot write checkpoint {self.folder / str(iteration)}: {_reason(error)}\n"
                "Earlier checkpoints are as they were; make room or mend the disk, and resume the run."
            ) from error

    def _info(self, iteration: int) -> dict[str, Any]:
        folder = self.folder / str(iteration) / "info"
        if any(file.stat().st_size > MOST_BYTES for file in folder.rglob("*")):
            raise self._damaged(iteration, "info", f"it takes more than {MOST_BYTES // 2**20} MiB")
        info = self._from_disk(iteration, "info", ocp.args.JsonRestore())
        if reason := problem(info, iteration):
            raise self._damaged(iteration, "info", reason)
        return info

    def _item(self, iteration: int, name: str, like: Any, info: Mapping[str, Any], replay: str) -> Any:
        stored = info.get(STORED, {})
        if name != STATE or not stored.get(REPLAY):  # early versions kept the replay within the state
            return self._arrays(iteration, name, like, stored)
        if not replay:
            raise ValueError("the replay of this state is stored apart; say which field it is")
        state = self._arrays(iteration, STATE, _without(like, replay), stored)
        if stored[REPLAY] == "left out":
            return state
        return replace(state, **{replay: self._arrays(iteration, REPLAY, getattr(like, replay), stored)})

    def _arrays(self, iteration: int, name: str, like: Any, stored: Mapping[str, Any]) -> Any:
        wanted = host_arrays.shapes(like)
        self._check_shapes(iteration, name, wanted)
        restored = self._from_disk(iteration, name, ocp.args.StandardRestore(host_arrays.blank(wanted)))
        known = stored.get("checksums", {}).get(name)  # early versions wrote none
        if known is not None and known != checksums(restored):
            raise self._damaged(iteration, name, "its arrays are not what was written")
        return jax.tree.map(host_arrays.as_in, like, restored)

    def _check_shapes(self, iteration: int, name: str, wanted: Any) -> None:
        """Refuse arrays of other shapes or dtypes before any of them is read: a small file can hold huge ones."""
        place = self.folder / str(iteration)
        try:
            with quiet_left_loops():
                there = self._handlers[name].metadata(place / name).tree
        except Exception as error:  # as in `_from_disk`
            raise self._damaged(iteration, name, _reason(error)) from error
        if other := host_arrays.unpaired(wanted, there):
            raise self._damaged(iteration, name, ", ".join(sorted(other)[:3]))
        if wrong := host_arrays.differences(wanted, there):
            raise CheckpointError(
                f"checkpoint {place} belongs to another configuration or version:\n  " + "\n  ".join(wrong[:5])
            )
        if (size := host_arrays.size(wanted)) > (most := os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")):
            raise CheckpointError(
                f"'{name}' of checkpoint {place} takes {size / 2**30:,.1f} GiB, and this machine has "
                f"{most / 2**30:,.1f} GiB of memory; read it on another"
            )

    def _from_disk(self, iteration: int, item: str, argument: Any) -> Any:
        try:
            with quiet_left_loops():
                return self._open().restore(iteration, args=ocp.args.Composite(**{item: argument}))[item]
        except Exception as error:  # Orbax raises many kinds, from OSError to plain ValueError, for damaged files
            raise self._damaged(iteration, item, _reason(error)) from error

    def _damaged(self, iteration: int, item: str, reason: str) -> Damaged:
        return Damaged(
            f"cannot read '{item}' of checkpoint {self.folder / str(iteration)}: {reason}\n"
            "It is damaged, or was written by another version or configuration. Checkpoints present: "
            f"{', '.join(map(str, self.iterations()))}."
        )


def superfluous(iterations: Iterable[int], broken: int | None = None) -> list[int]:
    """Which checkpoints give way: all but the latest ones and, where a seed broke, the last one from before.

    Args:
        iterations: those that are complete.
        broken: the first iteration in which something was not finite; None for none.
    """
    known = sorted(iterations)
    good = [] if broken is None else [step for step in known if step < broken][-1:]
    return [step for step in known[:-KEPT] if step not in good]


def _without(state: Any, replay: str) -> Any:
    return replace(state, **{replay: ()}) if replay else state


def _reason(error: Exception) -> str:
    """Its first line; of a long one the beginning and the end, where TensorStore mostly has the cause, or what it says
    of the disk if that stands between."""
    text = (str(error).strip() or type(error).__name__).splitlines()[0]
    short = text if len(text) <= 300 else f"{text[:140]} ... {text[-150:]}"
    return next((f"{said}: {short}" for said in OF_THE_DISK if said in str(error) and said not in short), short)
