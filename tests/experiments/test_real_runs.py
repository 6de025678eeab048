"""The command line with the real environments and learners, at reduced size."""

import dataclasses
import functools
import itertools
import json

import chex
import jax
import numpy as np
import pytest

from envs.zones import ZoneConfig
from experiments import attention, compare, evaluate, methods, run
from t2tl_jax.agents.dqn_config import DQNConfig
from t2tl_jax.errors import UserError
from t2tl_jax.networks.transformer import TransformerConfig
from t2tl_jax.registry import configs, named_config
from t2tl_jax.runs import folder as run_folder
from t2tl_jax.runs.checkpoints import Checkpoints
from t2tl_jax.runs.config import PoolConfig, RunConfig
from t2tl_jax.runs.experiment import build
from t2tl_jax.training.devices import place

pytestmark = pytest.mark.slow

SMALL = ("--learner.network.task-encoder.layers", "1", "--episode-length", "40", "--run.progress", "False")
SMALL_LEARNER = {
    "zone_ppo_closed_form": (
        *("--learner.num-envs", "8", "--learner.unroll-length", "32", "--learner.minibatch-size", "128"),
        *("--learner.epochs", "2", "--learner.noise-time", "0", "--learner.network.context", "None"),
        *("--pretrained", ""),
    ),
    "waterworld_dqn": (
        *("--learner.num-envs", "8", "--learner.unroll-length", "32", "--learner.batch-size", "16"),
        *("--learner.buffer-size", "512", "--learner.learning-starts", "64", "--learner.epsilon-start", "0.02"),
        *("--learner.anneal-learning-rate", "False"),
        *("--learner.network.state-layers", "16", "--learner.network.task-layer", "16"),
        *("--pretrained", "", "--learner.network.freeze-task-encoder", "False"),
        *("--selection.points", "1"),  # the last parameters, without another program that scores them: PPO has one
    ),
}
SHIPPED = [name for name in configs() if "fake" not in name]
COMPILED = ("zone_ppo_published", "rm_water_crm")
"""What is compiled nowhere else: every choice of the published code, MJX inside a learner, and the published updates of
reward machines. Those of SMALL_LEARNER run below, encoders and contexts in `tests/agents`, pre-training in
`test_pretraining.py`, random maps in `tests/envs`."""

IN_MJX = "zone_ppo_published"
"""The others have the closed form, which traces and compiles faster: the physics is the same inside of each."""


def reduced(name: str, method: str = ""):
    config = methods.apply(named_config(name), method) if method else named_config(name)
    network = config.learner.network
    if isinstance(network.task_encoder, TransformerConfig):
        network = dataclasses.replace(network, task_encoder=dataclasses.replace(network.task_encoder, layers=1))
    if network.context is not None:
        shallow = dataclasses.replace(network.context.reader, layers=1 + network.context.halved)
        context = dataclasses.replace(network.context, reader=shallow, segment_length=1)
        network = dataclasses.replace(network, context=context)
    env = dataclasses.replace(config.env, pool_size=8) if hasattr(config.env, "pool_size") else config.env
    if isinstance(env, ZoneConfig) and name != IN_MJX:
        env = dataclasses.replace(env, physics="closed_form")
    if isinstance(config.learner, DQNConfig):
        sizes = {"num_envs": 4, "unroll_length": 8, "batch_size": 16, "buffer_size": 48, "learning_starts": 8}
    else:
        sizes = {"num_envs": 4, "unroll_length": 8, "minibatch_size": 16, "epochs": 1}
    learner = dataclasses.replace(config.learner, network=network, **sizes)
    pool = PoolConfig(size=4, rows=64, length=48)
    return dataclasses.replace(config, learner=learner, env=env, pool=pool, frames=64, episode_length=10, seeds="1")


def narrow(config):
    """The same with layers of 16 where they are free, for learners that run: those of DQN are of 512."""
    if not isinstance(config.learner, DQNConfig):
        return config
    network = config.learner.network
    network = dataclasses.replace(network, state_layers=(16,) * len(network.state_layers), task_layer=16)
    return dataclasses.replace(config, learner=dataclasses.replace(config.learner, network=network))


@functools.cache
def compiled(config, seeds):
    """The program of the configuration for these seeds, and its functions."""
    program = build(dataclasses.replace(config, seeds=",".join(map(str, seeds)) + ",")).program
    return program, program.lowered_init.compile(), program.lowered_iterate.compile()


def iterate_once(config, seeds):
    program, init, iterate = compiled(config, seeds)
    return iterate(init(program.keys, program.env_params), program.env_params)


OTHER_NETWORKS = (
    *itertools.product(("zone_ppo_closed_form", "waterworld_dqn"), ("gnn", "dfa_cont")),
    ("waterworld_dqn_paper", "t2tl"),
)


@pytest.mark.parametrize(
    ("name", "method"), [*((name, "") for name in SHIPPED if name not in COMPILED), *OTHER_NETWORKS]
)
def test_every_config_is_sound(name, method):
    """Traced, which runs everything but the arithmetic: shapes and dtypes fit, and an iteration keeps the state's."""
    config = reduced(name, method)
    outside = {"pretrained": config.pretrained and "auto", "pretraining_schedule": "short", "run": RunConfig()}
    chex.assert_trees_all_equal_shapes_and_dtypes(*one_iteration(dataclasses.replace(config, **outside)))


@functools.cache
def one_iteration(config):
    """The shapes of a training state before and after; configurations that differ outside of training share them."""
    experiment = build(config)
    agent, env_params = experiment.agent, experiment.task_env.make_params(1)
    state = jax.eval_shape(agent.init, jax.eval_shape(jax.random.key, 0), env_params)
    return state, jax.eval_shape(agent.iterate, state, env_params)[0]


@pytest.mark.parametrize("name", COMPILED)
def test_configs_train_one_iteration(name):
    config = narrow(reduced(name))
    state, metrics = iterate_once(config, (1,))
    assert all(np.isfinite(value).all() for value in metrics.scalars.values())
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(state.params))


def one_step_of_ppo():
    """A learner whose seeds can be compared.

    One step of physics, since the robot's yaw servo is unstable, so that rounding (1e-5 in velocity after one step)
    grows to 1e-3 in position within eight. And Adam divides by the size of a gradient: with its usual epsilon, one that
    is zero but for rounding moves a parameter by a whole learning rate. What remains is the learner itself.
    """
    config = reduced("zone_ppo_closed_form", "dfa")  # other networks in `tests/agents`
    sizes = {"num_envs": 16, "unroll_length": 1, "minibatch_size": 8, "epochs": 2}
    return dataclasses.replace(config, learner=dataclasses.replace(config.learner, **sizes, adam_epsilon=1e-2))


def test_vmapped_seeds_equal_single_seeds():
    many, _ = iterate_once(one_step_of_ppo(), (0, 3, 7))
    single, _ = iterate_once(one_step_of_ppo(), (3,))
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a[1], b[0], rtol=0, atol=1e-6), many.params, single.params)


def bits(state):
    """Every array of a training state on the host, keys as their data."""

    def plain(x):
        x = jax.random.key_data(x) if jax.dtypes.issubdtype(x.dtype, jax.dtypes.prng_key) else x
        return np.array(x, copy=True)

    return jax.tree.map(plain, state)


@pytest.mark.parametrize("config", [one_step_of_ppo(), narrow(reduced("waterworld_dqn", "rm"))], ids=["ppo", "dqn"])
def test_a_checkpoint_holds_everything(config, tmp_path):
    """Also the replay buffer, which the second iteration of DQN wraps around, the exploration noise and the schedules.

    Of windows see `tests/agents/test_ppo_context.py`.
    """
    program, init, iterate = compiled(config, (0, 3, 7))  # of PPO also for the test of seeds
    env_params = program.env_params
    state, _ = iterate(init(program.keys, env_params), env_params)
    with Checkpoints(tmp_path) as checkpoints:
        checkpoints.save(1, state, {})
        straight, metrics = iterate(state, env_params)
        iteration, restored = checkpoints.restore(program.state)
    resumed, same_metrics = iterate(place(restored, program.sharding), env_params)
    assert iteration == 1
    jax.tree.map(np.testing.assert_array_equal, bits(straight), bits(resumed))
    jax.tree.map(np.testing.assert_array_equal, metrics, same_metrics)


@pytest.fixture
def train(tmp_path):
    """Trains two seeds of a configuration at reduced size and returns the new folder."""

    def command(name: str, *more: str):
        flags = ["--config", name, "--run.folder", str(tmp_path / "runs"), "--frames", "512", *SMALL]
        assert run.main([*flags, *SMALL_LEARNER[name], "--seeds", "2", *more]) == 0
        (made,) = (tmp_path / "runs" / name).iterdir()
        return made

    return command


def test_ppo_trains_draws_and_can_be_read(train):
    """By the run itself. That it resumes is shown by its checkpoint above, and for commands by `test_pretraining.py`.

    The command that evaluates has a run of PPO in `tests/runs/test_run_of_0_1.py`, also in other physics; one that
    evaluates by itself is in `test_pretraining.py`.
    """
    folder = train("zone_ppo_closed_form", "--run.evaluation-episodes", "0")
    assert (folder / "episode.gif").exists()
    assert compare.main([str(folder)]) == 0
    can_be_read(folder)


def test_dqn_trains_evaluates_and_draws(train):
    """By commands, one after another, and on a task that it was not trained on."""
    name = "waterworld_dqn"
    folder = train(name, "--run.evaluation-episodes", "0", "--run.gif", "False")
    flags = ["--episodes", "4", "--which", "final", "--gif", "True"]
    assert evaluate.main([str(folder), *flags, "--task", "F(Yellow & F Purple)"]) == 0
    assert (folder / "episode.gif").exists() and (folder / "evaluation.json").read_text() != ""
    assert compare.main([str(folder)]) == 0


def can_be_read(folder):
    """The attention of its second seed, and of all; `tests/evaluation/test_attention.py` checks the numbers."""
    flags = ["--seed", "1", "--which", "final", "--episodes", "4", "--all-seeds", "True"]
    assert attention.main([str(folder), *flags]) == 0
    assert (folder / "attention.png").stat().st_size > 10_000
    read = json.loads((folder / "attention.json").read_text())
    assert np.shape(read["attention_end"]["by_head"]) == (8, len(read["tokens"]))
    for then in (read["attention_start"], read["attention_end"]):
        np.testing.assert_allclose(np.sum(then["by_head"], axis=1), 1.0, atol=1e-5)
    # So short a run meets no reward, from which nothing is learned: its network is still the one it began with.
    np.testing.assert_allclose(read["attention_start"]["by_head"], read["attention_end"]["by_head"], atol=1e-5)
    assert (folder / "attention_projections.png").stat().st_size > 10_000
    with np.load(folder / "attention_projections.npz") as weights:  # the start is made anew, from the seed: exactly
        assert weights["start"].shape == weights["end"].shape == (1, 8, 8, 64)
        np.testing.assert_array_equal(weights["start"], weights["end"])
        assert not weights["relative_change"].any()
    assert read["observations"] == 4 and read["observations_met_in_row"]
    assert min(read["removal_policy"]) >= 0 and max(read["removal_policy"]) > 0
    for stage in ("start", "end"):
        over_seeds = read["over_seeds"][stage]
        assert over_seeds["seeds"] == [0, 1] and over_seeds["tokens"] == read["tokens"]
        assert sum(share["value"] for share in over_seeds["first"].values()) == pytest.approx(1.0)
    assert read["out_projection_change"] == {"seeds": [0, 1], "by_layer": [[0.0], [0.0]]}
    lines = (folder / "attention.csv").read_text().splitlines()
    assert len(lines) == 1 + 2 * 2 * 3  # stages, seeds, sub-tasks of phi_zone


def test_only_zones_have_a_choice_of_physics(tmp_path, capsys):
    folder = run_folder.create(tmp_path / "waterworld_dqn", named_config("waterworld_dqn"), {})
    assert evaluate.main([str(folder.path), "--physics", "mjx"]) == 2
    assert "the environment of this run offers no choice" in capsys.readouterr().err


def test_dqn_refuses_continuous_actions():
    water = named_config("waterworld_dqn")
    with pytest.raises(UserError, match="needs discrete actions"):
        build(dataclasses.replace(water, env=named_config("zone_ppo").env, task="phi_zone"))


def test_ppo_trains_where_actions_are_discrete():
    water = dataclasses.replace(reduced("waterworld_dqn"), learner=reduced("zone_ppo").learner)
    state, after = one_iteration(water)  # tracing runs everything but the arithmetic
    assert state.params["params"]["actor"]["logits"]["kernel"].shape == (64, 5) and state.noise is None
    chex.assert_trees_all_equal_shapes_and_dtypes(state, after)
