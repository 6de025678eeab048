"""How far a hand-written player gets in WaterWorld, beside random actions.

    python -m experiments.paper.scripted_player --episodes 300

Nothing is learned: a learner that stays below these numbers leaves something to be found.
"""

import dataclasses
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import jax
import jax.numpy as jnp

from experiments.benchmarks import json_file
from experiments.cli.errors import guarded
from t2tl_jax import checks
from t2tl_jax.errors import explained
from t2tl_jax.flags import parse
from t2tl_jax.quiet import quiet_imports

with quiet_imports():
    from envs.waterworld import EPISODE_LENGTH, NUM_ACTIONS, WaterWorld, WaterWorldConfig
    from envs.waterworld.scripted_player import scripted_action
    from t2tl_jax.env import State
    from t2tl_jax.evaluation.episodes import Episodes, first_episodes
    from t2tl_jax.ltl import TaskTable, compile_tasks, resolve_task
    from t2tl_jax.task_env import TaskEnv, TaskParams
    from t2tl_jax.training.unroll import Player

MakePlayer = Callable[[TaskParams], Player]
"""Who plays, by the parameters of the `TaskEnv`."""


@dataclasses.dataclass(frozen=True)
class ScriptConfig:
    """What is played."""

    tasks: tuple[str, ...] = ("phi_water",)
    """Names of tasks or formulas."""
    episodes: int = 300
    """Episodes of each task and player, each on another map."""
    episode_length: int = EPISODE_LENGTH
    """Steps after which an episode is cut."""
    radii: tuple[float, ...] = ()
    """Radius of each colour's balls; empty means 15 for all."""
    seed: int = 0
    """Seed of the maps and of the random actions."""
    json: Path | None = None
    """Also write the results to this file."""

    def __post_init__(self) -> None:
        if not self.tasks:
            raise ValueError("tasks are one or more names or formulas, got none")
        checks.counts(self, "episodes", "episode_length")
        checks.counts(self, "seed", least=0)


@dataclasses.dataclass(frozen=True)
class Outcome:
    """Means over the episodes of one player."""

    total: float
    """Return without discount, from -1 to 1."""
    success: float
    """Share of episodes that satisfied the task."""
    violation: float
    """Share of episodes that made it impossible."""
    length: float
    """Steps, cut episodes included."""


def colours_of_rows(table: TaskTable) -> tuple[jax.Array, jax.Array]:
    """What a task wants and forbids next, found by trying each proposition alone.

    Returns:
        Two ``bool[rows, P]``: propositions that change a row without deciding against it, and those that falsify it.
    """
    alone = table.letter(jnp.eye(len(table.propositions), dtype=bool))
    after, _ = table.step_all(alone)
    avoided = table.verdict[after] < 0
    return (after != jnp.arange(table.num_rows)[:, None]) & ~avoided, avoided


def scripted_player(env_params: TaskParams) -> Player:
    """Goes for what the present row wants and keeps away from what it forbids."""
    wanted, avoided = colours_of_rows(env_params.table)

    def act(carry: tuple[()], state: State, key: jax.Array) -> tuple[jax.Array, tuple[()], tuple[()]]:
        world, row = state.pipeline_state.env, state.pipeline_state.row
        action = jax.vmap(scripted_action, (0, None, 0, 0))(world, env_params.env, wanted[row], avoided[row])
        return action, carry, ()

    return Player(act)


def random_player(env_params: TaskParams) -> Player:
    """Any action, uniformly."""
    del env_params

    def act(carry: tuple[()], state: State, key: jax.Array) -> tuple[jax.Array, tuple[()], tuple[()]]:
        return jax.random.randint(key, (len(state.obs),), 0, NUM_ACTIONS), carry, ()

    return Player(act)


def play(env: TaskEnv, player: MakePlayer, episodes: int, episode_length: int, seed: int) -> Outcome:
    """Play whole episodes side by side, the first one of every environment."""

    def run(env_params: TaskParams, key: jax.Array) -> Episodes:
        return first_episodes(env, player(env_params), (), env_params, key, episodes, episode_length, discount=1.0)

    outcome = jax.jit(run)(env.make_params(0), jax.random.key(seed))
    success, violation = float(outcome.success.mean()), float(outcome.violation.mean())
    return Outcome(success - violation, success, violation, float(outcome.length.mean()))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0 done, 2 for input that cannot be used."""
    return guarded(lambda: _main(sys.argv[1:] if arguments is None else list(arguments)))


def _main(texts: list[str]) -> int:
    config = parse(ScriptConfig, texts, prog="python -m experiments.paper.scripted_player", description=__doc__)
    json_file.check(config.json)
    with explained():
        found = report(config)
    json_file.store(config, "experiments.paper.scripted_player", texts, found=found)
    return 0


def report(config: ScriptConfig) -> dict[str, dict[str, dict[str, float]]]:
    """Play every task with both players and print a table; what each came to, by task and player."""
    world = WaterWorld(WaterWorldConfig(layout="random", pool_size=0, radii=config.radii))
    tables = [compile_tasks(resolve_task(task), world.propositions, world.alphabet) for task in config.tasks]
    print(f"{config.episodes} episodes of at most {config.episode_length} steps each, all on different maps")
    print(f"{'task':<16} {'player':<8} {'return':>7} {'success':>8} {'violation':>10} {'steps':>7}")
    found: dict[str, dict[str, dict[str, float]]] = {}
    for task, table in zip(config.tasks, tables, strict=True):
        env = TaskEnv(world, table)
        found[task] = {}
        for name, player in (("random", random_player), ("script", scripted_player)):
            result = play(env, player, config.episodes, config.episode_length, config.seed)
            found[task][name] = dataclasses.asdict(result)
            print(
                f"{task:<16} {name:<8} {result.total:>7.2f} {result.success:>8.3f} {result.violation:>10.3f} "
                f"{result.length:>7.1f}",
                flush=True,
            )
    return found


if __name__ == "__main__":
    sys.exit(main())
