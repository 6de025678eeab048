"""Which file holds the iteration of a training: another one as soon as anything differs that the program depends on."""

import dataclasses
import os
from dataclasses import replace

import jax
import numpy as np
import pytest

from envs.zones import ZoneEnv
from experiments.benchmarks.trainings import training
from experiments.cli import compilation_cache, plugins
from t2tl_jax import loaded, registry
from t2tl_jax.agents.ppo_config import PPOConfig
from t2tl_jax.networks.actor_critic import NetworkConfig
from t2tl_jax.networks.task_encoders import OneHotConfig
from t2tl_jax.registry import ENVS, Kind, named_config
from t2tl_jax.runs import kept_traces
from t2tl_jax.runs.experiment import build
from t2tl_jax.runs.given_env import GivenEnv
from t2tl_jax.single_state import SingleStateConfig
from t2tl_jax.training import kept_trace, trace_file, tree_names
from t2tl_jax.training.program import OVER_SEEDS
from t2tl_jax.training.seeds import TRAINING, stream_keys
from tests.fake_learner import FakeEnvConfig

SMALL = PPOConfig(
    network=NetworkConfig(task_encoder=OneHotConfig(), env_layers=(8,), actor_layers=(8,), critic_layers=(8,)),
    num_envs=4,
    unroll_length=4,
    epochs=1,
    minibatch_size=8,
)


@pytest.fixture
def config():
    config = named_config("zone_ppo_closed_form")
    return replace(config, learner=SMALL, pretrained="", frames=160)


@pytest.fixture
def kept(tmp_path, keeps_traces):
    kept_traces.use(tmp_path / "kept")
    return tmp_path / "kept"


def file_of(config):
    experiment = build(config)
    return kept_traces.file_of(config, experiment.table, experiment.env_params("training"), None)


def test_nothing_is_kept_unless_somebody_asks(config):
    assert file_of(config) is None


def test_what_the_program_does_not_depend_on_has_the_same_file(config, kept):
    same = [
        {},
        {"seeds": "7,"},
        {"until_solved": True},
        {"run": replace(config.run, folder="elsewhere", gif=False)},
        {"learner": replace(SMALL, learning_rate=1e-3, discount=0.9)},
    ]
    assert {file_of(replace(config, **change)) for change in same} == {file_of(config)}
    assert file_of(config).parent == kept and file_of(config).suffix == trace_file.SUFFIX


def test_all_else_has_another(config, kept):
    others = [
        {"seeds": "2"},
        {"task": "phi_zone_prime"},
        {"labels": "state"},
        {"frames": 1_000},
        {"random_starts": 0.5},
        {"episode_length": 500},
        {"env": replace(config.env, layout="random")},
        {"learner": replace(SMALL, epochs=2)},
        {"learner": replace(SMALL, network=replace(SMALL.network, mean_scale=0.5))},
    ]
    files = [file_of(config), *(file_of(replace(config, **change)) for change in others)]
    assert len(set(files)) == len(files) and None not in files


def test_so_has_another_table_of_the_same_shape(config, kept):
    experiment = build(config)
    table, params = experiment.table, experiment.env_params("training")
    other = table.replace(tokens=table.tokens + np.int32(1))
    assert kept_traces.file_of(config, other, params, None) != kept_traces.file_of(config, table, params, None)


def test_a_changed_source_or_setting_has_another(config, kept, tmp_path, monkeypatch):
    before = file_of(config)
    (tmp_path / "more").mkdir()
    source = tmp_path / "more" / "module.py"
    found = []
    for text in ("a = 1", "a = 2"):
        source.write_text(text)
        os.utime(source, (1, 1))
        kept_traces._installed.cache_clear()
        with monkeypatch.context() as patch:
            patch.setattr(kept_traces, "_folders_of", lambda name: [tmp_path / "more"])
            found.append(file_of(config))
    kept_traces._installed.cache_clear()
    assert len({before, *found}) == 3 and file_of(config) == before
    kept_traces._installed.cache_clear()
    with jax.default_matmul_precision("highest"):
        assert file_of(config) != before
    assert file_of(config) == before


def test_another_package_or_version_has_another(config, kept, tmp_path, monkeypatch):
    found = [file_of(config)]
    for record in ("some_package-1.0.dist-info", "some_package-1.1.dist-info", "other-2.0-py3.11.egg-info"):
        place = tmp_path / record
        (place / record).mkdir(parents=True)
        with monkeypatch.context() as patch:
            patch.syspath_prepend(place)
            kept_traces._installed.cache_clear()
            found.append(file_of(config))
    record = tmp_path / "from_sources" / "some_package.egg-info"
    record.mkdir(parents=True)
    for version in ("1.0", "1.1"):
        (record / "PKG-INFO").write_text(f"Version: {version}")
        with monkeypatch.context() as patch:
            patch.syspath_prepend(record.parent)
            kept_traces._installed.cache_clear()
            found.append(file_of(config))
    kept_traces._installed.cache_clear()
    assert len(set(found)) == 6 and None not in found and file_of(config) == found[0]


def test_a_source_that_changed_since_it_was_imported_keeps_nothing(config, kept, tmp_path, monkeypatch):
    source = tmp_path / "module.py"
    source.touch()
    monkeypatch.setattr(kept_traces, "_folders_of", lambda name: [tmp_path])
    for at, is_kept in ((loaded.AT - 5, True), (loaded.AT + 5, False)):
        os.utime(source, (at, at))
        kept_traces._installed.cache_clear()
        assert (file_of(config) is not None) == is_kept
    source.unlink()
    source.symlink_to(tmp_path / "module.py")  # which no one can read
    kept_traces._installed.cache_clear()
    file_of(config)
    kept_traces._installed.cache_clear()


def test_every_file_of_the_project_counts():
    names = {
        path.name for name in kept_traces.OWN for folder in kept_traces._folders_of(name) for path in folder.rglob("*")
    }
    assert {"ppo.py", "zone_env.py", "program.py", "kept_trace.py"} <= names


def test_what_depends_on_code_of_others_is_not_kept(config, kept):
    experiment = build(config)
    params = experiment.env_params("training")
    for env in (FakeEnvConfig(), GivenEnv(name="Mine")):
        assert kept_traces.file_of(replace(config, env=env), experiment.table, params, None) is None

    @dataclasses.dataclass(frozen=True)
    class Mine(PPOConfig):
        pass

    learner = Mine(**{field.name: getattr(SMALL, field.name) for field in dataclasses.fields(SMALL)})
    assert kept_traces.file_of(replace(config, learner=learner), experiment.table, params, None) is None


def test_nor_is_what_is_made_in_another_way_than_here(config, kept, monkeypatch):
    assert file_of(config) is not None
    monkeypatch.setitem(ENVS._kinds, "zones", Kind(type(config.env), lambda env: ZoneEnv(env)))
    assert file_of(config) is None


def test_nor_is_anything_beside_modules_of_others(config, kept, monkeypatch):
    monkeypatch.setattr(registry, "_loaded", {"experiments.configs"})
    assert file_of(config) is not None
    monkeypatch.setattr(registry, "_loaded", {"experiments.configs", "somebody.plugin"})
    assert file_of(config) is None


@pytest.mark.slow
@pytest.mark.parametrize("text", ["zone_ppo", "waterworld_dqn:t2tl", "zones_any"])
def test_the_state_of_a_training_can_be_described(text):
    experiment = build(replace(training(text), seeds="1,"))
    init = jax.vmap(experiment.agent.init, in_axes=(0, OVER_SEEDS))
    state = jax.eval_shape(init, stream_keys((1,), TRAINING), experiment.env_params("training"))
    assert tree_names.described(state) is not None


@pytest.mark.slow
def test_a_kept_training_is_the_same_bit_for_bit(config, kept, monkeypatch):
    monkeypatch.setattr(kept_trace, "SOON", 0.0)
    network = replace(SMALL.network, actor_layers=(), critic_layers=())
    config = replace(config, env=SingleStateConfig(), task="F(Red & F Black)", learner=replace(SMALL, network=network))

    def trained():
        program = build(config).program
        state = program.lowered_init.compile()(program.keys, program.env_params)
        state, metrics = program.lowered_iterate.compile()(state, program.env_params)
        return [np.asarray(x) for x in jax.tree.leaves((state.params, metrics))]

    written, read = trained(), trained()
    assert len(list(kept.iterdir())) == 2
    kept_traces.use(None)
    plain = trained()
    for one in (written, read):
        jax.tree.map(np.testing.assert_array_equal, one, plain)


def test_entry_points_turn_it_on_where_programs_are_kept(tmp_path, monkeypatch, keeps_traces):
    before = jax.config.jax_compilation_cache_dir
    monkeypatch.setattr(plugins, "imported", [])
    try:
        monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", str(tmp_path / "a"))
        for given, folders in (("x", [tmp_path / "a"]), ("", [])):
            compilation_cache.use(given)
            assert kept_traces._folders == folders
        monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", "gs://bucket/a")
        compilation_cache.use("x")
        assert kept_traces._folders == []
        monkeypatch.delenv("JAX_COMPILATION_CACHE_DIR")
        compilation_cache.use(str(tmp_path / "b"))
        assert kept_traces._folders == [tmp_path / "b"]
        monkeypatch.setattr(plugins, "imported", ["mine"])
        compilation_cache.use(str(tmp_path / "b"))
        assert kept_traces._folders == []
    finally:
        jax.config.update("jax_compilation_cache_dir", before)
