"""The network over objects: what may be exchanged, what it does not depend on, and what it refuses."""

import dataclasses
import json
from functools import cache, partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from envs.waterworld import WaterWorld, WaterWorldConfig
from t2tl_jax.ltl import TaskTable, compile_tasks
from t2tl_jax.networks.actor_critic import ActorCritic, NetworkConfig
from t2tl_jax.networks.context_config import ContextConfig
from t2tl_jax.networks.joined import JoinedConfig
from t2tl_jax.networks.lookahead import LookaheadConfig
from t2tl_jax.networks.objects import ObjectsConfig, object_features
from t2tl_jax.networks.q_network import QNetwork, QNetworkConfig
from t2tl_jax.networks.state_encoders import FlatConfig, make_state_encoder
from t2tl_jax.networks.task_encoders import OneHotConfig
from t2tl_jax.objects import Objects
from t2tl_jax.registry import named_config
from t2tl_jax.runs import config_files
from tests.parameters import parameters

LOOK = LookaheadConfig(propositions=6, steps=2)
EACH = {
    f"{pooling}-{identity}": ObjectsConfig(layers=(12, 8), heads=2, pooling=pooling, identity=identity)
    for pooling in ("maximum_mean", "attention")
    for identity in ("proposition", "role")
}
every_kind = pytest.mark.parametrize("kind", EACH)


def balls(colours: int, of_each: int) -> Objects:
    which = tuple(c for c in range(colours) for _ in range(of_each))
    return Objects.blocks(range(3, 3 + 4 * len(which), 4), 4, which, place=2)


def given(objects: Objects) -> tuple[np.ndarray, np.ndarray]:
    """Observations, the last number of which is the agent's own, and codes of tasks."""
    rng = np.random.default_rng(0)
    obs = rng.normal(size=(40, objects.numbers[-1][-1] + 2)).astype(np.float32)
    return obs, rng.integers(0, 2, (40, LOOK.code_size)).astype(np.float32)


def reordered(obs: np.ndarray, objects: Objects, order: list[int]) -> np.ndarray:
    """The same observation with its objects in another order."""
    numbers, other = np.array(objects.numbers), obs.copy()
    other[..., numbers] = obs[..., numbers[order]]
    return other


def renamed(code: np.ndarray, order: list[int]) -> np.ndarray:
    """What a code says of each proposition, said of another one."""
    told = code[:, :-1].reshape(len(code), -1, LOOK.propositions)[..., order]
    return np.concatenate([told.reshape(len(code), -1), code[:, -1:]], axis=-1)


FEW = balls(4, 2)


@cache
def encoder_of(kind: str):
    """For eight balls of four colours: (function of parameters, observation and code; parameters)."""
    module = make_state_encoder(EACH[kind], FEW, LOOK)
    return jax.jit(module.apply), parameters(module, *given(FEW))


def shapes_for(kind: str, objects: Objects) -> tuple[Any, Any]:
    """Of other balls: shapes of the parameters, and of the features."""
    module = make_state_encoder(EACH[kind], objects, LOOK)
    return jax.eval_shape(lambda: module.init_with_output(jax.random.key(0), *given(objects)))[::-1]


@every_kind
def test_objects_of_one_proposition_may_be_exchanged_and_others_not(kind):
    encode, params = encoder_of(kind)
    obs, task = given(FEW)
    out = encode(params, obs, task)
    assert out.shape == (40, 16 if "maximum" in kind else 8) and np.isfinite(out).all()
    twins, strangers = [1, 0, 2, 3, 5, 4, 6, 7], [2, 1, 0, 3, 4, 5, 6, 7]
    np.testing.assert_allclose(encode(params, reordered(obs, FEW, twins), task), out, atol=1e-5)  # order of sums
    assert np.abs(encode(params, reordered(obs, FEW, strangers), task) - out).max() > 1e-3


@every_kind
def test_parameters_do_not_depend_on_how_many_objects_there_are(kind):
    (few, features), (many, same) = shapes_for(kind, FEW), shapes_for(kind, balls(4, 5))
    assert few == many and features.shape == same.shape


@pytest.mark.parametrize("kind", [kind for kind in EACH if "role" in kind])
def test_by_roles_propositions_may_be_renamed_and_others_may_come(kind):
    encode, params = encoder_of(kind)
    obs, task = given(FEW)
    out = encode(params, obs, task)
    # The balls of colour k, and what the task says of it, are now those of another colour.
    moved, said = reordered(obs, FEW, [4, 5, 0, 1, 6, 7, 2, 3]), renamed(task, [2, 0, 3, 1, 4, 5])
    np.testing.assert_allclose(encode(params, moved, said), out, atol=1e-5)
    assert np.abs(encode(params, moved, task) - out).max() > 1e-3
    (few, features), (more, same) = shapes_for(kind, FEW), shapes_for(kind, balls(6, 1))
    assert few == more and features.shape == same.shape


@every_kind
def test_gradient_reaches_every_parameter(kind):
    encode, params = encoder_of(kind)
    obs, task = given(FEW)
    slope = jax.jit(jax.grad(lambda params: jnp.square(encode(params, obs, task)).sum()))(params)
    for path, leaf in jax.tree.leaves_with_path(slope):
        # A bias of all keys moves all scores alike, but not that of nothing, so even it counts.
        assert np.isfinite(leaf).all() and np.abs(leaf).max() > 1e-6, path


def test_an_object_where_the_agent_is_has_no_direction():
    objects = balls(1, 2)
    obs = jnp.array([1.0, 2.0, 3.0, 0.0, 0.0, 5.0, 6.0, 0.6, -0.8, 7.0, 8.0, 9.0])
    own, each = object_features(obs, objects, 5.0)
    np.testing.assert_allclose(own, [1, 2, 3, 9])
    np.testing.assert_allclose(each, [[0, 0, 0, 0, 0, 5, 6], [3, -4, 5, 0.6, -0.8, 7, 8]], atol=1e-6)
    _, plain = object_features(obs, dataclasses.replace(objects, place=0), 5.0)
    np.testing.assert_array_equal(plain, np.float32([[0, 0, 5, 6], [0.6, -0.8, 7, 8]]))


@pytest.fixture(scope="module")
def water() -> tuple[WaterWorld, TaskTable]:
    env = WaterWorld(WaterWorldConfig(colours=("a", "b", "c"), balls_per_colour=1))
    return env, compile_tasks(["!a U (b & F c)", "F a & F b"], env.propositions, env.alphabet)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "head"), [("attention-proposition", "film"), ("maximum_mean-role", "concat")])
def test_values_of_all_rows_are_those_of_each(water, kind, head):
    env, table = water
    config = QNetworkConfig(task_encoder=LOOK, state=EACH[kind], state_layers=(8,), task_layer=6, head=head)
    network = QNetwork(config, 5, env.objects)
    obs = np.random.default_rng(3).normal(size=(4, env.observation_size)).astype(np.float32)
    rows, params = np.array([2, 3, 4, 2]), parameters(network, table, obs, method="initialise")

    @jax.jit
    def values(params: Any, obs: jax.Array) -> tuple[jax.Array, jax.Array]:
        codes = network.apply(params, table, method="embed")
        return network.apply(params, obs, codes, method="every_row"), network.apply(params, obs, codes, rows)

    every, own = values(params, obs)
    assert every.shape == (4, table.num_rows, 5)
    np.testing.assert_allclose(own, every[np.arange(4), rows], atol=1e-5)
    assert np.abs(every[:, 2] - every[:, 3]).max() > 1e-3


def test_actor_and_critic_know_nothing_of_names_if_objects_have_roles(water):
    env, table = water
    sizes = {}
    for identity in ("proposition", "role"):
        config = NetworkConfig(task_encoder=LOOK, state=ObjectsConfig(layers=(8,), identity=identity), env_layers=())
        network = ActorCritic(config, 5, True, env.objects)
        init = partial(network.init, method="initialise")
        params = jax.eval_shape(init, jax.random.key(0), table, jnp.zeros((2, env.observation_size)), jnp.zeros(2, int))
        sizes[identity] = params["params"]["actor"]["dense_0"]["kernel"].shape[0]
    assert sizes == {"proposition": 16 + LOOK.code_size, "role": 16 + 1}


def test_a_joined_code_speaks_of_propositions_if_one_of_both_does():
    code = jnp.arange(4 + LOOK.code_size, dtype=jnp.float32)
    told, rest = LOOK.by_proposition(code[4:])
    for pair, joined in ((OneHotConfig(4), LOOK), code), ((LOOK, OneHotConfig(4)), jnp.roll(code, -4)):
        config = JoinedConfig(*pair)
        assert config.propositions_told == LOOK.propositions == 6
        of_both, others = config.by_proposition(joined)
        np.testing.assert_array_equal(of_both, told)
        assert sorted(others.tolist()) == [*range(4), *rest.tolist()]
    assert JoinedConfig(OneHotConfig(4), OneHotConfig(4)).propositions_told is None


def test_flat_is_the_default_and_adds_nothing(water):
    """So configurations that were stored before there was a choice are read, and so are their parameters."""
    env, table = water
    obs, row = jnp.zeros((2, env.observation_size)), jnp.zeros(2, int)
    one_hot = OneHotConfig(16)
    for network, args, parts in (
        (ActorCritic(NetworkConfig(task_encoder=one_hot), 5, True), (obs, row), {"environment_encoder"}),
        (QNetwork(QNetworkConfig(task_encoder=one_hot), 5), (obs,), {"state_encoder_0", "state_encoder_1"}),
    ):
        init = partial(network.init, method="initialise")
        params = jax.eval_shape(init, jax.random.key(0), table, *args)["params"]
        assert parts <= set(params) and "state" not in params
        assert "state" not in params.get("environment_encoder", {})
    for name in ("zone_ppo", "waterworld_dqn"):
        config = named_config(name)
        stored = json.loads(config_files.to_json(config))
        assert stored["learner"]["network"].pop("state") == {"kind": "flat"}
        assert config_files.from_json(json.dumps(stored), name) == config


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: ObjectsConfig(layers=()), r"at least one layer, got state.layers=\(\)"),
        (lambda: ObjectsConfig(layers=(8, 6), heads=4, pooling="attention"), "heads must divide 6, got heads=4"),
        (lambda: ObjectsConfig(place_scale=0.0), "place_scale must be a finite number above 0"),
        (
            lambda: NetworkConfig(state=ObjectsConfig(), context=ContextConfig()),
            "needs network.state=flat, got objects",
        ),
        (lambda: QNetworkConfig(state=ObjectsConfig(), context=ContextConfig()), "or network.context=None"),
        (lambda: QNetworkConfig(state=ObjectsConfig(), head="bilinear"), "use head=film, or network.state=flat"),
        (lambda: make_state_encoder(ObjectsConfig(), None, LOOK), r"LabelledEnv.objects.*use network.state=flat"),
        (
            lambda: make_state_encoder(ObjectsConfig(identity="role"), balls(3, 1), OneHotConfig(4)),
            "got one of OneHotConfig; use network.task_encoder=lookahead or roles",
        ),
        (
            lambda: make_state_encoder(ObjectsConfig(identity="role"), balls(7, 1), LOOK),
            "tells of 6 propositions, and objects stand for 7; set task_encoder.propositions to 7 or more",
        ),
        (lambda: Objects(((0, 1),), (0,), place=3), "got sizes 2 and place=3"),
        (lambda: Objects(((0, 1), (2,)), (0, 1)), "got sizes 1, 2 and place=0"),
        (lambda: Objects(((0, 1), (1, 2)), (0, 1)), "one object at most"),
        (lambda: Objects(((0, 1),), (-1,)), r"counted from 0, got numbers=.* and proposition=\(-1,\)"),
        (lambda: Objects(((0, 1),), (0, 1)), "got 1 objects and 2 propositions"),
    ],
)
def test_what_does_not_fit_is_refused(make, said):
    with pytest.raises(ValueError, match=said):
        make()
    assert make_state_encoder(FlatConfig(), None, LOOK) is not None
