"""A traced iteration on disk: what is read from there trains as what was traced, and a damaged file is not believed."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from flax import struct

from envs.zones import ZoneConfig, ZoneEnv
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.training import kept_trace, trace_file
from t2tl_jax.training.program import params_of_seeds, trace
from t2tl_jax.training.types import Metrics
from tests.four_devices import run_on_four_devices
from tests.training.test_program import counting


@struct.dataclass
class State:
    params: jax.Array
    key: jax.Array


def drawing(traced=lambda: None):
    """A learner that adds what it draws; `traced` is told whenever its iteration or its beginning is traced."""
    whole = counting()

    def init(key, env_params):
        traced()
        return State(jax.random.uniform(key), key)

    def iterate(state, env_params):
        traced()
        key, own = jax.random.split(state.key)
        drawn = jax.random.uniform(own)
        _, metrics = whole.iterate(state, env_params)
        return state.replace(params=state.params + drawn, key=key), metrics.replace(
            scalars={"drawn": drawn, "a": drawn}
        )

    return whole._replace(init=init, iterate=iterate)


@pytest.fixture(scope="module")
def env() -> TaskEnv:
    zones = ZoneEnv(ZoneConfig(physics="closed_form", layout="random", pool_size=4))
    return TaskEnv(zones, compile_tasks("F Red", zones.propositions, zones.alphabet))


@pytest.fixture(autouse=True)
def keeps_all(monkeypatch):
    monkeypatch.setattr(kept_trace, "SOON", 0.0)


def trained(agent, env, file, iterations=3):
    """What three iterations of two seeds come to."""
    program = trace(agent, (0, 7), params_of_seeds(env, (0, 7)), kept=file)
    state, iterate = program.lowered_init.compile()(program.keys, program.env_params), program.lowered_iterate.compile()
    for _ in range(iterations):
        state, metrics = iterate(state, program.env_params)
    return jax.tree.map(np.asarray, (state.params, jax.random.key_data(state.key), metrics)), program.state


def another_structure(content):
    """One more name of the metrics; keys in the place of other numbers of the state."""
    return content.replace(b'"drawn"', b'"drawn", "more"', 1).replace(b'"*"', b'"key"', 1)


def equal(one, other):
    """Numbers, and shapes and dtypes of the state."""
    assert jax.tree.structure(one[0]) == jax.tree.structure(other[0]) and one[1] == other[1]
    jax.tree.map(np.testing.assert_array_equal, one[0], other[0])
    return True


def test_what_was_kept_is_not_traced_again_and_trains_the_same(env, tmp_path):
    times, file = [], tmp_path / "a.trace"
    agent = drawing(lambda: times.append(1))
    plain = trained(agent, env, None)
    del times[:]
    assert equal(trained(agent, env, file), plain) and times and file.is_file()
    del times[:]
    assert equal(trained(agent, env, file), plain) and not times
    assert isinstance(plain[0][2], Metrics)
    assert sorted(one.name for one in tmp_path.iterdir()) == ["a.trace", "a_init.trace"]


@pytest.mark.parametrize("name", ["a.trace", "a_init.trace"])
@pytest.mark.parametrize(
    "damage",
    [lambda x: x[:-1], lambda x: b"", lambda x: b"{}\n" + x, lambda x: b"[1]\n", bytes.upper, another_structure],
)
def test_a_damaged_file_is_written_anew(env, tmp_path, name, damage):
    times = []

    def start():
        agent = drawing(lambda: times.append(1))
        trace(agent, (0,), params_of_seeds(env, (0,)), kept=tmp_path / "a.trace")

    start()
    assert len(times) == 2
    whole = (tmp_path / name).read_bytes()
    (tmp_path / name).write_bytes(damage(whole))
    start()
    assert len(times) == 3 and len((tmp_path / name).read_bytes()) == len(whole)


@pytest.mark.parametrize("state", [["gone:State", [["params", "*"], ["key", "key"]]], ["tuple", ["*"]], "*", 3])
def test_a_state_of_another_structure_is_traced_anew(env, tmp_path, state):
    times, file = [], tmp_path / "a.trace"
    agent = drawing(lambda: times.append(1))
    plain = trained(agent, env, file)
    exported, about = trace_file.read(tmp_path / "a_init.trace")
    trace_file.write(tmp_path / "a_init.trace", exported, {"state": state})
    del times[:]
    assert equal(trained(agent, env, file), plain) and times == [1]
    assert trace_file.read(tmp_path / "a_init.trace")[1] == about


def test_a_quick_trace_is_not_kept(env, tmp_path, monkeypatch):
    monkeypatch.setattr(kept_trace, "SOON", 60.0)
    assert trace(drawing(), (0,), params_of_seeds(env, (0,)), kept=tmp_path / "a.trace").lowered_iterate
    assert not list(tmp_path.iterdir())


def test_a_full_disk_is_no_reason_to_stop_and_leaves_nothing(env, tmp_path, monkeypatch):
    def full(*_):
        raise OSError("the disk is full")

    monkeypatch.setattr(trace_file.os, "replace", full)
    assert trace(drawing(), (0,), params_of_seeds(env, (0,)), kept=tmp_path / "a.trace").lowered_iterate
    assert not list(tmp_path.iterdir())


def test_a_folder_that_cannot_be_written_is_no_reason_to_stop(env, tmp_path):
    (tmp_path / "file").touch()
    assert trace(drawing(), (0,), params_of_seeds(env, (0,)), kept=tmp_path / "file" / "a.trace").lowered_iterate


def test_only_so_many_are_kept(env, tmp_path, monkeypatch):
    monkeypatch.setattr(trace_file, "MOST_FILES", 2)
    (tmp_path / "of_somebody.trace").touch()
    for name in "abc":
        trace(drawing(), (0,), params_of_seeds(env, (0,)), kept=tmp_path / f"{name}{trace_file.SUFFIX}")
    assert len(list(tmp_path.iterdir())) == 3 and (tmp_path / f"c{trace_file.SUFFIX}").is_file()
    assert (tmp_path / "of_somebody.trace").is_file()


@pytest.mark.parametrize("found", ["when it is traced", "when it is written"])
def test_what_calls_functions_of_the_process_is_not_kept(env, tmp_path, monkeypatch, found):
    """They are made ready by tracing alone: without that, such a call crashes."""
    if found == "when it is written":
        monkeypatch.setattr(kept_trace, "CALLS", frozenset())

    def init(key, env_params):
        return State(jnp.linalg.qr(jax.random.normal(key, (2, 2)))[0][0, 0], key)

    agent = drawing()._replace(init=init)
    plain = trained(agent, env, None)
    assert equal(trained(agent, env, tmp_path / "a.trace"), plain)
    assert [one.name for one in tmp_path.iterdir()] == ["a.trace"]


@struct.dataclass
class Marked:
    params: jax.Array
    key: jax.Array
    mark: int = struct.field(pytree_node=False, default=0)


def test_a_state_that_cannot_be_described_is_traced_once(env, tmp_path):
    times = []

    def init(key, env_params):
        times.append(1)
        return Marked(jax.random.uniform(key), key)

    agent = drawing()._replace(init=init)
    plain = trained(agent, env, None)
    assert equal(trained(agent, env, tmp_path / "a.trace"), plain) and len(times) == 2
    assert [one.name for one in tmp_path.iterdir()] == ["a.trace"]


def test_settings_of_one_thread_hold_for_what_is_kept(env, tmp_path):
    def init(key, env_params):
        x = jax.random.normal(key, (2, 2))
        return State((x @ x)[0, 0], key)

    with jax.default_matmul_precision("highest"):
        trace(drawing()._replace(init=init), (0,), params_of_seeds(env, (0,)), kept=tmp_path / "a.trace")
    exported, _ = trace_file.read(tmp_path / "a_init.trace")
    assert "HIGHEST" in exported.mlir_module()


def test_what_cannot_be_exported_trains_as_ever(env, tmp_path, monkeypatch):
    plain = trained(drawing(), env, None)

    def refused(function):
        raise NotImplementedError("of a kind that cannot be written")

    monkeypatch.setattr(kept_trace.export, "export", refused)
    assert equal(trained(drawing(), env, tmp_path / "a.trace"), plain) and not list(tmp_path.iterdir())


@pytest.mark.parametrize("to", [np.zeros(2, np.float32), np.float16(0), ()])
def test_a_state_that_changes_its_form_is_told_as_ever(env, tmp_path, to):
    def grows(state, env_params):
        return state.replace(params=jax.tree.map(jnp.asarray, to)), counting().iterate(state, env_params)[1]

    with pytest.raises(TypeError, match="iterate"):
        trace(counting(iterate=grows), (0,), params_of_seeds(env, (0,)), kept=tmp_path / "a.trace")
    assert not (tmp_path / "a.trace").exists()


@pytest.mark.parametrize("function", ["init", "iterate"])
def test_a_mistake_of_the_learner_is_told_as_ever(env, tmp_path, function):
    def wrong(key_or_state, env_params):
        raise ValueError("this learner has a fault")

    with pytest.raises(ValueError, match="this learner has a fault"):
        trace(counting()._replace(**{function: wrong}), (0,), params_of_seeds(env, (0,)), kept=tmp_path / "a.trace")


@pytest.mark.slow
def test_over_four_devices_too(tmp_path):
    program = """
import sys, jax, numpy as np
from pathlib import Path
from tests.training.test_kept_trace import drawing
from envs.zones import ZoneConfig, ZoneEnv
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.training import kept_trace, trace_file
from t2tl_jax.training.program import params_of_seeds, trace
from t2tl_jax.training.devices import seed_sharding
kept_trace.SOON = 0.0
zones = ZoneEnv(ZoneConfig(physics="closed_form", layout="random", pool_size=4))
env, seeds, times = TaskEnv(zones, compile_tasks("F Red", zones.propositions, zones.alphabet)), (0, 1, 2, 3), []
def trained(file):
    agent = drawing(lambda: times.append(1))
    program = trace(agent, seeds, params_of_seeds(env, seeds), sharding=seed_sharding(4), kept=file)
    state, iterate = program.lowered_init.compile()(program.keys, program.env_params), program.lowered_iterate.compile()
    for _ in range(3): state, metrics = iterate(state, program.env_params)
    assert len(state.params.sharding.device_set) == len(state.key.sharding.device_set) == 4
    return np.asarray(state.params), np.asarray(metrics.scalars["drawn"])
file = Path(sys.argv[1])
plain, first = trained(None), trained(file)
del times[:]
second = trained(file)
assert not times and file.is_file()
for one in (first, second): np.testing.assert_array_equal(one, plain)
"""
    run_on_four_devices(program, str(tmp_path / "a.trace"))
