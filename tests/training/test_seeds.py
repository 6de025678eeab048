import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.training.devices import lanes, padded, seed_sharding
from t2tl_jax.training.seeds import TRAINING, parse_seeds, stream_keys
from tests.four_devices import run_on_four_devices


def test_counts_and_lists():
    assert parse_seeds("3") == (0, 1, 2)
    assert parse_seeds("0, 3,7") == (0, 3, 7)
    assert parse_seeds("7,") == (7,)


@pytest.mark.parametrize("text", ["", "0", "-1", "a", "1,1", "1,,2", "1.5", str(2**32) + ",", ","])
def test_other_texts_are_refused(text):
    with pytest.raises(ValueError, match="seed"):
        parse_seeds(text)


def test_keys_depend_on_the_seed_alone():
    together, alone = stream_keys((0, 3, 7), 1), stream_keys((3,), 1)
    np.testing.assert_array_equal(jax.random.key_data(together)[1], jax.random.key_data(alone)[0])


def test_keys_are_those_of_jax_and_of_its_kind_by_default():
    for kind in ("threefry2x32", "rbg"):  # also one after the other in one process
        with jax.default_prng_impl(kind):
            wanted = [jax.random.fold_in(jax.random.key(seed), TRAINING) for seed in (3, 2**32 - 1)]
            found = stream_keys((3, 2**32 - 1), TRAINING)
        assert found.dtype == wanted[0].dtype
        assert (jax.random.key_data(found) == jnp.stack([jax.random.key_data(key) for key in wanted])).all()


def test_one_device_needs_no_sharding():
    assert seed_sharding(4, devices=jax.devices()[:1]) is None


def test_environments_are_spread_evenly_over_the_devices_that_seeds_leave():
    def meshes(count, **options):
        placed = seed_sharding(count, devices=jax.devices()[:1] * 4, **options)
        return None if placed is None else tuple(placed.mesh.shape.values())

    assert [meshes(1, num_envs=8, per_seed=most) for most in (0, 1, 2, 3, 9)] == [(1, 4), None, (1, 2), (1, 2), (1, 4)]
    assert meshes(2, num_envs=6) == (2, 2) and meshes(3, num_envs=6) == (3, 1) and meshes(1, num_envs=1) is None


@pytest.mark.parametrize(
    ("count", "used", "trained"), [(11, 8, 16), (13, 8, 16), (17, 8, 24), (12, 6, 12), (8, 8, 8), (5, 5, 5), (9, 8, 16)]
)
def test_seeds_that_do_not_share_out_evenly_are_filled_up(count, used, trained):
    placed = seed_sharding(count, devices=jax.devices()[:1] * 8)
    assert placed.mesh.size == used and lanes(count, placed) == trained
    filled = padded({"seed": np.arange(count)}, placed)["seed"]
    assert (
        len(filled) == trained and filled[:count].tolist() == list(range(count)) and (filled[count:] == count - 1).all()
    )


@pytest.mark.slow
def test_seeds_over_four_devices_give_the_same_numbers():
    program = """
import jax, numpy as np
from tests.training.test_program import counting
from envs.zones import ZoneConfig, ZoneEnv
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.training.program import params_of_seeds, trace
from t2tl_jax.training.devices import seed_sharding
zones = ZoneEnv(ZoneConfig(physics="closed_form", layout="random", pool_size=4))
env = TaskEnv(zones, compile_tasks("F Red", zones.propositions, zones.alphabet))
def weights(seeds, devices):
    program = trace(counting(), seeds, params_of_seeds(env, seeds), sharding=seed_sharding(len(seeds)))
    state = program.lowered_init.compile()(program.keys, program.env_params)
    iterate = program.lowered_iterate.compile()
    for _ in range(3): state, metrics = iterate(state, program.env_params)
    assert len(state.params.sharding.device_set) == devices
    assert len(program.env_params.table.tokens.sharding.device_set) == devices
    return np.asarray(state.params)
assert len(jax.devices()) == 4 and len(seed_sharding(6).device_set) == 3
together = weights((0, 1, 2, 3), devices=4)
np.testing.assert_allclose(together[2:3], weights((2,), devices=1), rtol=1e-5)
"""
    run_on_four_devices(program)
