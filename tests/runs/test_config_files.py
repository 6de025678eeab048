"""Configurations as values and as files: what survives, what is refused, and what earlier versions stored."""

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from envs.zones import ZoneConfig
from t2tl_jax.agents.dqn_config import DQNConfig
from t2tl_jax.agents.ppo_config import PPOConfig
from t2tl_jax.errors import UserError
from t2tl_jax.networks.context_config import ContextConfig
from t2tl_jax.networks.task_encoders import OneHotConfig
from t2tl_jax.networks.transformer import TransformerConfig
from t2tl_jax.registry import configs, named_config
from t2tl_jax.runs import config_files
from t2tl_jax.runs.folder import read_json
from t2tl_jax.single_state import SingleStateConfig

ZONE = named_config("zone_ppo")
ROOT = Path(__file__).parents[2]
STORED = sorted((ROOT / "results").rglob("config.json"))


@pytest.mark.parametrize("name", configs())
def test_configs_survive_json(name):
    config, summary = configs()[name]
    assert config_files.from_json(config_files.to_json(config), name) == config
    assert summary


@pytest.mark.slow
@settings(max_examples=20)
@given(st.floats(0, 1), st.integers(1, 10**9), st.text())
def test_any_values_survive_json(share, frames, task):
    config = dataclasses.replace(ZONE, random_starts=share, frames=frames, task=task)
    assert config_files.from_json(config_files.to_json(config), "test") == config


@pytest.mark.parametrize(
    ("name", "changes", "counted"),
    [
        ("zone_ppo", {}, 1),  # iterations
        ("zone_ppo", {"anneal_learning_rate": True}, 4 * 16),  # gradient steps
        ("waterworld_dqn", {}, 1),  # iterations, whatever is annealed
        ("waterworld_dqn", {"updates_per_step": 200}, 1),
    ],
)
def test_the_longest_run_is_as_long_as_32_bits_can_count(name, changes, counted):
    config = named_config(name)
    learner = dataclasses.replace(config.learner, **changes)
    frames = (2**31 - 1) // counted * learner.frames_per_iteration
    config = dataclasses.replace(config, frames=frames, learner=learner)
    with pytest.raises(ValueError, match=f"frames must be at most {frames:,} with these settings"):
        dataclasses.replace(config, frames=frames + 1)


@pytest.mark.parametrize("name", configs())
def test_every_registered_configuration_can_have_ten_billion_frames(name):
    config = dataclasses.replace(named_config(name), frames=10**10)
    assert config.frames <= config.iterations * config.learner.frames_per_iteration <= config.learner.max_frames


def first_format(**changes):
    """A configuration as version 0.1 stored it."""
    data = json.loads((Path(__file__).parent / "run_of_0_1" / "config.json").read_text())
    return data | changes


def test_whole_numbers_may_be_given_as_others_that_are_whole():
    """2e5 in Python is a float, which a file would not be read with again."""
    pool = dataclasses.replace(ZONE.pool, size=np.int64(8), rows=256.0)
    own = dataclasses.replace(ZONE, frames=2e5, episode_length=np.float32(200), pool=pool)
    assert own == dataclasses.replace(
        ZONE, frames=200_000, episode_length=200, pool=dataclasses.replace(ZONE.pool, size=8, rows=256)
    )
    assert config_files.from_json(config_files.to_json(own), "test") == own
    for field, value in [("frames", 200.5), ("frames", math.inf), ("episode_length", math.nan)]:
        with pytest.raises(ValueError, match=f"{field} must be a whole number, got {value}"):
            dataclasses.replace(ZONE, **{field: value})


def test_kinds_and_names_of_the_first_format_become_those_of_today():
    config = config_files.from_json(json.dumps(first_format()), "config.json")
    assert config.env == ZoneConfig(physics="closed_form") and config.random_starts == 0.0
    network = config.learner.network
    assert type(config.learner) is PPOConfig
    assert (config.learner.unroll_length, config.learner.clip_eps, config.learner.num_envs) == (16, 0.2, 32)
    assert network.task_encoder == TransformerConfig(layers=1, width=16, heads=2, feed_forward=16, output=16)
    assert network.context is None and network.env_layers == (8,)
    # What is written is of this version.
    assert config_files.from_json(config_files.to_json(config), "again") == config
    assert json.loads(config_files.to_json(config))["version"] == 3


def test_every_choice_of_the_first_format_is_understood():
    network = first_format()["network"]

    def read(**changes):
        return config_files.from_json(json.dumps(first_format(**changes)), "config.json")

    assert read(simultaneous=0.25).random_starts == 0.25
    assert read(env={"physics": "mjx"}).env == ZoneConfig()  # from before there were several kinds
    assert read(env={"kind": "single_state"}, task="F Red").env == SingleStateConfig()
    one_hot = read(network=network | {"task_encoder": "one_hot", "one_hot_size": 77})
    assert one_hot.learner.network.task_encoder == OneHotConfig(size=77)
    for kind, size in (("rgcn", 32), ("gru", 16)):
        assert read(network=network | {"task_encoder": kind}).learner.network.task_encoder.code_size == size
    # Windows were read one by one before there were segments.
    assert read(network=network | {"context": {"length": 4}}).learner.network.context == ContextConfig(
        length=4, segment_length=1
    )
    stored = read(network=network | {"context": {"length": 4, "segment_length": 8}}).learner.network.context
    assert stored == ContextConfig(length=4, segment_length=8)


def test_the_context_had_a_transformer_before_it_had_a_reader():
    data = json.loads(config_files.to_json(ZONE))
    context = data["learner"]["network"]["context"]
    context["transformer"] = {name: value for name, value in context.pop("reader").items() if name != "kind"}
    context["transformer"]["layers"] = 3
    read = config_files.from_json(json.dumps(data), "config.json").learner.network.context
    assert read == ContextConfig(reader=dataclasses.replace(ContextConfig().reader, layers=3))
    first = first_format()["network"] | {"context": {"transformer": {"width": 48}}}
    read = config_files.from_json(json.dumps(first_format(network=first)), "config.json").learner.network.context
    assert read.reader == TransformerConfig(width=48) and read.segment_length == 1


def test_a_run_from_before_segments_goes_on_with_single_steps():
    context = {"length": 8, "aligned": False}  # which segments of several steps refuse
    network = first_format()["network"] | {"context": context}
    config = config_files.from_json(json.dumps(first_format(network=network)), "config.json")
    assert config.learner.network.context == ContextConfig(length=8, aligned=False, segment_length=1)


def test_a_run_from_before_the_first_token_began_with_empty_windows():
    data = json.loads(config_files.to_json(ZONE))
    del data["learner"]["network"]["context"]["first_token"]
    assert config_files.from_json(json.dumps(data), "config.json") == ZONE


def test_a_run_from_before_new_maps_keeps_its_maps():
    data = json.loads(config_files.to_json(ZONE))
    assert config_files.from_json(json.dumps(data | {"map_period": 5}), "config.json").map_period == 5
    del data["map_period"]
    for stored in (data, data | {"version": 2}, first_format()):
        assert config_files.from_json(json.dumps(stored), "config.json").map_period == 0


@pytest.mark.parametrize("name", ["zone_ppo", "rm_water_crm"])
def test_a_run_from_before_head_layers_and_clipping_by_array_has_neither(name):
    config = named_config(name)
    data = json.loads(config_files.to_json(config))
    assert data["learner"].pop("gradient_clipping") == "global"
    assert data["learner"]["network"].pop("head_layers", []) == []
    assert config_files.from_json(json.dumps(data), "config.json") == config


def test_dqn_of_the_first_format():
    network = {"kind": "q_network", "task_encoder": "one_hot", "one_hot_size": 20, "head": "bilinear"}
    learner = {"steps_per_iteration": 7, "simultaneous": False, "num_envs": 3}
    config = config_files.from_json(json.dumps(first_format(network=network, dqn=learner, ppo=None)), "config.json")
    assert isinstance(config.learner, DQNConfig)
    assert (config.learner.unroll_length, config.learner.counterfactual, config.learner.num_envs) == (7, False, 3)
    assert config.learner.network.head == "bilinear" and config.learner.task_encoder == OneHotConfig(size=20)


@pytest.mark.parametrize("path", STORED, ids=lambda path: path.parent.relative_to(ROOT / "results").as_posix())
def test_every_stored_result_can_be_read(path):
    config = config_files.load(path)
    data = json.loads(path.read_text())
    if data.get("version", 1) == 1:
        learner = data.get("dqn") or data["ppo"]
        assert config.learner.num_envs == learner["num_envs"]
        length = learner["steps_per_iteration" if data.get("dqn") else "rollout_steps"]
        assert config.learner.unroll_length == length
    told = json.loads(config_files.to_json(config))
    assert all(told[name] == data[name] for name in ("task", "seeds", "frames"))
    assert config_files.from_json(config_files.to_json(config), "again") == config


def test_there_are_stored_results():
    assert len(STORED) > 20


def reader(data):
    return data["learner"]["network"]["task_encoder"]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            lambda data: data["learner"].update(learning_rte=1),
            "config.learner: unknown field 'learning_rte', nearest known 'learning_rate'",
        ),
        (lambda data: data.update(fames=1), "nearest known 'frames'"),
        (lambda data: data.update(frames="many"), "expected int, got 'many'"),
        (lambda data: data["run"].update(gif="False"), "expected bool"),
        (lambda data: data["learner"].update(discount=2.0), "discount must lie"),
        (lambda data: data["env"].update(physics="mj"), "physics"),
        (lambda data: data["env"].update(pool=3), "config.env: unknown field 'pool', nearest known 'pool_size'"),
        (lambda data: data["env"].update(kind="water"), "unknown environment 'water'; did you mean 'waterworld'"),
        (lambda data: data["env"].update(kind="waterworld"), "config.env: unknown field"),
        (
            lambda data: data.update(env=None),
            "config.env: expected an object whose kind names a registered environment",
        ),
        (lambda data: data["learner"].update(kind="pp"), "unknown learner 'pp'; did you mean 'ppo'"),
        (
            lambda data: data["learner"].pop("kind"),
            "config.learner: expected an object whose kind names a registered learner",
        ),
        (lambda data: reader(data).update(kind="grus"), "unknown task encoder 'grus'; did you mean 'gru'"),
        (lambda data: reader(data).update(kind="gru"), "learner.network.task_encoder: unknown field"),
        (lambda data: data.update(version=4), r"stored by a newer version of t2tl_jax \(format 4\)"),
    ],
)
def test_files_of_other_versions_are_refused(change, said):
    data = json.loads(config_files.to_json(ZONE))
    change(data)
    with pytest.raises(UserError, match=said):
        config_files.from_json(json.dumps(data), "config.json")


@pytest.mark.parametrize("text", ["[]", "3", "null", "{}", '{"version": 3}'])
def test_other_json_is_refused(text):
    with pytest.raises(UserError, match=r"config\.json does not fit this version"):
        config_files.from_json(text, "config.json")


@pytest.mark.parametrize("depth", [250, 600, 100_000])
def test_json_that_is_nested_too_deeply_is_refused(depth):
    data = json.loads(config_files.to_json(ZONE)) | {"task": "PLACE"}
    nested = '{"kind": "mixture", "parts": [' * depth + '{"kind": "chains"}' + "]}" * depth
    with pytest.raises(UserError, match=r"config\.json (does not fit|is nested more deeply)"):
        config_files.from_json(json.dumps(data).replace('"PLACE"', nested), "config.json")


def test_a_file_of_a_run_that_is_nested_too_deeply_is_refused(tmp_path):
    (tmp_path / "status.json").write_text("[" * 100_000)
    with pytest.raises(UserError, match=r"cannot read .*status\.json: it is nested too deeply"):
        read_json(tmp_path / "status.json")
