"""What uniformly random actions get in WaterWorld, by the balls' radius and speed, which are not published.

Nothing is learned. Every map of the methods' runs has its own start, and every episode on it starts there.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import jax
import numpy as np

from envs.waterworld import WaterWorldConfig
from experiments import configs  # noqa: F401, registers the configurations
from experiments.paper.scripted_player import random_player
from t2tl_jax.evaluation.episodes import Episodes, first_episodes
from t2tl_jax.ltl import TaskTable, compile_named
from t2tl_jax.registry import make_env, named_config
from t2tl_jax.runs.folder import RunFolder, write_json
from t2tl_jax.runs.provenance import describe
from t2tl_jax.task_env import TaskEnv, TaskParams
from t2tl_jax.training.program import OVER_SEEDS, params_of_seeds

NAME = "water-chance"
FILE = "table.json"
BASE = "waterworld_dqn"

MAPS = tuple(range(12))
"""Those of the methods' runs, which are their seeds."""

EPISODES = 2000
"""Of every map and setting: 24,000 for a mean, and all settings take about a minute on two cores."""


@dataclass(frozen=True)
class Setting:
    """One world, by factors of the default one."""

    radius: float = 1.0
    """Of the balls; the agent keeps its own."""
    speed: float = 1.0
    """Of the balls; the agent keeps its own."""
    map_radius: float = 1.0
    """Of the balls for which the maps are drawn."""

    def world(self, base: WaterWorldConfig) -> WaterWorldConfig:
        """The default world with these factors."""
        radii = base.radius_of_each_colour
        return replace(
            base,
            radii=tuple(self.radius * radius for radius in radii),
            map_radii=tuple(self.map_radius * radius for radius in radii),
            ball_speed=self.speed * base.ball_speed,
        )


SPEEDS = (0.5, 1.0, 1.5, 2.0)
"""At the default radius, on the maps of the methods' runs."""

RADII = (0.5, 1.0, 1.25, 1.5, 2.0)
"""At the default speed, on maps that are drawn for the largest one, so that only the radius differs."""

SETTINGS = (
    *(Setting(speed=speed) for speed in SPEEDS),
    *(Setting(radius=radius, map_radius=max(RADII)) for radius in RADII),
)


def measure(
    folder: Path, episodes: int = EPISODES, settings: Sequence[Setting] = SETTINGS, maps: Sequence[int] = MAPS
) -> None:
    """Play at random in every setting and store what came of it, as a finished run that trained nothing."""
    files, base = RunFolder(folder), named_config(BASE)
    folder.mkdir(parents=True, exist_ok=True)
    assert isinstance(base.env, WaterWorldConfig)
    worlds = [make_env(setting.world(base.env)) for setting in settings]
    compiled = compile_named(base.task, worlds[0].propositions, worlds[0].alphabet)
    assert isinstance(compiled, TaskTable)
    params = [params_of_seeds(TaskEnv(world, compiled), maps) for world in worlds]
    keys = jax.random.split(jax.random.key(0), len(maps))
    began = time.perf_counter()
    player = _player(TaskEnv(worlds[0], compiled), episodes, base.episode_length)
    play = jax.jit(player).lower(params[0], keys).compile()  # sizes and speeds come in with the parameters
    compiled_at = time.perf_counter()
    measured = [
        {**asdict(setting), "maps": _by_map(jax.device_get(play(of, keys)), maps)}
        for setting, of in zip(settings, params, strict=True)
    ]
    content = {
        "task": base.task,
        "episode_length": base.episode_length,
        "compile_seconds": compiled_at - began,
        "seconds": time.perf_counter() - compiled_at,
        "settings": measured,
    }
    write_json(files.versions, {"started": describe()})
    write_json(folder / FILE, content)
    write_json(files.status, {"state": "finished", "ended": "complete", "seeds": []})


def _player(env: TaskEnv, episodes: int, limit: int) -> Callable[[TaskParams, jax.Array], Episodes]:
    """(parameters of all maps, a key for each) -> outcomes, [maps, episodes]."""

    def one_map(params: TaskParams, key: jax.Array) -> Episodes:
        return first_episodes(env, random_player(params), (), params, key, episodes, limit, discount=1.0)

    return jax.vmap(one_map, (OVER_SEEDS, 0))


def _by_map(played: Episodes, maps: Sequence[int]) -> list[dict[str, Any]]:
    return [
        {
            "map": number,
            "episodes": played.length.shape[1],
            "mean_return": float(np.mean(played.total_reward[k], dtype=float)),
            "success_rate": float(played.success[k].mean()),
            "violation_rate": float(played.violation[k].mean()),
            "mean_length": float(played.length[k].mean()),
            "frames": int(played.length[k].sum()),
        }
        for k, number in enumerate(maps)
    ]
