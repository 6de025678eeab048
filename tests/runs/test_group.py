"""Groups: what their lanes learn, how they go on, and the ordinary runs that they leave."""

import shutil
from dataclasses import replace

import chex
import numpy as np
import pytest

import t2tl_jax
from t2tl_jax import UserError
from t2tl_jax.networks.task_encoders import OneHotConfig
from t2tl_jax.runs.config import RunConfig, SelectionConfig
from t2tl_jax.runs.group import group_folder, make_group, same_program, train_group
from tests.fake_learner import CONFIG, FakeConfig
from tests.fake_runs import StopAfter, full_disk
from tests.probe import ProbeEnv
from tests.training.test_numbers import DQN, PPO

pytestmark = pytest.mark.slow  # nearly every test compiles a training

CONFIG = replace(
    CONFIG,
    seeds="3,8",
    frames=400,
    run=RunConfig(evaluation_episodes=0),
    selection=SelectionConfig(points=2, episodes=4),
)
RATES = (1e-2, 5e-2)


def runs_in(folder):
    """Two configurations of one program, by the folders of their runs."""
    return {folder / f"rate={rate}": replace(CONFIG, learner=FakeConfig(rate=rate)) for rate in RATES}


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """The runs that a group left, and the second one's configuration trained alone."""
    base = tmp_path_factory.mktemp("group")
    runs = runs_in(base)
    assert train_group(runs, base) == "complete"
    first, second = runs
    return first, second, t2tl_jax.train(runs[second], folder=base / "alone")


def equal(one, other):
    """Two results of the same training; one program has four lanes and the other two, and may round otherwise."""
    assert (one.seeds, one.iteration, one.ended, one.config) == (other.seeds, other.iteration, "complete", other.config)
    chex.assert_trees_all_close(one.params, other.params, rtol=1e-5, atol=1e-6)
    assert one.metrics.keys() == other.metrics.keys()
    for name, values in one.metrics.items():
        np.testing.assert_allclose(values, other.metrics[name], rtol=1e-5, atol=1e-6, err_msg=name)


def test_a_lane_is_the_run_alone(trained):
    first, second, alone = trained
    equal(t2tl_jax.load(second), alone)
    assert {path.name for path in second.iterdir()} == {path.name for path in alone.folder.iterdir()} - {".lock"}
    assert {path.name for path in (second / "tensorboard").iterdir()} == {"seed_3", "seed_8"}
    assert not list(first.parent.glob("group-*"))
    other = t2tl_jax.load(first).params["final"]["params"]["w"]
    assert not np.allclose(other, alone.params["final"]["params"]["w"])


def test_a_run_of_a_group_says_so_in_its_status(trained, read_json):
    _, second, alone = trained
    status, other = read_json(second / "status.json"), read_json(alone.folder / "status.json")
    assert status["group"] == {"runs": 2, "lanes": 4}
    for name in ("state", "ended", "iteration", "iterations", "frames_per_seed", "seeds", "success_since_frames"):
        assert status[name] == other[name], name


def test_a_run_of_a_group_goes_on_as_if_it_had_been_alone(trained, tmp_path):
    _, second, alone = trained
    longer = []
    for source, target in ((second, tmp_path / "group"), (alone.folder, tmp_path / "alone")):
        shutil.copytree(source, target)
        longer.append(t2tl_jax.resume(target, frames=600))
    equal(*longer)
    assert longer[0].iteration == 6


def test_a_group_that_was_stopped_goes_on(trained, tmp_path):
    runs = runs_in(tmp_path)
    assert train_group(runs, tmp_path, callbacks=[StopAfter(3)]) == "enough"
    assert [path.name for path in tmp_path.iterdir()] == [group_folder(runs, tmp_path).name]  # and no run yet
    with pytest.raises(UserError, match="is not a run"):
        t2tl_jax.load(group_folder(runs, tmp_path))
    assert train_group(runs, tmp_path) == "complete"
    for folder, other in zip(runs, trained[:2], strict=True):
        one, whole = t2tl_jax.load(folder), t2tl_jax.load(other)
        chex.assert_trees_all_equal(one.params, whole.params)
        assert (folder / "metrics.csv").read_bytes() == (other / "metrics.csv").read_bytes()


def test_a_splitting_that_was_stopped_goes_on(trained, tmp_path):
    runs = runs_in(tmp_path)
    first, second = runs
    with full_disk(), pytest.raises(OSError, match="the disk is full"):
        train_group(runs, tmp_path)
    assert first.is_dir() and not second.exists()
    assert train_group(runs, tmp_path) == "complete"
    assert {path.name for path in tmp_path.iterdir()} == {first.name, second.name}
    assert (second / "metrics.csv").read_bytes() == (trained[1] / "metrics.csv").read_bytes()


@pytest.mark.parametrize("learner", [PPO, DQN], ids=["ppo", "dqn"])
def test_what_shares_a_program(learner):
    config = replace(CONFIG, learner=learner)
    network = replace(learner.network, task_encoder=OneHotConfig(3))
    for other in (
        replace(config, learner=replace(learner, **{name: value / 2 for name, value in learner.numbers.items()})),
        replace(config, run=RunConfig(gif=False)),
    ):
        assert same_program(config, other)
    assert same_program(replace(config, random_starts=0.5), replace(config, random_starts=0.25))
    for other in (
        replace(config, learner=replace(learner, task_encoder_learning_rate=None)),
        replace(config, learner=replace(learner, anneal_learning_rate=not learner.anneal_learning_rate)),
        replace(config, learner=replace(learner, network=network)),
        replace(config, random_starts=0.5),
        replace(config, frames=401),
        replace(config, seeds="3,9"),
    ):
        assert not same_program(config, other)


def test_every_lane_has_its_own_numbers():
    """Also the discount factor by which the optimum of random tasks is told."""
    variants = [replace(CONFIG, task="F Up", learner=replace(PPO, discount=discount)) for discount in (0.9, 0.5)]
    group = make_group(variants, ProbeEnv())
    assert (group.seeds, group.lanes) == ((3, 8, 3, 8), (0, 1, 2, 3))
    assert group.discounts == (0.9, 0.9, 0.5, 0.5)
    np.testing.assert_array_equal(group.env_params("training").numbers["discount"], np.float32(group.discounts))
    assert group.env_params("evaluation").numbers == {}


def test_other_programs_are_refused():
    with pytest.raises(UserError, match="differ in more than numbers"):
        make_group([CONFIG, replace(CONFIG, episode_length=6)])
