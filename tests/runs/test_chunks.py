"""Seeds that do not fit into memory together train in groups, and nothing else changes."""

import warnings
from dataclasses import replace
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import tests.fake_learner  # noqa: F401
from t2tl_jax import resume, train
from t2tl_jax.agents.dqn_config import DQNConfig
from t2tl_jax.agents.ppo_config import PPOConfig
from t2tl_jax.errors import Note, UserError
from t2tl_jax.registry import named_config
from t2tl_jax.runs import chunks
from tests.fake_agent import FakeConfig
from tests.fake_runs import StopAfter
from tests.runs.test_stored_runs import restored


def five_seeds(at_once=0):
    config = named_config("fake")
    return replace(config, seeds="0,3,4,7,9", frames=400, run=replace(config.run, seeds_at_once=at_once))


def test_groups_are_even_and_as_large_as_fits():
    assert [chunks.even(5, most) for most in (5, 4, 3, 2, 1)] == [5, 3, 3, 2, 1]
    compiled = jax.jit(lambda x: x * 2).lower(jnp.ones((10, 100_000))).compile()  # 4 MB in, 4 MB out
    assert chunks.fitting(compiled, 10, memory=10**8) == 10
    assert 3 <= chunks.fitting(compiled, 10, memory=4 * 10**6) <= 5
    assert chunks.fitting(compiled, 10, memory=1) == 1
    assert chunks.device_memory() is None or chunks.device_memory() > 10**6


def test_groups_are_for_what_the_states_leave():
    """Of a processor, in whose memory the states wait: 8 seeds whose states are 160 bytes in all."""
    scratch = Compiled(800)  # most of it is none of the states
    assert chunks.fitting(scratch, 8, 8, 160, memory=1000) == 8
    assert chunks.fitting(scratch, 8, 8, 160, memory=700) == 3  # 160 wait, and a seed takes 100 and a copy of its 20
    assert chunks.fitting(Compiled(300), 3, 8, 160, memory=700) == 3
    assert chunks.fitting(scratch, 8, 8, 160, memory=100) == 1  # less than all at once, if too much
    states = Compiled(170)
    assert chunks.fitting(states, 8, 8, 160, memory=100) == 8  # in groups they would take 201 and not 170
    assert chunks.fitting(states, 8, 8, 0, memory=100) == 4  # where the states wait elsewhere


class Device:
    """A made-up one."""

    def __init__(self, platform, memory):
        self.platform, self._memory = platform, memory

    def memory_stats(self):
        return {"bytes_limit": self._memory}


class Compiled:
    """A made-up program, of so many bytes."""

    def __init__(self, size):
        self.argument_size_in_bytes = self.output_size_in_bytes = self.alias_size_in_bytes = 0
        self.temp_size_in_bytes = size

    def memory_analysis(self):
        return self


@pytest.mark.parametrize(
    ("learner", "at_once", "seeds", "said"),
    [
        (
            PPOConfig(),
            0,
            1,
            "one seed needs 3.00 GiB of memory, and its device has 2.00 GiB: smaller with --learner.num",
        ),
        (DQNConfig(), 0, 1, "smaller with --learner.buffer-size or --learner.num-envs;"),
        (FakeConfig(), 0, 1, "2.00 GiB: make the numbers of the learner smaller"),
        (
            PPOConfig(),
            2,
            2,
            "2 seeds side by side need 3.00 GiB .*smaller with --run.seeds-at-once or --learner.num-envs",
        ),
    ],
)
def test_what_is_too_large_for_a_device_is_refused(learner, at_once, seeds, said, monkeypatch):
    monkeypatch.setattr(chunks, "one_device", lambda: Device("gpu", 2 * 2**30))
    monkeypatch.setattr(chunks, "host_memory", lambda: None)
    config = replace(five_seeds(at_once), learner=learner)
    experiment, program = SimpleNamespace(config=config), SimpleNamespace(count=seeds, sharding=None)
    with pytest.raises(UserError, match=said):
        chunks.check_room(experiment, program, Compiled(3 * 2**30))
    chunks.check_room(experiment, program, Compiled(2 * 2**30))  # may just fit


def test_what_is_too_large_for_a_processor_is_told(monkeypatch):
    """Whose memory is that of the machine, of which each device has a share."""
    experiment, program = SimpleNamespace(config=five_seeds()), SimpleNamespace(count=1, sharding=None)
    memory = 2**30 * jax.local_device_count()
    monkeypatch.setattr(chunks, "host_memory", lambda: memory)
    with pytest.warns(
        Note, match=r"one seed needs .* GiB of memory, and this machine has free .* GiB: it may be ended"
    ):
        chunks.check_room(experiment, program, Compiled(memory + 1))
    in_groups = SimpleNamespace(config=five_seeds(4))
    with pytest.warns(Note, match="or be slow; smaller with --run.seeds-at-once;"):
        chunks.check_room(in_groups, program, Compiled(memory + 1))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        chunks.check_room(experiment, program, Compiled(memory))


def test_the_devices_of_a_processor_share_the_memory_of_the_machine(monkeypatch):
    """Two devices that need half of it each, and a byte more."""
    memory = 2**30 * jax.local_device_count()
    monkeypatch.setattr(chunks, "host_memory", lambda: memory)
    shared = SimpleNamespace(count=2, sharding=SimpleNamespace(addressable_devices=range(2)))
    experiment = SimpleNamespace(config=five_seeds())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        chunks.check_room(experiment, shared, Compiled(memory // 2))
    with pytest.warns(Note, match="2 seeds side by side need"):
        chunks.check_room(experiment, shared, Compiled(memory // 2 + 1))


@pytest.mark.parametrize(
    ("device", "program", "said"),
    [
        (Device("gpu", 2**40), 2**30, "the states of all seeds, which wait on the host, need 2.00 GiB of memory, and"),
        (Device("cpu", None), 2**30, "the states of all seeds and a program need 3.00 GiB of memory, and this machine"),
    ],
)
def test_states_that_the_host_has_no_room_for_are_told(device, program, said, monkeypatch):
    """Seeds in groups wait there; a processor's program is there too."""
    monkeypatch.setattr(chunks, "one_device", lambda: device)
    experiment = SimpleNamespace(config=five_seeds(at_once=2))
    group = SimpleNamespace(count=2, sharding=None)
    monkeypatch.setattr(chunks, "host_memory", lambda: 3 * 2**30)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        chunks.check_room(experiment, group, Compiled(program), 2 * 2**30)
    monkeypatch.setattr(chunks, "host_memory", lambda: 2 * 2**30 - 1)
    with pytest.warns(Note, match=said):
        chunks.check_room(experiment, group, Compiled(program), 2 * 2**30)


@pytest.mark.slow
def test_a_seed_that_is_too_large_is_refused_before_it_trains(tmp_path, monkeypatch):
    monkeypatch.setattr(chunks, "one_device", lambda: Device("gpu", 100))
    with pytest.warns(Note, match="train side by side"), pytest.raises(UserError, match="one seed needs"):
        train(five_seeds(), folder=tmp_path / "run")
    assert not (tmp_path / "run" / "checkpoints" / "1").exists()


@pytest.mark.slow
def test_groups_train_what_all_seeds_together_do(tmp_path, monkeypatch):
    """As asked for, as memory demands, and after an interruption, bit for bit in the last case."""
    together = train(five_seeds(), folder=tmp_path / "together")
    asked = train(five_seeds(at_once=2), folder=tmp_path / "asked")  # the last group is filled up
    train(five_seeds(at_once=2), folder=tmp_path / "stopped", callbacks=[StopAfter(2)])
    resume(tmp_path / "stopped")
    for name in ("metrics.csv", "checkpoints/4/info/metadata"):
        assert (tmp_path / "stopped" / name).read_bytes() == (tmp_path / "asked" / name).read_bytes()
    monkeypatch.setattr(chunks, "fitting", lambda compiled, width, count, waiting: min(width, 3))
    with pytest.warns(Note, match="5 seeds do not fit into the memory of the devices together: 3 train side by side"):
        forced = train(five_seeds(), folder=tmp_path / "forced")
    for other, folder in ((asked, "asked"), (forced, "forced")):
        for name, values in together.metrics.items():
            np.testing.assert_allclose(other.metrics[name], values, rtol=1e-4, atol=1e-5, err_msg=name)
        (_, one), (_, many) = restored(tmp_path / "together"), restored(tmp_path / folder)
        jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-4, atol=1e-5), one, many)
