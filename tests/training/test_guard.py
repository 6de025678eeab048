"""What is not finite is named, its seed is frozen, the other seeds go on, and healthy ones are as without a guard."""

import json
from dataclasses import replace
from types import SimpleNamespace
from unittest.mock import patch

import chex
import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest
from flax import struct

from envs.zones.config import ZoneConfig
from envs.zones.zone_env import ZoneEnv
from t2tl_jax.agents.ppo import make_ppo
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.registry import AGENTS, Kind
from t2tl_jax.renaming import Renamed
from t2tl_jax.runs import faults
from t2tl_jax.runs.callbacks import Callback
from t2tl_jax.runs.checkpoints import Checkpoints, superfluous
from t2tl_jax.runs.train import resume, train
from t2tl_jax.task_env import TaskEnv, TaskParams
from t2tl_jax.training import few_kernels
from t2tl_jax.training.guard import CAUSES, Fault, watched
from t2tl_jax.training.optimizer import clipped_adam
from t2tl_jax.training.types import Agent, EpisodeTotals, Metrics
from t2tl_jax.training.unroll import FAILED, Player, advance, begin
from tests import fake_agent
from tests.agents.sizes import PPO
from tests.agents.test_ppo import ONE_HOT
from tests.fake_learner import CONFIG
from tests.parameters import begun_quickly
from tests.probe import DiscreteProbeEnv

NAN, INF = float("nan"), float("inf")
NOBODY = EpisodeTotals(*[jnp.int32(0)] * 5, *[jnp.float32(0)] * 4)


@struct.dataclass
class Here:
    obs: jax.Array


@struct.dataclass
class Episodes:
    state: Here


@struct.dataclass
class State:
    episodes: Episodes


@pytest.mark.parametrize(
    ("obs", "scalars", "fault"),
    [
        (0.0, {}, Fault.NONE),
        (0.0, {"entropy": NAN, "env_effort": 1.0, "env_physics_failed": 0.0}, Fault.NONE),
        (INF, {}, Fault.ENVIRONMENT),
        (0.0, {"value_loss": INF, "env_physics_failed": 1e-9}, Fault.ENVIRONMENT),
        (0.0, {"gradient_norm": INF}, Fault.GRADIENT),
        (0.0, {"gradient_norm": NAN, "value_loss": NAN}, Fault.LOSS),
        (NAN, {"value_loss": INF}, Fault.ENVIRONMENT),
    ],
)
def test_the_first_cause_is_named(obs, scalars, fault):
    def iterate(state, env_params):
        return state, Metrics(NOBODY, {name: jnp.float32(value) for name, value in scalars.items()})

    state = State(Episodes(Here(jnp.full((2, 3), obs))))
    _, metrics = jax.jit(watched(Agent(None, iterate, None, None, 1)).iterate)(state, None)
    assert Fault(int(metrics.fault)) is fault and (fault in CAUSES) == (fault is not Fault.NONE)


@pytest.mark.slow
@pytest.mark.parametrize("bad", [NAN, INF, 1e30])
def test_a_gradient_that_is_not_finite_changes_nothing(bad):
    """Also one whose norm overflows."""
    optimizer = clipped_adam(1e-2, 0.5, gradient_steps=10, anneal=False)
    params = {"params": {"task_encoder": {"w": jnp.ones(2)}, "actor": {"w": jnp.ones(3)}}}
    state = optimizer.init(params)
    good = jax.tree.map(jnp.ones_like, params)
    spoiled = {"params": {**good["params"], "actor": {"w": jnp.array([1.0, bad, 1.0])}}}
    for gradient in (good, spoiled, good):
        updates, state = optimizer.update(gradient, state, params)
        after = optax.apply_updates(params, updates)
        moved = [float(jnp.abs(a - b).max()) for a, b in zip(*map(jax.tree.leaves, (params, after)), strict=True)]
        assert all(step == 0 for step in moved) if gradient is spoiled else all(step > 1e-3 for step in moved)
        params = after
    chex.assert_tree_all_finite((params, state))


@pytest.mark.slow
@pytest.mark.parametrize("arena", ["walled", "open"])
def test_a_physics_failure_is_told_though_the_state_is_made_good(arena):
    """Of the step alone: what goes on, and is stored, has the form that it had before. Leaving the arena is none."""
    zones = ZoneEnv(ZoneConfig(physics="closed_form", arena=arena, layout="random", pool_size=4))
    env = TaskEnv(Renamed(zones), compile_tasks("F Red", zones.propositions, zones.alphabet))
    given = env.make_params(0)
    broken = jnp.array([False, True, False])

    def act(carry, state, key):
        return jnp.where(broken[:, None], NAN, jnp.ones((3, 2))), carry, ()

    def played(key):
        start = begin(env, given, key, 3, limit=9)
        robot = start.state.pipeline_state.env.env.robot
        qpos = robot.qpos.at[2].set(jnp.array([3.299, 0.0, 0.0])) if arena == "open" else robot.qpos
        qvel = robot.qvel.at[2].set(jnp.array([9.0, 0.0, 0.0])) if arena == "open" else robot.qvel
        robot = robot.replace(qpos=qpos, qvel=qvel)
        pipeline = start.state.pipeline_state
        inner = pipeline.env.replace(env=pipeline.env.env.replace(robot=robot))
        start = start.replace(state=start.state.replace(pipeline_state=pipeline.replace(env=inner)))
        after, _, step = advance(env, given, Player(act), start, (), key, 9, 0.9)
        return start, after, step

    start, after, step = jax.jit(played)(jax.random.key(0))
    np.testing.assert_array_equal(step.state.metrics[FAILED], broken)
    np.testing.assert_array_equal(step.terminated, [False, True, arena == "open"])
    chex.assert_trees_all_equal_shapes_and_dtypes(start, after)
    chex.assert_tree_all_finite((step.state.obs, after.state.obs))


def test_an_environment_that_hides_nothing_says_nothing():
    env = DiscreteProbeEnv()
    assert env.failed(env.reset(jax.random.key(0))) is None


class Ends(Callback):
    """Keeps what is noted at the end."""

    def on_end(self, progress):
        self.notes = dict(progress.notes)


def spoiling(*given):
    """The fake learner whose losses are NaN in some seeds from some iteration on, and its parameters then, too."""
    agent = fake_agent.make_agent(*given)

    def iterate(state, env_params):
        after, metrics = agent.iterate(state, env_params)
        spoiled = (jax.random.key_data(state.key)[-1] % 8 == 0) & (state.iteration >= 1)
        loss = jnp.where(spoiled, NAN, metrics.scalars["loss"])
        params = jax.tree.map(lambda x: jnp.where(spoiled, NAN, x), after.params)
        return after.replace(params=params), Metrics(metrics.episodes, metrics.scalars | {"loss": loss})

    return agent._replace(iterate=iterate)


@pytest.fixture
def spoiled(monkeypatch):
    monkeypatch.setitem(AGENTS._kinds, "fake", Kind(fake_agent.FakeConfig, spoiling))


BROKEN = replace(CONFIG, frames=800, seeds="4")


@pytest.mark.slow
def test_a_broken_seed_is_told_once_and_frozen_and_the_others_go_on(monkeypatch, recwarn):
    healthy = train(BROKEN)
    monkeypatch.setitem(AGENTS._kinds, "fake", Kind(fake_agent.FakeConfig, spoiling))
    ends = Ends()
    result = train(BROKEN, callbacks=[ends])
    broken = np.isnan(result.metrics["loss"])  # [seeds, iterations]
    told = ends.notes["faults"]
    assert 0 < len(told) < 4 and set(told) == {str(seed) for seed in np.flatnonzero(broken.any(axis=1))}
    assert sum("the loss was not finite. The seed is frozen" in str(warning.message) for warning in recwarn) == len(
        told
    )

    def params_of(run, seed):
        return jax.tree.map(lambda x: x[seed], run.params["final"])

    for seed in range(4):
        params = params_of(result, seed)
        if str(seed) not in told:
            chex.assert_trees_all_equal(params, params_of(healthy, seed))
            continue
        first = 1 + int(broken[seed].argmax())
        where = {"iteration": first, "frames": 100 * first}
        assert told[str(seed)] == where | {"fault": "LOSS", "cause": CAUSES[Fault.LOSS]}
        assert not result.metrics["episodes"][seed, first - 1 :].any()
        assert broken[seed, first - 1 :].all()
        before = train(replace(BROKEN, frames=100 * (first - 1), seeds=f"{seed},"))
        # The learning rate does not depend on the number of frames.
        chex.assert_trees_all_close(params, params_of(before, 0), rtol=1e-6)


def lucky(*given):
    """Half of the episodes succeed, but all of those of an iteration in which some seeds break, which comes again."""
    agent = fake_agent.make_agent(*given)

    def iterate(state, env_params):
        after, metrics = agent.iterate(state, env_params)
        breaks = (jax.random.key_data(state.key)[-1] % 2 == 0) & (state.iteration == 2)
        episodes = replace(NOBODY, episodes=jnp.int32(10), successes=jnp.where(breaks, 10, 5))
        loss = jnp.where(breaks, NAN, metrics.scalars["loss"])
        return after, Metrics(episodes, metrics.scalars | {"loss": loss})

    return agent._replace(iterate=iterate)


def test_a_frozen_seed_does_not_solve_its_task_by_what_it_does_not_keep(monkeypatch):
    monkeypatch.setitem(AGENTS._kinds, "fake", Kind(fake_agent.FakeConfig, lucky))
    result = train(replace(CONFIG, frames=2000, seeds="4", until_solved=True))
    frozen = np.isnan(result.metrics["loss"]).any(axis=1)
    assert 0 < frozen.sum() < 4 and result.ended == "complete" and result.iteration == 20
    assert result.success_since == dict.fromkeys(range(4)) and np.nanmax(result.metrics["success_rate"]) == 0.5


def test_a_run_ends_when_every_seed_is_frozen(spoiled, tmp_path):
    broken = [seed for seed, loss in enumerate(train(BROKEN).metrics["loss"]) if np.isnan(loss).any()]
    alone = replace(BROKEN, seeds=f"{broken[0]},")
    result = train(alone, folder=tmp_path / "run")
    assert result.ended == faults.ALL_FROZEN and result.iteration < 8
    assert resume(tmp_path / "run").iteration == result.iteration


def test_whatever_a_stored_fault_is_called_its_seed_stays_frozen():
    entries = {"3": {"fault": "GRADIENT", "cause": "x"}, "4": {"fault": "of a later version"}, "5": {"cause": "of old"}}
    progress = SimpleNamespace(seeds=(3, 4, 5, 6), notes={faults.NAME: entries})
    assert faults.codes(progress).tolist() == [Fault.GRADIENT, Fault.ENVIRONMENT, Fault.ENVIRONMENT, Fault.NONE]


@pytest.mark.parametrize("jit", [jax.jit, lambda function: function])
@pytest.mark.parametrize("given", [None, TaskParams((), (), fault=jnp.int32(0))])
def test_a_state_may_hold_plain_numbers(given, jit):
    def iterate(state, env_params):
        return {"count": 3, "w": state["w"] + 1}, Metrics(NOBODY, {"loss": jnp.float32(0)})

    state, _ = jit(watched(Agent(None, iterate, None, None, 1)).iterate)({"count": 2, "w": jnp.int32(0)}, given)
    assert (int(state["count"]), int(state["w"])) == (3, 1)


def test_what_a_learner_hands_through_is_neither_copied_nor_chosen():
    def iterate(state, env_params):
        return state | {"w": state["w"] + 1}, Metrics(NOBODY, {"loss": jnp.float32(0)})

    state, given = {"key": jax.random.key(0), "same": jnp.arange(3), "w": jnp.arange(3)}, TaskParams((), (), fault=0)
    after, _ = watched(Agent(None, iterate, None, None, 1)).iterate(state, given)
    assert after["same"] is state["same"] and after["key"] is state["key"] and after["w"].tolist() == [1, 2, 3]


def test_a_frozen_seed_stays_so_when_what_broke_it_is_gone():
    def iterate(state, env_params):
        loss = jnp.where(env_params.env, NAN, 0.0)
        return {"replay": state["replay"] + 1, "w": state["w"] + 1}, Metrics(NOBODY, {"loss": loss})

    step = jax.jit(watched(Agent(None, iterate, None, None, 1)).iterate)
    state, given = {"replay": jnp.int32(0), "w": jnp.int32(0)}, TaskParams(jnp.bool_(False), (), fault=jnp.int32(0))
    for is_bad, expected in ((False, 1), (True, 1), (False, 1)):
        state, metrics = step(state, given.replace(env=jnp.bool_(is_bad)))
        given = given.replace(fault=metrics.fault)
        assert int(state["w"]) == expected and (int(metrics.fault) == Fault.LOSS) == (given.fault != 0)
    assert int(metrics.fault) == Fault.LOSS


@pytest.mark.parametrize("given", [None, TaskParams((), (), fault=jnp.int32(0))])
def test_replay_is_neither_kept_nor_copied(given):
    seen = []

    def iterate(state, env_params):
        seen.append(state.episodes)
        return State(state.episodes + 1), Metrics(NOBODY, {"loss": jnp.float32(NAN)})

    agent, replay = watched(Agent(None, iterate, None, None, 1, replay="episodes")), jnp.int32(1)
    assert int(agent.iterate(State(replay), given)[0].episodes) == 2 and seen[0] is replay


@pytest.mark.slow
def test_the_last_good_checkpoint_stays_and_a_resumed_run_knows_the_faults(spoiled, tmp_path):
    config = replace(BROKEN, run=replace(BROKEN.run, checkpoint_period=0.0))
    whole = train(config, folder=tmp_path / "whole")
    first = 1 + int(np.isnan(whole.metrics["loss"]).any(axis=0).argmax())
    assert 1 < first < 6
    with Checkpoints(tmp_path / "whole" / "checkpoints") as checkpoints:
        assert checkpoints.iterations() == [first - 1, 7, 8]
    status = json.loads((tmp_path / "whole" / "status.json").read_text())

    class Stops(Callback):
        def on_iteration(self, progress, rows):
            progress.stop = "enough" if progress.done == 6 else progress.stop

    train(config, folder=tmp_path / "parts", callbacks=[Stops()])
    with Checkpoints(tmp_path / "parts" / "checkpoints") as checkpoints:
        assert checkpoints.iterations()[0] == first - 1
    resumed = resume(tmp_path / "parts")
    assert json.loads((tmp_path / "parts" / "status.json").read_text())["faults"] == status["faults"]
    chex.assert_trees_all_equal(resumed.params, whole.params)


def test_seeds_that_train_in_groups_are_frozen_one_by_one(spoiled):
    ends = Ends(), Ends()
    together = train(BROKEN, callbacks=[ends[0]])
    in_turns = train(replace(BROKEN, run=replace(BROKEN.run, seeds_at_once=3)), callbacks=[ends[1]])
    assert ends[0].notes == ends[1].notes
    chex.assert_trees_all_close(together.params, in_turns.params, rtol=1e-6)


def test_a_run_of_a_group_has_the_faults_of_its_lanes():
    known = {"1": {"cause": "one"}, "2": {"cause": "other"}}
    assert faults.of_lanes(known, (2, 3), (0, 7)) == {"0": {"cause": "other"}}
    assert faults.of_lanes({}, (2, 3), (0, 7)) == {}


@pytest.mark.parametrize(
    ("broken", "gone"), [(None, [1, 2]), (1, [1, 2]), (2, [2]), (3, [1]), (4, [1, 2]), (99, [1, 2])]
)
def test_which_checkpoints_give_way(broken, gone):
    assert superfluous([1, 2, 3, 4], broken) == gone


def test_what_the_guard_decides_on_is_read_as_one_of_two_unless_a_gain_is_measured():
    """Once for the copies before, and once for the choice after."""
    agent = fake_agent.make_agent()
    state = agent.init(jax.random.key(0), None)

    def barriers():
        def iterate(state, fault):
            return watched(agent).iterate(state, SimpleNamespace(fault=fault))

        return str(jax.make_jaxpr(iterate)(state, jnp.int32(0))).count("= optimization_barrier")

    assert barriers() == 2
    with patch.multiple(few_kernels, read_by_many=lambda number: number):
        assert barriers() == 0


@pytest.mark.slow
def test_the_guard_costs_two_passes_over_the_state_and_changes_no_number():
    """PPO in ZoneEnv. A gradient step goes over parameters and moments, too, and an iteration has dozens or hundreds of
    them, which the compiler's count knows as one. The state is set apart by kernels, not by copies. One robot whose
    physics fails freezes the seed, though every number that the learner sees is finite."""
    zones = ZoneEnv(ZoneConfig(physics="closed_form"))
    env = TaskEnv(zones, compile_tasks("F Red", zones.propositions, zones.alphabet))
    plain = begun_quickly(make_ppo(env, replace(PPO, network=ONE_HOT), 30, 60))
    given = env.make_params(0).replace(fault=jnp.int32(0))
    state = jax.jit(plain.init)(jax.random.key(0), given)
    ended, costs, copies = [], [], []
    for agent in (plain, watched(plain)):
        compiled = jax.jit(agent.iterate, donate_argnums=0).lower(state, given).compile()
        after, metrics = jax.tree.map(jnp.copy, state), None
        for _ in range(3):
            after, metrics = compiled(after, given)
        ended.append((after, metrics.episodes, {k: v for k, v in metrics.scalars.items() if FAILED not in k}))
        costs.append(compiled.cost_analysis())
        copies.append(compiled.as_text().count(" copy("))
    chex.assert_trees_all_equal(*ended)
    numbers = sum(x.size for x in jax.tree.leaves(state))
    assert costs[1]["flops"] - costs[0]["flops"] <= 3 * numbers
    assert costs[1]["bytes accessed"] - costs[0]["bytes accessed"] <= 6 * 4 * numbers
    assert copies[1] <= copies[0]

    world = state.episodes.state.pipeline_state
    robot = world.env.robot.replace(qvel=world.env.robot.qvel.at[3].set(NAN))
    world = world.replace(env=world.env.replace(robot=robot))
    broken = state.replace(episodes=state.episodes.replace(state=state.episodes.state.replace(pipeline_state=world)))
    after, metrics = compiled(jax.tree.map(jnp.copy, broken), given)
    assert int(metrics.fault) == Fault.ENVIRONMENT and np.isfinite(metrics.scalars["policy_loss"])
    chex.assert_trees_all_equal(after, broken)


def test_nothing_is_noted_where_all_is_finite():
    ends = Ends()
    train(CONFIG, callbacks=[ends])
    assert "faults" not in ends.notes
