"""A group that has been trained, taken apart: an ordinary run for each of its configurations."""

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jax

from t2tl_jax.runs import faults, pretraining, status_form
from t2tl_jax.runs import folder as run_folder
from t2tl_jax.runs.checkpoints import Checkpoints
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.folder import RunFolder
from t2tl_jax.runs.metrics_file import lines_up_to
from t2tl_jax.training.types import Params

if TYPE_CHECKING:
    from t2tl_jax.runs.group import Group

TENSORBOARD = "tensorboard"


def split(experiment: "Group", group: RunFolder, runs: Mapping[Path, Config]) -> None:
    """Write the folder of every run, whole or not at all, and then remove that of the group.

    Args:
        experiment: of the group.
        group: its folder.
        runs: the configurations in the order of the group, by the folders that are to be made. Those that are there
            were made before something stopped this.
    """
    count = len(experiment.seeds_of_one)
    with Checkpoints(group.checkpoints) as checkpoints:
        shapes, replay = experiment.program.stored, experiment.agent.replay
        params = shapes.params

        def wanted(info: Mapping[str, Any]) -> dict[str, Any]:
            return {"state": shapes, "best": params} | ({"selection": params} if info.get("selection") else {})

        stored = checkpoints.read(wanted, replay)
    done, info, state, best = stored.iteration, stored.info, stored.items["state"], stored.items["best"]
    selection = stored.items.get("selection")
    for k, (path, config) in enumerate(runs.items()):
        if path.exists():
            continue
        part = slice(k * count, (k + 1) * count)
        unfinished = path.with_name(path.name + ".tmp")
        shutil.rmtree(unfinished, ignore_errors=True)
        run = run_folder.create(unfinished, config, {})
        shutil.copyfile(group.versions, run.versions)
        _write_metrics(group, run, done, part, experiment.seeds_of_one)
        run_folder.write_json(run.status, _status(group, path, part, experiment))
        with Checkpoints(run.checkpoints) as checkpoints:
            own = {name: value for name, value in info.items() if name != "watch"}  # of all lanes
            own |= {"seeds": list(experiment.seeds_of_one)}
            own[faults.NAME] = faults.of_lanes(info.get(faults.NAME, {}), experiment.lanes[part], own["seeds"])
            own |= {name: _sliced_info(info[name], part) for name in ("best", "selection")}
            sets = _sliced(state, part), own, _sliced(best, part), _sliced(selection, part)
            checkpoints.save(done, *sets, replay=replay, last=stored.lacks_replay)
        if (group.path / pretraining.FOLDER).is_dir():
            shutil.copytree(group.path / pretraining.FOLDER, run.path / pretraining.FOLDER)
        for lane, seed in zip(experiment.lanes[part], experiment.seeds_of_one, strict=True):
            events = group.path / TENSORBOARD / f"seed_{lane}"
            if events.is_dir():
                shutil.copytree(events, run.path / TENSORBOARD / f"seed_{seed}")
        unfinished.rename(path)
    shutil.rmtree(group.path)


def _sliced(tree: Params, part: slice) -> Params:
    """The lanes of one run; None of nothing."""
    return jax.tree.map(lambda x: x[part], tree)


def _sliced_info(info: Mapping[str, list[float]] | None, part: slice) -> dict[str, list[float]] | None:
    return None if info is None else {name: values[part] for name, values in info.items()}


def _write_metrics(group: RunFolder, run: RunFolder, done: int, part: slice, seeds: tuple[int, ...]) -> None:
    """The rows of some lanes under the names of their seeds; every other cell as it is."""
    header, *lines = (line.rstrip("\n").split(",") for line in lines_up_to(group.metrics, done))
    place = header.index("seed")
    rows = [header]
    for cells in lines:
        lane = int(cells[place])
        if part.start <= lane < part.stop:
            rows.append([*cells[:place], str(seeds[lane - part.start]), *cells[place + 1 :]])
    run_folder.write_text(run.metrics, "".join(",".join(cells) + "\n" for cells in rows))


def _status(group: RunFolder, path: Path, part: slice, experiment: "Group") -> dict[str, Any]:
    """The group's status as that of one run: its seeds, and its share of the frames per second. Seconds are those of
    the whole group, as the note `group` says."""
    status, count = status_form.read(group), len(experiment.variants)
    since = status.get("success_since_frames")
    status |= {
        "seeds": list(experiment.seeds_of_one),
        "success_since_frames": None if since is None else since[part],
        "group": {"runs": count, "lanes": len(experiment.lanes)},
    }
    broken = faults.of_lanes(status.pop(faults.NAME, {}), experiment.lanes[part], experiment.seeds_of_one)
    status |= {faults.NAME: broken} if broken else {}
    if "last_session" in status:
        speed = status["last_session"]["frames_per_second_all_seeds"] / count
        status["last_session"] = status["last_session"] | {"frames_per_second_all_seeds": round(speed, 1)}
    if "pretraining" in status and (group.path / pretraining.FOLDER).is_dir():
        status["pretraining"] = status["pretraining"] | {"folder": str(path / pretraining.FOLDER)}
    return status
