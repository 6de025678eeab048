"""One program for all seeds: what varies is an argument, stacked over seeds; the table is there once."""

from concurrent.futures import ThreadPoolExecutor

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from flax import struct

from envs.zones import ZoneConfig, ZoneEnv
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.training import kept_trace
from t2tl_jax.training import program as program_module
from t2tl_jax.training.program import params_of_seeds, place_params, trace
from t2tl_jax.training.types import Agent, EpisodeTotals, Metrics


@struct.dataclass
class State:
    params: jax.Array


def counting(**changes) -> Agent:
    """Adds up where its seed's first map starts, and how many rows the table has that are true."""

    def iterate(state, env_params):
        seen = env_params.env.starts[0, 0] + (env_params.table.verdict > 0).sum()
        totals = EpisodeTotals(**{name: jnp.float32(0) for name in EpisodeTotals.__dataclass_fields__})
        return state.replace(params=state.params + seen), Metrics(totals, {"seen": seen})

    agent = Agent(
        init=lambda key, env_params: State(env_params.env.starts[0, 0]),
        iterate=iterate,
        embed=lambda params, table: jnp.zeros((table.num_rows, 1)),
        act=lambda *arguments: jnp.zeros(2),
        frames_per_iteration=1,
        restart=lambda state, env_params: state.replace(params=0 * state.params),
    )
    return agent._replace(**changes)


@pytest.fixture(scope="module")
def env() -> TaskEnv:
    zones = ZoneEnv(ZoneConfig(physics="closed_form", layout="random", pool_size=4))
    return TaskEnv(zones, compile_tasks("F Red", zones.propositions, zones.alphabet))


def test_every_seed_gets_its_own_parameters_and_all_one_table(env):
    seeds = (0, 7)
    program = trace(counting(), seeds, params_of_seeds(env, seeds), restartable=True)
    starts = np.array([env.make_params(seed).env.starts[0, 0] for seed in seeds])
    assert program.env_params.env.starts.shape == (2, 4, 2)
    assert program.env_params.table.next_row.shape == env.table.next_row.shape
    state = program.lowered_init.compile()(program.keys, program.env_params)
    state, metrics = program.lowered_iterate.compile()(state, program.env_params)
    np.testing.assert_allclose(metrics.scalars["seen"], starts + 1)
    np.testing.assert_allclose(state.params, 2 * starts + 1, rtol=1e-6)
    evaluation = place_params(params_of_seeds(env, seeds, purpose="evaluation"), program.sharding)
    assert not np.isin(evaluation.env.starts, program.env_params.env.starts).any()
    assert (program.lowered_restart.compile()(state, evaluation).params == 0).all()


def test_tasks_that_cannot_change_are_told(env):
    params = params_of_seeds(env, (0,))
    assert trace(counting(), (0,), params).lowered_restart is None
    with pytest.raises(ValueError, match="cannot go on with other tasks"):
        trace(counting(restart=None), (0,), params, restartable=True)


def test_a_state_that_changes_shape_is_refused(env):
    def grows(state, env_params):
        return state.replace(params=jnp.zeros(2)), None

    with pytest.raises(TypeError, match=r"iterate changed train_state.params from float32\[1\] to float32\[1, 2\]"):
        trace(counting(iterate=grows), (0,), params_of_seeds(env, (0,)))


@pytest.mark.parametrize("kept", [False, True])
def test_what_is_lowered_later_is_what_was_traced(env, kept, tmp_path):
    """In another thread, where the settings of this one do not hold."""
    agent = counting(init=lambda key, env_params: State(jnp.float64(1) * env_params.env.starts[0, 0]))
    with jax.enable_x64(True):
        program = trace(agent, (0,), params_of_seeds(env, (0,)), kept=tmp_path / "a.trace" if kept else None)
    with ThreadPoolExecutor() as threads:
        init = threads.submit(program.lowered_init.compile).result()
    assert program.state.params.dtype == init(program.keys, program.env_params).params.dtype == np.float64


def test_iterations_are_compiled_with_the_options_of_the_device(env, monkeypatch, tmp_path):
    unknown = {"xla_gpu_no_such_option": 1}
    for module in (program_module, kept_trace):
        monkeypatch.setattr(module, "compiler_options", lambda: unknown)
    for kept in (None, tmp_path / "a.trace"):
        traced = trace(counting(), (0,), params_of_seeds(env, (0,)), restartable=True, kept=kept)
        traced.lowered_init.compile()  # no loop
        for lowered in (traced.lowered_iterate, traced.lowered_restart):
            with pytest.raises(jax.errors.JaxRuntimeError, match="xla_gpu_no_such_option"):
                lowered.compile()
