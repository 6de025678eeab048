"""The library alone: where `envs` and `experiments` are somebody else's folders, as in another project."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from t2tl_jax import registry
from t2tl_jax.errors import NotRegistered

ROOT = Path(__file__).parents[2]

PROGRAM = """
import dataclasses, sys, warnings
# An editable installation finds the project's modules even inside of somebody else's package.
sys.meta_path[:] = [finder for finder in sys.meta_path if "editable" not in getattr(finder, "__module__", "")]
warnings.simplefilter("ignore")  # of the plugin that is not there
import t2tl_jax
from t2tl_jax.networks.gru import GRUConfig
from t2tl_jax.runs import pretraining
from t2tl_jax.runs.config import RunConfig, SelectionConfig
from t2tl_jax.single_state import SingleState, SingleStateConfig

sizes = dict(num_envs=4, unroll_length=8, minibatch_size=32, epochs=1)
network = t2tl_jax.NetworkConfig(task_encoder=GRUConfig(width=8, output=4), env_layers=(), actor_layers=(8,),
                                 critic_layers=(8,))
short = dataclasses.replace(pretraining.SCHEDULE.learner, **sizes)
outside = dict(selection=SelectionConfig(points=0), run=RunConfig(evaluation_episodes=0))
pretraining.SCHEDULE = dataclasses.replace(pretraining.SCHEDULE, learner=short, frames=64, **outside)

class Own(SingleState):
    "An environment that is given as an object, and registered nowhere."

run = t2tl_jax.train(Own(SingleStateConfig(("a", "b"))), "F(a & F b)", t2tl_jax.PPOConfig(network=network, **sizes),
                     frames=64, episode_length=20, pretrained="auto:own", folder=sys.argv[1], **outside)
assert run.ended == "complete"
before = t2tl_jax.load(run.folder / "pretraining")
assert before.config.env == SingleStateConfig(("a", "b")) and before.config.task == "F(a & F b)"
assert t2tl_jax.make_env("SingleState").num_actions == 4
assert not {"experiments.configs", "envs.zones"} & set(sys.modules)
try:
    t2tl_jax.train("zone_ppo")
except t2tl_jax.UserError as error:
    print(error)
"""


@pytest.fixture
def another_project(tmp_path):
    """A folder with packages of the same names."""
    for name in ("envs", "experiments"):
        (tmp_path / "other" / name).mkdir(parents=True)
        (tmp_path / "other" / name / "__init__.py").touch()
    return tmp_path / "other"


@pytest.fixture
def fresh_registry(monkeypatch):
    """A registry that has loaded no plugin yet."""
    monkeypatch.setattr(registry, "_loaded", set())
    monkeypatch.setattr(registry, "_missing", {})
    monkeypatch.setattr(registry, "_CONFIGS", {})
    for name in [name for name in sys.modules if name.partition(".")[0] == "experiments"]:
        monkeypatch.delitem(sys.modules, name)


@pytest.mark.slow
def test_pretraining_needs_the_library_alone(another_project, tmp_path):
    path = os.pathsep.join([str(another_project), str(ROOT)])
    command = [sys.executable, "-c", PROGRAM, str(tmp_path / "run")]
    environment = {**os.environ, "PYTHONPATH": path}
    done = subprocess.run(command, capture_output=True, text=True, cwd=another_project, env=environment, timeout=300)
    assert done.returncode == 0, done.stderr
    assert "unknown config 'zone_ppo'" in done.stdout and "No module named 'experiments.configs'" in done.stdout


def test_a_plugin_that_another_folder_hides_is_named_with_the_way_out(another_project, fresh_registry, monkeypatch):
    finders = [finder for finder in sys.meta_path if "editable" not in getattr(finder, "__module__", "")]
    monkeypatch.setattr(sys, "meta_path", finders)  # without that of an editable installation
    monkeypatch.syspath_prepend(another_project)
    with pytest.warns(UserWarning, match="its names are missing"), pytest.raises(NotRegistered) as raised:
        registry.named_config("zone_ppo")
    said = str(raised.value)
    assert "the plugin t2tl_jax = experiments.configs cannot be imported" in said
    assert f"here experiments is {another_project / 'experiments' / '__init__.py'}: start Python in a folder" in said
    sys.modules.pop("experiments")  # the other one


def test_without_any_plugin_the_way_to_the_names_is_told(fresh_registry, monkeypatch):
    monkeypatch.setattr(registry, "_plugins", lambda path: ())
    with pytest.raises(NotRegistered, match=r"none is registered\nno plugin is installed.*import experiments\.configs"):
        registry.named_config("zone_ppo")
