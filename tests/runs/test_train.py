"""`train`, `resume` and `load` from Python: what they return, what they print (nothing), and what they refuse."""

import csv
import dataclasses
import re
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import t2tl_jax
from t2tl_jax import (
    Config,
    ContextConfig,
    DQNConfig,
    NetworkConfig,
    OneHotConfig,
    PPOConfig,
    TransformerConfig,
    UserError,
)
from t2tl_jax.evaluation import episodes
from t2tl_jax.networks.gru import GRUConfig
from t2tl_jax.runs.config import RunConfig, SelectionConfig
from t2tl_jax.runs.experiment import build
from t2tl_jax.runs.metrics_file import FIXED_COLUMNS, history
from t2tl_jax.runs.result import Result
from t2tl_jax.training import kept_trace, program
from t2tl_jax.training.compiler_options import GRAPHS
from tests.diary import Diary, run_fake
from tests.fake_agent import FakeConfig, FakeNetwork
from tests.probe import DiscreteProbeEnv, ProbeEnv

pytestmark = pytest.mark.slow  # nearly every test compiles a training or an evaluation

TASK = "F(Up & F Down)"
TINY = TransformerConfig(layers=1, width=8, heads=1, feed_forward=8, output=4)
NETWORK = NetworkConfig(task_encoder=OneHotConfig(2), env_layers=(8,), actor_layers=(8,), critic_layers=(8,))
PPO = PPOConfig(network=NETWORK, num_envs=8, unroll_length=16, epochs=1, minibatch_size=64, discount=0.9)
FRAMES = PPO.frames_per_iteration


def run_it(**changes):
    """A short training of two seeds on an environment object."""
    return t2tl_jax.train(
        ProbeEnv(), TASK, PPO, **{"seeds": (3, 8), "frames": 3 * FRAMES, "episode_length": 8, **changes}
    )


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """That training, kept in a folder."""
    return run_it(folder=tmp_path_factory.mktemp("run"))


# ----- what comes back -----


def test_options_for_gpus_stand_where_jax_takes_them(run, monkeypatch):
    """On a CPU they mean nothing: whoever compiles is given them, and no number changes."""
    for module in (program, kept_trace, episodes):
        monkeypatch.setattr(module, "compiler_options", lambda: GRAPHS)
    again = run_it()
    for one, other in zip(jax.tree.leaves(run.params), jax.tree.leaves(again.params), strict=True):
        np.testing.assert_array_equal(one, other)
    assert run.evaluate(episodes=4) == again.evaluate(episodes=4)


def test_metrics_are_arrays_by_name(run):
    assert set(FIXED_COLUMNS) - {"iteration", "seed"} <= run.metrics.keys()
    assert {"policy_loss", "value_loss", "entropy"} <= run.metrics.keys()
    for values in run.metrics.values():
        assert values.shape == (2, 3) and values.dtype == np.float64
    np.testing.assert_array_equal(run.metrics["frames"], [[FRAMES, 2 * FRAMES, 3 * FRAMES]] * 2)
    assert run.seeds == (3, 8) and run.iteration == 3 and run.ended == "complete"
    assert run.success_since == {3: None, 8: None}
    assert all(leaf.shape[0] == 2 for leaf in jax.tree.leaves(run.params))


def test_a_policy_is_the_agents_own(run):
    agent, table = run.experiment.agent, run.experiment.table
    for index, seed in enumerate(run.seeds):
        params = jax.tree.map(lambda leaf, index=index: leaf[index], run.params["final"])
        obs, rows, key = jnp.ones((4, 3)), jnp.array([2, 3, 2, 3]), jax.random.key(5)
        policy, embedding = run.policy(seed), agent.embed(params, table)
        for chosen, deterministic in ((policy(obs, rows), True), (policy(obs, rows, key=key), False)):
            expected = agent.act(params, embedding, (), obs, rows, key, deterministic)
            np.testing.assert_allclose(chosen, expected, atol=1e-6)


def test_policies_go_through_jit_and_vmap(run):
    policy = run.policy(8)
    obs, rows = jnp.linspace(-1, 1, 12).reshape(4, 3), jnp.array([2, 3, 3, 2])
    together = policy(obs, rows)
    jitted = jax.jit(lambda policy, obs, rows: policy(obs, rows))(policy, obs, rows)
    mapped = jax.vmap(policy)(obs, rows)
    for action in (jitted, mapped):
        np.testing.assert_allclose(action, together, atol=1e-6)
    assert together.shape == (4, 1) and policy(obs[0], 2).shape == (1,)


def test_a_policy_takes_a_formula(run):
    policy = run.policy()
    np.testing.assert_array_equal(policy(jnp.ones(3), TASK), policy(jnp.ones(3), policy.row(TASK)))
    assert policy.row("F Down") == policy.row("F(Down)") != policy.row(TASK)
    with pytest.raises(UserError, match=r"no row of this policy's table; its rows: .*F Down.*run.policy\(seed, task="):
        policy(jnp.ones(3), "F Up")
    assert run.policy(3, task="F Up").row("F Up") == 2
    with pytest.raises(UserError, match="no seed 4; its seeds: 3, 8"):
        run.policy(4)


def test_a_task_that_the_network_cannot_read_is_refused(run):
    with pytest.raises(UserError, match=r"(?s)cannot read .*choose a task within them"):
        run.policy(task="F(Up & F(Down & F Up))")
    with pytest.raises(UserError, match="Sideways"):
        run.evaluate(task="F Sideways")


@pytest.mark.slow
def test_evaluation_of_result_and_folder_agree(run):
    reports = run.evaluate(task="F Down", episodes=6)
    again = t2tl_jax.evaluate(t2tl_jax.load(run.folder, env=ProbeEnv()), task="F Down", episodes=6)
    assert reports == again and set(reports) == {"deterministic", "sampled"}
    assert [one.seed for one in reports["sampled"].seeds] == [3, 8]
    assert reports["sampled"].seeds[0].success_rate.count == 6


@pytest.mark.slow
def test_without_a_folder_nothing_is_written_or_printed(tmp_path, monkeypatch, capsys):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    result = run_fake()
    assert capsys.readouterr() == ("", "")
    assert not list(Path.cwd().iterdir()) and result.folder is None
    jax.tree.map(np.testing.assert_array_equal, result.params, run_fake(folder=tmp_path / "run").params)


def test_a_configuration_does_not_hold_an_environment_object(run):
    config = dataclasses.replace(run.config, frames=FRAMES)
    with pytest.raises(UserError, match="ProbeEnv, was given as an object: give it again"):
        t2tl_jax.train(config)


# ----- a run on disk -----


def test_load_gives_the_same_result(run):
    loaded = t2tl_jax.load(run.folder, env=ProbeEnv())
    assert loaded.config == run.config and loaded.seeds == run.seeds
    assert (loaded.iteration, loaded.ended) == (
        run.iteration,
        run.ended,
    ) and loaded.success_since == run.success_since
    jax.tree.map(np.testing.assert_array_equal, loaded.params, run.params)
    assert loaded.metrics.keys() == run.metrics.keys()
    for name, values in run.metrics.items():  # the file keeps nine digits
        np.testing.assert_allclose(loaded.metrics[name], values, rtol=1e-8, err_msg=name)
    np.testing.assert_array_equal(loaded.policy(8)(jnp.ones(3), 2), run.policy(8)(jnp.ones(3), 2))


def test_a_given_environment_is_to_be_given_again(run):
    for again in (t2tl_jax.load, t2tl_jax.resume, t2tl_jax.evaluate):
        with pytest.raises(UserError, match=r"environment of this run, ProbeEnv, was given as an object.*env=\.\.\."):
            again(run.folder)


def test_resume_of_a_complete_run_trains_no_more(run):
    diary = Diary()
    again = t2tl_jax.resume(run.folder, env=ProbeEnv(), callbacks=[diary])
    assert [entry[0] for entry in diary.entries] == ["plan", "end"] and again.iteration == 3
    with pytest.raises(UserError, match=r"a resumed run keeps its configuration.*not task"):
        t2tl_jax.resume(run.folder, env=ProbeEnv(), task="F Up")


def test_frames_as_a_float_are_stored_as_a_whole_number(tmp_path):
    assert run_fake(frames=2e2, folder=tmp_path / "run").iteration == 2
    assert t2tl_jax.resume(tmp_path / "run", env=ProbeEnv(), frames=3e2).iteration == 3


@pytest.mark.slow
def test_resumed_equals_uninterrupted(run, tmp_path):
    stopped = run_it(folder=tmp_path / "run", callbacks=[Diary(stop_at=1)])
    assert (stopped.iteration, stopped.ended) == (1, "enough")
    assert t2tl_jax.load(tmp_path / "run", env=ProbeEnv()).ended == "enough"
    diary = Diary()
    resumed = t2tl_jax.resume(tmp_path / "run", env=ProbeEnv(), callbacks=[diary])
    assert diary.entries[1:3] == [("start", 1), ("iteration", 2)]
    jax.tree.map(np.testing.assert_array_equal, resumed.params, run.params)
    assert (tmp_path / "run" / "metrics.csv").read_bytes() == (run.folder / "metrics.csv").read_bytes()
    for name, values in run.metrics.items():
        np.testing.assert_allclose(resumed.metrics[name], values, rtol=1e-8, err_msg=name)


def test_metrics_files_go_by_names(run, tmp_path):
    """A further column, other places, and a column that an old version did not write."""
    with open(run.folder / "metrics.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    header = ["extra", *reversed([name for name in rows[0] if name != "entropy"])]
    with open(tmp_path / "metrics.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, header, extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        writer.writerows({**row, "extra": 7} for row in rows)
    before, after = history(run.folder / "metrics.csv"), history(tmp_path / "metrics.csv")
    assert after.keys() == (before.keys() - {"entropy"}) | {"extra"} and (after["extra"] == 7).all()
    for name in before.keys() & after.keys():
        np.testing.assert_array_equal(after[name], before[name], err_msg=name)


# ----- ends -----


@pytest.mark.slow
def test_until_solved_ends_a_solved_training(tmp_path):
    """The task comes true by chance: the policy begins with a wide spread, and an episode has 40 steps."""
    easy = {"seeds": 2, "frames": 40 * FRAMES, "episode_length": 40, "until_solved": True}
    solved = t2tl_jax.train(ProbeEnv(), "F(Up | Down)", PPO, folder=tmp_path / "run", **easy)
    assert solved.ended == "success" and 5 <= solved.iteration < 40
    assert (solved.metrics["success_rate"][:, -5:] > 0.95).all()
    since = list(solved.success_since.values())
    assert all(since) and max(since) == (solved.iteration - 4) * FRAMES
    assert t2tl_jax.load(tmp_path / "run", env=ProbeEnv()).success_since == solved.success_since


# ----- memory -----


def remembering():
    """The policy of T2TL, with a window of two steps: as of a run, with parameters that nobody trained."""
    context = ContextConfig(length=2, reader=TINY, segment_length=4)
    learner = dataclasses.replace(PPO, network=dataclasses.replace(NETWORK, context=context))
    experiment = build(Config(env=t2tl_jax.EnvConfig(), task=TASK, learner=learner), ProbeEnv())
    draws = np.random.default_rng(0)
    params = jax.tree.map(lambda x: draws.normal(size=x.shape).astype(x.dtype), experiment.params_shapes)
    return Result(experiment, {"final": params}, metrics={}, iteration=0).policy()


@pytest.mark.slow
def test_a_policy_with_memory_begins_and_remembers():
    policy, obs = remembering(), jnp.ones(3)
    act = jax.jit(lambda policy, carry: policy(obs, 2, carry=carry))
    carry = policy.begin()
    action = act(policy, carry)
    after = policy.remember(carry, obs, action, jnp.float32(0))
    assert jax.tree.map(jnp.shape, after) == jax.tree.map(jnp.shape, carry)
    assert after.valid.tolist() == [False, True]
    assert not np.array_equal(act(policy, after), action)  # what was seen counts
    np.testing.assert_allclose(policy(obs, 2, carry=after), act(policy, after), atol=1e-6)
    with pytest.raises(UserError, match=r"remembers its episode: pass carry=policy.begin\(\)"):
        policy(obs, 2)


# ----- pre-training -----


@pytest.mark.slow
def test_a_pretraining_given_as_a_result_is_where_the_encoder_comes_from():
    """Of a learner that keeps to the encoder which it began with."""

    def trained(pretrained="", **network):
        learner, nothing = FakeConfig(FakeNetwork(**network)), SelectionConfig(points=0)
        return t2tl_jax.train(ProbeEnv(), TASK, learner, frames=200, pretrained=pretrained, selection=nothing)

    first = trained(task_encoder=TINY)
    second = trained(task_encoder=TINY, freeze_task_encoder=True, pretrained=first)
    reader, adopted = (of["params"]["task_encoder"]["b"] for of in (first.params["best"], second.params["final"]))
    assert np.all(reader != 0)  # as it would have begun
    np.testing.assert_array_equal(adopted, reader)
    with pytest.raises(UserError, match="trained a task encoder of kind transformer, and this run has gru"):
        trained(task_encoder=GRUConfig(), pretrained=first)


# ----- mistakes -----


@pytest.mark.parametrize(
    ("arguments", "changes", "said"),
    [
        (("zone_pppo",), {}, "unknown config 'zone_pppo'; did you mean 'zone_ppo'"),
        (("zone_ppo",), {"fraems": 3}, "no field 'fraems'; did you mean 'frames'"),
        ((ProbeEnv(),), {}, "an environment needs a task and a learner"),
        ((ProbeEnv(), TASK), {}, "an environment needs a task and a learner"),
        ((3,), {}, "train takes the name of a configuration, a Config or a LabelledEnv, got a int"),
        ((ProbeEnv(), "F Upp", PPO), {}, "Up"),
        ((ProbeEnv(), "F(", PPO), {}, "F\\("),
        ((ProbeEnv(), "true", PPO), {}, "true from the start"),
        ((ProbeEnv(), TASK, PPO), {"frames": 0}, "frames must be at least 1"),
        ((ProbeEnv(), TASK, PPO), {"frames": 200.5}, "frames must be a whole number, got 200.5"),
        ((ProbeEnv(), TASK, PPO), {"seeds": ()}, "seeds"),
        ((ProbeEnv(), TASK, PPO), {"seeds": (1, 1)}, "every seed may appear once"),
        ((ProbeEnv(), TASK, PPO), {"seeds": 0}, "number of seeds"),
        ((ProbeEnv(), TASK, "ppo"), {}, "learner"),
        (
            (DiscreteProbeEnv(), TASK, DQNConfig(num_envs=1)),
            {"run": RunConfig(devices_per_seed=2)},
            r"a seed has one environment, and nothing to spread, got run.devices_per_seed=2; .*\(learner.num_envs\)",
        ),
        (
            (ProbeEnv(), TASK, FakeConfig()),
            {"run": RunConfig(devices_per_seed=2)},
            "this learner does not spread a seed, got run.devices_per_seed=2; .* PPO and DQN can spread a seed",
        ),
        ((ProbeEnv(), TASK, PPO), {"pretrained": "nowhere"}, "a code without parameters cannot be pre-trained"),
        ((ProbeEnv(), TASK, PPOConfig()), {"pretrained": "nowhere"}, "there is no folder"),
    ],
)
def test_mistakes_are_named_before_any_work(arguments, changes, said, tmp_path):
    with pytest.raises(UserError, match=said):
        t2tl_jax.train(*arguments, folder=tmp_path / "run", **changes)
    assert not (tmp_path / "run").exists()


def test_a_folder_that_is_in_use_is_refused(run, tmp_path):
    with pytest.raises(UserError, match=r"is not empty \(resume continues a run\)"):
        run_it(folder=run.folder)
    (tmp_path / "file").touch()
    with pytest.raises(UserError, match=r"is not empty; a new run needs a folder of its own"):
        run_it(folder=tmp_path)
    with pytest.raises(UserError, match=re.escape(f"there is no folder {tmp_path / 'none'}")):
        t2tl_jax.load(tmp_path / "none")
    with pytest.raises(UserError, match="no field 'tsak'; did you mean 'task'"):
        t2tl_jax.load(run.folder, env=ProbeEnv(), tsak="F Up")


def test_config_is_a_value():
    config = Config(env=t2tl_jax.EnvConfig(), task=TASK, learner=PPO)
    assert config.iterations == -(-10_000_000 // FRAMES)
