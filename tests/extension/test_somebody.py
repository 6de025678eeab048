"""An environment, an encoder, a learner, a logger and a family of somebody else, through the public functions alone."""

import csv
import dataclasses
import json
import os
import subprocess
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from somebody import learner
from somebody.encoder import Bag, BagConfig
from somebody.learner import LogitsConfig, ReinforceConfig
from somebody.logger import JSONLines
from somebody.world import Lamps, LampsConfig

import t2tl_jax
from experiments import compare, evaluate
from experiments.cli import request
from t2tl_jax import Config, EnvConfig, NetworkConfig, PPOConfig, UserError
from t2tl_jax.registry import named_config
from t2tl_jax.runs import experiment as experiments_of_runs
from t2tl_jax.runs import pretraining
from t2tl_jax.runs.config import SelectionConfig
from t2tl_jax.runs.config_files import from_json, to_json
from t2tl_jax.training.program import trace

pytestmark = pytest.mark.slow  # nearly every test compiles a training or an evaluation

HERE = Path(__file__).parent
ROOT = HERE.parents[1]

PPO = PPOConfig(
    network=NetworkConfig(task_encoder=BagConfig(), env_layers=(8,), actor_layers=(8,), critic_layers=(8,)),
    num_envs=8,
    unroll_length=8,
    epochs=1,
    minibatch_size=64,
)


SINGLE_STATE = dataclasses.replace(
    PPO, network=dataclasses.replace(PPO.network, env_layers=(), actor_layers=(), critic_layers=())
)


@pytest.fixture(scope="module")
def result(config, tmp_path_factory):
    """Trained by value, with somebody's logger; and the file that it wrote."""
    log = tmp_path_factory.mktemp("log") / "rows.jsonl"
    return t2tl_jax.train(config, callbacks=[JSONLines(log)]), log


def assert_same_run(a: t2tl_jax.Result, b: t2tl_jax.Result) -> None:
    """Equal parameters; equal metrics, of which a file keeps nine digits."""
    assert a.config.task == b.config.task and a.seeds == b.seeds and a.iteration == b.iteration
    jax.tree.map(np.testing.assert_array_equal, a.params, b.params)
    assert a.metrics.keys() == b.metrics.keys()
    for name, values in a.metrics.items():
        np.testing.assert_allclose(values, b.metrics[name], rtol=1e-8, err_msg=name)


# ----- by value and by name -----


def test_train_by_value(result, config):
    trained, _ = result
    assert trained.config == config and trained.iteration == 3 and trained.ended == "complete"
    assert {"loss", "env_burning", "success_rate", "frames"} <= trained.metrics.keys()
    assert all(values.shape == (2, 3) for values in trained.metrics.values())
    burning = trained.metrics["env_burning"]
    assert (burning > 0).all() and (burning < 2).all()


def test_the_name_gives_the_same_training(result, config):
    trained, _ = result
    assert_same_run(trained, t2tl_jax.train("lights", seeds=2, frames=config.frames))


def test_own_logger_sees_every_row(result):
    trained, log = result
    rows = [json.loads(line) for line in log.read_text().splitlines()]
    assert [(row["iteration"], row["seed"]) for row in rows] == [(i, s) for i in (1, 2, 3) for s in (0, 1)]
    for name in ("env_burning", "loss", "frames"):
        np.testing.assert_array_equal(np.array([row[name] for row in rows]).reshape(3, 2).T, trained.metrics[name])


def test_what_varies_between_seeds_arrives(result):
    """The first seeds of `Lamps` begin with one lamp on, each with another."""
    state = result[0].experiment.env_params("training")
    np.testing.assert_array_equal(state.env, [[True, False], [False, True]])


# ----- the command line, and a run on disk -----


def test_command_line_trains_the_same(result, stored):
    trained, _ = result
    assert_same_run(trained, t2tl_jax.load(stored))
    with open(stored / "metrics.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["env_burning"]) for row in rows] == pytest.approx(list(trained.metrics["env_burning"].T.ravel()))


def test_stored_configuration_names_the_kinds(stored):
    content = json.loads((stored / "config.json").read_text())
    assert content["env"] == {"kind": "lamps", "count": 2}
    assert content["learner"]["kind"] == "reinforce"
    assert content["learner"]["network"]["task_encoder"] == {"kind": "bag", "size": 8}


def test_loaded_run_is_played_in_three_lines(result, stored):
    run = t2tl_jax.load(stored)
    policy = run.policy(seed=1)
    action = policy(jnp.zeros(2), run.config.task)
    assert action == result[0].policy(1)(jnp.zeros(2), run.config.task) and 0 <= action < 3


@pytest.mark.slow
def test_resumed_equals_uninterrupted(result, config, tmp_path):
    whole, _ = result
    half = dataclasses.replace(config, frames=config.frames // 3)
    first = t2tl_jax.train(half, folder=tmp_path / "run")
    assert first.iteration == 1
    assert_same_run(whole, t2tl_jax.resume(tmp_path / "run", frames=config.frames))
    assert_same_run(whole, t2tl_jax.load(tmp_path / "run"))


@pytest.mark.slow
def test_evaluate_and_compare_commands(stored, capsys):
    evaluated = json.loads((stored / "evaluation.json").read_text())["evaluations"]
    assert evaluated[0]["settings"]["physics"] == "lamps"
    flags = ["--import", "somebody", "--episodes", "3", "--task", "F lamp2"]
    assert evaluate.main([str(stored), *flags]) == 0
    assert len(json.loads((stored / "evaluation.json").read_text())["evaluations"]) == len(evaluated) + 2  # final, best
    assert compare.main(["--import", "somebody", str(stored), "--last", "1"]) == 0
    assert str(stored) in capsys.readouterr().out


# ----- flags, help, lists -----


def configured(*flags: str) -> Config:
    asked = request.read(["--import", "somebody", *flags])
    return request.configuration(asked, "", "run")[0]


def test_flags_choose_and_set_every_kind():
    config = configured(
        *("--config", "zone_ppo", "--pretrained", "", "--env", "lamps", "--env.count", "3", "--learner", "reinforce"),
        *("--learner.num-envs", "4", "--learner.network.width", "5", "--task", "F(lamp1 & lamp3)"),
        *("--learner.network.task-encoder", "bag", "--learner.network.task-encoder.size", "6"),
    )
    wanted = ReinforceConfig(network=LogitsConfig(task_encoder=BagConfig(6), width=5), num_envs=4)
    assert config.env == LampsConfig(3) and config.learner == wanted
    assert from_json(to_json(config), "it") == config


def test_own_encoder_in_the_projects_learner():
    config = configured("--config", "lights", "--learner", "ppo", "--learner.network.task-encoder", "bag")
    assert config.learner == PPOConfig(network=NetworkConfig(task_encoder=BagConfig()))
    own = configured("--config", "lights", "--learner.network.task-encoder", "gru")
    assert type(own.learner.network.task_encoder).__name__ == "GRUConfig"


def test_help_shows_own_fields(capsys):
    with pytest.raises(SystemExit) as end:
        configured("--config", "lights", "--help")
    assert end.value.code == 0
    text = " ".join(capsys.readouterr().out.split())
    for said in (
        "--env.count",
        "Lamps, called lamp1",
        "--learner.network.task-encoder.size",
        "--learner.network.width",
    ):
        assert said in text


@pytest.mark.slow
def test_another_process_knows_them_by_import():
    command = [sys.executable, "-m", "experiments.run", "--import", "somebody", "--list"]
    paths = os.pathsep.join([str(ROOT), str(HERE)])
    environment = os.environ | {"PYTHONPATH": paths}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=True, timeout=120)
    kinds = {line.partition(": ")[0]: line.partition(": ")[2].split(", ") for line in done.stdout.splitlines()}
    assert "lamps" in kinds["environments"] and "zones" in kinds["environments"]
    assert "reinforce" in kinds["learners"] and "bag" in kinds["task encoders"]
    assert "somebody's lamps, by somebody's learner" in done.stdout


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (("--env", "lamp"), "did you mean 'lamps'"),
        (("--learner", "reinforced"), "did you mean 'reinforce'"),
        (("--learner.network.task-encoder", "bug"), "did you mean 'bag'"),
        (("--env.cuont", "3"), "did you mean '--env.count'"),
        (("--env.count", "0"), "count must be at least 1, got 0"),
    ],
)
def test_mistakes_are_answered_with_the_nearest_name(flags, said):
    with pytest.raises(UserError, match=said):
        configured("--config", "lights", *flags)


def test_named_environments():
    assert t2tl_jax.make_env("lamps").config == LampsConfig()
    assert t2tl_jax.make_env("Lamps-3").propositions == ("lamp1", "lamp2", "lamp3")
    with pytest.raises(UserError, match="did you mean 'Lamps-3'"):
        t2tl_jax.make_env("Lamps3")


# ----- families, and other learners -----


@pytest.mark.slow
def test_own_family_trains_the_projects_learner(config):
    pool = dataclasses.replace(config.pool, size=2, rows=32, length=8, period=1)
    trained = t2tl_jax.train(config, "Lights", PPO, seeds=1, pool=pool, frames=2 * PPO.frames_per_iteration)
    assert trained.iteration == 2 and trained.metrics["env_burning"].shape == (1, 2)


def test_a_learner_without_restart_refuses_families(config):
    with pytest.raises(UserError, match=r"Lights is a family of random tasks.*offers no `restart`"):
        t2tl_jax.train(config, "Lights", pool=dataclasses.replace(config.pool, size=2))


# ----- everything is built once -----


@pytest.fixture
def tables(monkeypatch):
    """The tasks of all tables that are compiled; environments and learners count theirs from 0, too."""
    tasks, make_table = [], experiments_of_runs.make_table

    def counted(config, env):
        tasks.append(config.task)
        return make_table(config, env)

    monkeypatch.setattr(experiments_of_runs, "make_table", counted)
    monkeypatch.setattr(Lamps, "built", 0)
    monkeypatch.setattr(learner, "built", [])
    return tasks


@pytest.mark.slow
def test_one_command_builds_everything_once(tables, config, command):
    folder = command("--run.gif", "True")
    assert (folder / "evaluation.json").exists()
    assert (Lamps.built, tables, len(learner.built)) == (1, [config.task], 1)


@pytest.mark.slow
def test_so_does_its_pretraining(tables, config, monkeypatch, tmp_path):
    """The environment of a pre-training is another one; its table comes after the run's own."""
    none = SelectionConfig(points=0)
    small = dataclasses.replace(named_config("pretrain_zone"), learner=SINGLE_STATE, frames=64, selection=none)
    monkeypatch.setattr(pretraining, "SCHEDULE", small)
    traced = []
    monkeypatch.setattr(experiments_of_runs, "trace", lambda *given, **more: traced.append(1) or trace(*given, **more))
    once = t2tl_jax.train(config, pretrained="auto:F lamp1", seeds=1, frames=1, folder=tmp_path / "run")
    assert (Lamps.built, tables, len(learner.built), len(traced)) == (1, [config.task, "F lamp1"], 1, 2)
    before = t2tl_jax.load(tmp_path / "run" / "pretraining")
    assert before.ended == "complete" and before.config.env.propositions == ("lamp1", "lamp2")
    again = t2tl_jax.train(config, pretrained=before.folder, seeds=1, frames=1)
    given = t2tl_jax.train(config, pretrained=before, seeds=1, frames=1)
    for other in (again, given):
        jax.tree.map(np.testing.assert_array_equal, other.params, once.params)


# ----- what cannot be registered -----


def test_names_and_classes_belong_to_one_kind():
    @dataclasses.dataclass(frozen=True)
    class Other(EnvConfig):
        """Another kind."""

    with pytest.raises(ValueError, match=r"cannot register the environment 'lamps' with .*Other"):
        t2tl_jax.register_env("lamps", Other, Lamps)
    with pytest.raises(ValueError, match=r"cannot register the environment 'lamps2'"):
        t2tl_jax.register_env("lamps2", LampsConfig, Lamps)
    with pytest.raises(ValueError, match="needs a frozen dataclass"):
        t2tl_jax.register_task_encoder("string", str, Bag)
    with pytest.raises(ValueError, match="another environment is registered as 'Lamps-3'"):
        t2tl_jax.register_env("lamps", LampsConfig, Lamps, {"Lamps-3": LampsConfig(4)})
    with pytest.raises(ValueError, match="another configuration is registered as 'lights'"):
        t2tl_jax.register_config("lights", None)
    t2tl_jax.register_env("lamps", LampsConfig, Lamps)  # once more is fine


def test_what_is_not_registered_says_how(config):
    @dataclasses.dataclass(frozen=True)
    class NewEnv(EnvConfig):
        """Not registered."""

    @dataclasses.dataclass(frozen=True)
    class NewLearner(ReinforceConfig):
        """Not registered."""

    @dataclasses.dataclass(frozen=True)
    class NewEncoder(BagConfig):
        """Not registered."""

    wrong = {
        "register_env": {"env": NewEnv()},
        "register_agent": {"learner": NewLearner()},
        "register_task_encoder": {"learner": ReinforceConfig(network=LogitsConfig(task_encoder=NewEncoder()))},
    }
    for function, change in wrong.items():
        with pytest.raises(UserError, match=f"register it with {function}"):
            t2tl_jax.train(config, **change)
