"""Context windows of merged states: what is remembered is read for the task of the step that reads it."""

import dataclasses
from functools import partial

import chex
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from brax.envs.base import State

from t2tl_jax.agents.ppo import make_ppo
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.networks.actor_critic import ActorCritic, NetworkConfig
from t2tl_jax.networks.context_config import ContextConfig
from t2tl_jax.networks.gru import GRUConfig
from t2tl_jax.networks.merged import MergedConfig
from t2tl_jax.networks.objects import ObjectsConfig
from t2tl_jax.networks.q_network import QNetworkConfig
from t2tl_jax.networks.roles import RolesConfig
from t2tl_jax.networks.state_encoders import FlatConfig
from t2tl_jax.networks.windows import Segment
from t2tl_jax.objects import Objects
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.training.types import repeated
from tests.agents import sizes
from tests.parameters import begun_quickly, parameters
from tests.probe import CueEnv

COLOURS, READINGS = 3, 2
OBSERVATION = 1 + COLOURS * READINGS
LIDARS = Objects.blocks(range(1, OBSERVATION, READINGS), READINGS, range(COLOURS))
SEGMENTS, STEPS, WINDOW = 3, 4, 3
CONTEXT = ContextConfig(length=WINDOW, reader=GRUConfig(width=8, output=4), segment_length=STEPS)
NETWORK = NetworkConfig(
    task_encoder=RolesConfig(propositions=COLOURS),
    state=MergedConfig(),
    env_layers=(8,),
    actor_layers=(),
    critic_layers=(),
    context=CONTEXT,
)


def make_network(**changes):
    context = dataclasses.replace(CONTEXT, **changes)
    network = ActorCritic(dataclasses.replace(NETWORK, context=context), action_size=2, objects=LIDARS)
    table = compile_tasks(["F a"], ("a", "b", "c"), "at_most_one")
    carry = repeated(network.begin(OBSERVATION), 1)
    given = jnp.zeros((1, OBSERVATION)), jnp.full(1, 2), carry
    return network, parameters(network, table, *given, method="initialise")


def drawn(*shape, seed=0):
    """Observations, actions, rewards, ends of episodes and codes of tasks, each of `shape`."""
    rng = np.random.default_rng(seed)
    sizes_of = (OBSERVATION,), (2,), (), (NETWORK.task_encoder.code_size,)
    obs, action, reward, task = (rng.normal(size=(*shape, *size)).astype(np.float32) for size in sizes_of)
    return np.abs(obs), action, reward, rng.random(shape) < 0.25, task


@pytest.mark.slow
@pytest.mark.parametrize("reset", [True, False])
def test_windows_of_segments_are_those_that_were_carried(reset):
    """The task is another one at every step, and a window that was carried never saw that of another step."""
    network, params = make_network(reset=reset)
    before = WINDOW + 1
    obs, action, reward, ended, task = drawn(SEGMENTS, before + STEPS)
    ended[0, before - 1] = True  # one segment begins with an empty window
    next_obs, _, _, _, next_task = drawn(SEGMENTS, before + STEPS, seed=1)
    assert ended[:, before:-1].any() and not ended[:, before:].all()

    @jax.jit
    def step(carry, obs, action, reward, ended, task, next_obs, next_task):
        features = network.apply(params, obs, task, carry, method="features")
        after = network.apply(params, carry, obs, action, reward, method="remember")
        value_after = network.apply(params, next_obs, next_task, after, method="value")
        return network.next_episode(after, ended), features, value_after

    carry, carried = repeated(network.begin(OBSERVATION), SEGMENTS), []
    for t in range(before + STEPS):
        if t == before:
            start = carry
        now = (x[:, t] for x in (obs, action, reward, ended, task, next_obs, next_task))
        carry, *of_step = step(carry, *now)
        carried.append(of_step)
    expected = [np.stack(x, 1) for x in zip(*carried[before:], strict=True)]

    obs, action, reward, ended, task, next_obs, next_task = (
        x[:, before:] for x in (obs, action, reward, ended, task, next_obs, next_task)
    )

    @jax.jit
    def from_segment(segment, obs, task, next_obs, next_task):
        features = network.apply(params, obs, task, segment, method="features")
        return features, network.apply(params, obs, next_obs, next_task, segment, method="value_after")

    features, value_after = from_segment(
        Segment(start, action, reward, ended, seen=None), obs, task, next_obs, next_task
    )
    np.testing.assert_allclose(features, expected[0], atol=1e-6)
    np.testing.assert_allclose(value_after, expected[1], atol=1e-6)
    assert np.abs(features[..., -CONTEXT.reader.output :]).max() > 0.1  # the window's part of the features


@pytest.mark.slow
def test_what_is_remembered_is_known_by_its_role_alone():
    """Two colours that change places in all observations and in the task change nothing; in one of them they do."""
    network, params = make_network()
    obs, action, reward, _, task = drawn(5, WINDOW + 1)
    read = jax.jit(partial(network.apply, method="features"))

    def features(obs, task):
        carry = repeated(network.begin(OBSERVATION), len(obs))
        for t in range(WINDOW):
            carry = network.apply({}, carry, obs[:, t], action[:, t], reward[:, t], method="remember")
        return np.asarray(read(params, obs[:, WINDOW], task[:, WINDOW], carry))

    order = np.array([2, 1, 0])
    lidars = obs[..., 1:].reshape(5, WINDOW + 1, COLOURS, READINGS)[..., order, :].reshape(5, WINDOW + 1, -1)
    other_obs = np.concatenate([obs[..., :1], lidars], -1)
    remembered_alone = np.concatenate([other_obs[:, :WINDOW], obs[:, WINDOW:]], 1)
    other_task = task.reshape(5, WINDOW + 1, COLOURS, -1)[..., order, :].reshape(task.shape)
    first = features(obs, task)
    np.testing.assert_allclose(features(other_obs, other_task), first, atol=1e-6)
    for changed in (features(other_obs, task), features(obs, other_task), features(remembered_alone, task)):
        window = np.abs(changed - first)[:, -CONTEXT.reader.output :]
        assert window.max(axis=1).min() > 1e-3


class ColouredCueEnv(CueEnv):
    """`CueEnv` whose cue is an object, of one proposition or of the other."""

    objects = Objects.blocks((0, 1), 1, (0, 1))

    def _cued(self, cue: jax.Array, age: jax.Array, outcome: jax.Array) -> State:
        obs = jnp.stack([(cue > 0) & (age == 0), (cue < 0) & (age == 0), age == self.delay]).astype(jnp.float32)
        return State(jnp.stack([cue, age, outcome]), obs, jnp.float32(0), jnp.float32(0))


@pytest.mark.slow
def test_ppo_learns_from_the_windows_that_acted():
    """Ratio 1 in one minibatch, also with what was seen in an episode of the other task; and the tokens are learnt."""
    probe = ColouredCueEnv()
    env = TaskEnv(probe, compile_tasks(["!Down U Up", "!Up U Down"], probe.propositions, probe.alphabet))
    context = dataclasses.replace(CONTEXT, segment_length=8, reset=False)
    network = dataclasses.replace(NETWORK, task_encoder=RolesConfig(propositions=2), context=context)
    ppo = dataclasses.replace(sizes.PPO, network=network, num_envs=16, unroll_length=16, epochs=1, minibatch_size=256)
    agent, given = make_ppo(env, ppo, 5, 10), env.make_params(0)
    begun = state = jax.jit(begun_quickly(agent).init)(jax.random.key(0), given)
    iterate = jax.jit(agent.iterate)
    for _ in range(2):
        state, metrics = iterate(state, given)
        assert abs(metrics.scalars["kl"]) < 1e-6 and metrics.scalars["clip_fraction"] == 0
    chex.assert_tree_all_finite(state.params)
    assert state.carry.valid.all() and state.carry.seen.shape == (16, WINDOW, 3)  # observations, not what is merged
    tokens, first = (x.params["params"]["context_encoder"]["token"]["kernel"] for x in (state, begun))
    features = slice(2, None)  # behind action and reward: of cues, by what they are to the task
    assert np.abs(tokens - first)[features].max() > 1e-4


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (
            lambda: dataclasses.replace(NETWORK, state=ObjectsConfig()),
            "got objects; use flat, or network.state=m",
        ),
        (
            lambda: dataclasses.replace(NETWORK, context=dataclasses.replace(CONTEXT, recompute=False)),
            "recompute=False needs network.state=flat, got merged; use recompute=True, or flat",
        ),
        (
            lambda: QNetworkConfig(state=MergedConfig(), context=ContextConfig()),
            "DQN with context needs network.state=flat, got merged; use flat, or network.context=None; PPO's",
        ),
    ],
)
def test_what_a_window_cannot_hold_is_refused(make, said):
    with pytest.raises(ValueError, match=said):
        make()
    assert NETWORK.windows_by_task and not dataclasses.replace(NETWORK, context=None).windows_by_task
    assert not dataclasses.replace(NETWORK, state=FlatConfig()).windows_by_task
