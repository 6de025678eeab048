"""MJX's substep is written out while a program for several devices is traced, as every run on a CPU with two cores is.
What it is made of lies on one of them."""

import pytest

from tests.four_devices import run_on_four_devices

PROGRAM = """
import jax
from envs.zones import ZoneConfig, ZoneEnv

env = ZoneEnv(ZoneConfig())
params = env.make_params(0)
mesh = jax.make_mesh((4,), ("seeds",), axis_types=(jax.sharding.AxisType.Auto,))
with jax.set_mesh(mesh):
    state = jax.eval_shape(env.reset, jax.random.key(0), params)
    action = jax.ShapeDtypeStruct((2,), "float32")
    after = jax.eval_shape(env.step, state, action, params)
assert after.obs.shape == (env.observation_size,)
"""


@pytest.mark.slow
def test_a_step_by_mjx_is_traced_for_several_devices():
    run_on_four_devices(PROGRAM)
