"""How far the walls of both physics are from the original's: ``python -m experiments.benchmarks.walls``.

MuJoCo itself drives the robot through the original scene of 204 cubes: from rest at a random place and heading, under
actions that are drawn uniformly and held for a second on average, so that it runs into walls, stays there and leaves
again. Each of its states is also given, with its action, to the physics here. Reported is how far apart both are 20 ms
later, one environment step, where the robot of the original touched a wall meanwhile, and where it did not.
"""

import dataclasses
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from experiments.benchmarks import json_file
from experiments.cli.errors import guarded
from t2tl_jax import checks
from t2tl_jax.errors import explained
from t2tl_jax.flags import parse
from t2tl_jax.quiet import quiet_imports

QUANTITIES = ("position_mm", "velocity_m_s", "turning_rad_s")
"""What is compared: two distances in the plane, and the turning rate."""

HOLD_STEPS = 50
"""Environment steps for which an action is held on average: one second."""

START = 2.1
"""Episodes start within this distance of the centre along either axis, in metres; so do those on random maps."""


@dataclasses.dataclass(frozen=True)
class Arguments:
    """Measure the walls of both physics against those of the original scene, on driven states."""

    episodes: int = 128
    """Episodes that are driven."""
    steps: int = 500
    """Environment steps of an episode."""
    iterations: tuple[int, ...] = (1, 3, 20)
    """Newton steps of MJX's solver to compare; the model has 1."""
    seed: int = 0
    """Of starts and actions."""
    json: Path | None = None
    """Also write the results to this file."""

    def __post_init__(self) -> None:
        checks.counts(self, "episodes", "steps")
        checks.counts(self, "seed", least=0)
        if not self.iterations or min(self.iterations) < 1:
            raise ValueError(
                f"iterations are numbers of Newton steps, one or more of at least 1, got {self.iterations}"
            )


@dataclasses.dataclass(frozen=True)
class Driven:
    """Environment steps of the original; every array leads with their number."""

    episode: np.ndarray  # int[N], its number
    qpos: np.ndarray  # float32[N, 3]
    qvel: np.ndarray  # float32[N, 3]
    action: np.ndarray  # float32[N, 2]
    next_qpos: np.ndarray  # float64[N, 3], 20 ms later
    next_qvel: np.ndarray  # float64[N, 3]
    touched: np.ndarray  # bool[N], a wall was felt in one of the ten substeps


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0 done, 2 for input that cannot be used."""
    return guarded(lambda: _main(sys.argv[1:] if arguments is None else list(arguments)))


def _main(texts: list[str]) -> int:
    arguments = parse(Arguments, texts, prog="python -m experiments.benchmarks.walls", description=__doc__)
    file = arguments.json
    json_file.check(file)
    with explained():
        results = measure(arguments)
    if file is not None:
        where = json_file.where(["python", "-m", "experiments.benchmarks.walls", *texts])
        config = {**dataclasses.asdict(arguments), "json": str(file)}
        json_file.write(file, {"where": where, "config": config, "results": results})
    return 0


def measure(arguments: Arguments) -> list[dict[str, Any]]:
    """Drive, compare, print a table, and return its rows: a `summary` of each of `QUANTITIES`."""
    with quiet_imports():
        from envs.zones.point_closed_form import ClosedFormPoint

    driven = drive(arguments.episodes, arguments.steps, arguments.seed)
    if not driven.touched.any():
        raise ValueError("the robot touched no wall; drive more or longer episodes")
    points = {f"mjx, {n} Newton": mjx_point(n) for n in arguments.iterations} | {"closed form": ClosedFormPoint()}
    print(
        f"{arguments.episodes} episodes of {arguments.steps} steps, seed {arguments.seed}; after 20 ms, median / 95 %"
    )
    print(f"{'physics':16} {'wall':9} {'states':>7} {'position, mm':>17} {'velocity, m/s':>17} {'turning, rad/s':>17}")
    rows: list[dict[str, Any]] = []
    for name, point in points.items():
        apart = differences(point, driven)
        for wall, states in (("touched", driven.touched), ("clear", ~driven.touched)):
            quantiles = [summary(values[states], driven.episode[states], arguments.seed) for values in apart]
            rows.append({"physics": name, "wall": wall, "states": int(states.sum())})
            rows[-1] |= dict(zip(QUANTITIES, quantiles, strict=True))
            spreads = "".join(f" {q['median']:8.4f}/{q['p95']:8.4f}" for q in quantiles)
            print(f"{name:16} {wall:9} {states.sum():7}{spreads}", flush=True)
    return rows


def drive(episodes: int, steps: int, seed: int) -> Driven:
    """So many episodes of the original under held random actions.

    The state is rounded to float32 before every step: what is compared is the step, not its input.
    """
    import mujoco

    from envs.zones.original_scene import original_model
    from envs.zones.point_robot import SUBSTEPS

    model = original_model()
    data, rng, rows = mujoco.MjData(model), np.random.default_rng(seed), []
    wall = np.array([model.geom(i).name.startswith("wall") for i in range(model.ngeom)])
    for episode in range(episodes):
        mujoco.mj_resetData(model, data)
        data.qpos[:] = rng.uniform([-START, -START, -np.pi], [START, START, np.pi])
        for step in range(steps):
            if step == 0 or rng.random() < 1.0 / HOLD_STEPS:
                action = rng.uniform(-1.0, 1.0, 2).astype(np.float32)
            before = data.qpos.astype(np.float32), data.qvel.astype(np.float32)
            data.qpos[:], data.qvel[:], data.ctrl[:] = *before, action
            touched = False
            for _ in range(SUBSTEPS):
                mujoco.mj_step(model, data)
                touched |= bool(wall[data.contact.geom].any())
            rows.append((episode, *before, action, data.qpos.copy(), data.qvel.copy(), touched))
    return Driven(*(np.array(column) for column in zip(*rows, strict=True)))


def mjx_point(iterations: int) -> Any:
    """The physics by MJX, as it is but for the number of Newton steps."""
    with quiet_imports():
        from envs.zones.point_mjx import MjxPoint

    point = MjxPoint()
    # Nobody but this comparison wants another number, so it is no argument there.
    point._model = point._model.replace(opt=point._model.opt.replace(iterations=iterations))
    # Several steps are a loop, which has no straight-line form.
    point._substep = point.mujoco_substep  # type: ignore[method-assign]
    return point


def differences(point: Any, driven: Driven) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`QUANTITIES` of every step: how far `point` is from the original after it, each ``float64[N]``."""
    import jax
    import jax.numpy as jnp

    from envs.zones.point_robot import PointState

    before = PointState(qpos=jnp.asarray(driven.qpos), qvel=jnp.asarray(driven.qvel))
    after = jax.jit(jax.vmap(point.step))(before, jnp.asarray(driven.action))
    position, velocity = np.asarray(after.qpos) - driven.next_qpos, np.asarray(after.qvel) - driven.next_qvel
    return (
        1e3 * np.linalg.norm(position[:, :2], axis=1),
        np.linalg.norm(velocity[:, :2], axis=1),
        np.abs(velocity[:, 2]),
    )


def summary(values: np.ndarray, episode: np.ndarray, seed: int, resamples: int = 500) -> dict[str, Any]:
    """Median and 95 % quantile of `values`, each with a 95 % bootstrap interval.

    Whole episodes are resampled: the states of one are much alike, such as those of a robot that leans on a wall.
    """
    rng, groups = np.random.default_rng(seed), [values[episode == number] for number in np.unique(episode)]
    picks = rng.integers(len(groups), size=(resamples, len(groups)))
    draws = [np.quantile(np.concatenate([groups[i] for i in pick]), [0.5, 0.95]) for pick in picks]
    low, high = np.quantile(draws, [0.025, 0.975], axis=0)
    median, p95 = np.quantile(values, [0.5, 0.95])
    return {
        "median": float(median),
        "p95": float(p95),
        "median_interval": [float(low[0]), float(high[0])],
        "p95_interval": [float(low[1]), float(high[1])],
    }


if __name__ == "__main__":
    sys.exit(main())
