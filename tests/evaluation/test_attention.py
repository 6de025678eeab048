"""Reading an agent: attention as softmax gives it, sums, token*, and what masking a token does."""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from flax import linen as nn
from scipy import stats

from t2tl_jax.env import State
from t2tl_jax.evaluation import attention as reading
from t2tl_jax.evaluation.attention import Attention, Met, Removal
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.networks.gru import GRUConfig
from t2tl_jax.networks.rgcn import RGCNConfig, operands, second_operand
from t2tl_jax.networks.task_encoders import TransformerTaskEncoder, make_task_encoder
from t2tl_jax.networks.transformer import TransformerConfig, sinusoidal_positions
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.training.types import Agent
from tests.parameters import parameters
from tests.probe import ProbeEnv

pytestmark = pytest.mark.slow  # nearly every test compiles a training or an evaluation

PROPOSITIONS = ("Black", "White", "Red", "Yellow")
TASK = "!Red U (Black & (!Yellow U White))"
TOKENS = ("until", "not", "Red", "and", "Black", "until", "not", "Yellow", "White")
SMALL = TransformerConfig(layers=2, width=8, heads=2, feed_forward=8, output=4)


def fresh(config, length=None):
    """Encoder, its parameters with some attention to speak of, and a table whose row 2 is the task."""
    table = compile_tasks(TASK, PROPOSITIONS, "at_most_one", length=length)
    encoder = TransformerTaskEncoder(config)
    return encoder, jax.tree.map(lambda x: 2 * x, parameters(encoder, table)["params"]), table


@pytest.fixture(scope="module")
def small():
    return fresh(SMALL)


def layer_norm(x):
    return (x - x.mean(-1, keepdims=True)) / np.sqrt(x.var(-1, keepdims=True) + 1e-5)


def test_weights_of_one_layer_and_head_are_what_softmax_gives():
    encoder, params, table = fresh(TransformerConfig(layers=1, width=8, heads=1, feed_forward=8, output=4), length=30)
    own = params["transformer"]
    layer = own["encoder"]["layer_0"]
    x = own["word_embedding"]["embedding"][np.asarray(table.tokens[2])] + sinusoidal_positions(30, 8)
    x = layer_norm(x) * layer["norm_1"]["scale"] + layer["norm_1"]["bias"]

    def project(name):
        weights = layer["attention"][name]
        return x[:9] @ weights["kernel"][:, 0] + weights["bias"][0]

    scores = np.exp(project("query") @ project("key").T / np.sqrt(8))
    expected = (scores / scores.sum(-1, keepdims=True)).mean(0)
    result = reading.attention_received(encoder, params, table, 2)
    assert result.tokens == TOKENS
    np.testing.assert_allclose(result.weights, expected[None], atol=1e-5)


def test_every_head_gives_one_to_the_real_tokens(small):
    encoder, params, table = small
    both = reading.attention_received(encoder, params, table, 2)
    assert both.weights.shape == (2, 9)
    np.testing.assert_allclose(both.weights.sum(1), 1.0, atol=1e-6)
    assert both.total.sum() == pytest.approx(2.0)
    apart = [reading.attention_received(encoder, params, table, 2, layers=(k,)).weights for k in (0, 1)]
    np.testing.assert_allclose(both.weights, np.mean(apart, 0), atol=1e-6)
    root = reading.attention_received(encoder, params, table, 2, queries="root")
    np.testing.assert_allclose(root.weights.sum(1), 1.0, atol=1e-6)
    assert np.abs(root.weights - both.weights).max() > 1e-3


def test_encoder_without_mask_is_read_over_the_real_tokens_only():
    """It ignores order, too: equal tokens receive the same, as in the published figure."""
    encoder, params, table = fresh(dataclasses.replace(SMALL, layers=1, masked=False, positions="none"), length=25)
    result = reading.attention_received(encoder, params, table, 2)
    np.testing.assert_allclose(result.weights.sum(1), 1.0, atol=1e-6)
    np.testing.assert_allclose(result.weights[:, [0, 1]], result.weights[:, [5, 6]], atol=1e-6)


def test_token_star_is_the_largest_sum_over_heads():
    """Not the largest single weight, and the first one of equals."""
    assert Attention(("a", "b", "c"), np.array([[0.6, 0.4, 0.0], [0.0, 0.5, 0.5]])).strongest == 1
    assert Attention(("a", "b"), np.array([[0.5, 0.5]])).strongest == 0


def test_agreement_is_a_rank_correlation():
    attention = Attention(("a", "b", "c"), np.array([[0.5, 0.2, 0.3]]))
    assert Removal(np.array([9.0, 0.1, 1.0]), np.zeros(3), 1, True).agreement(attention) == pytest.approx(1.0)
    effect = Removal(np.zeros(3), np.array([1.0, 3.0, 2.0]), 1, True)
    assert effect.strongest is None
    assert effect.agreement(attention, "policy") is None
    assert effect.agreement(attention, "value") == pytest.approx(-1.0)


@pytest.mark.slow
def test_a_removed_token_is_masked_and_the_others_keep_their_places(small):
    encoder, params, table = small
    codes = reading.codes_without_tokens(encoder, params, table, 2)
    encode = jax.jit(encoder.apply)
    assert codes.shape == (10, 4)
    np.testing.assert_allclose(codes[0], encode({"params": params}, table)[2], atol=1e-5)
    assert np.abs(codes[1:] - codes[0]).max(-1).min() > 1e-4
    # What stands at a masked place must not matter.
    other = dataclasses.replace(table, tokens=table.tokens.at[2, 4].set(20), mask=table.mask.at[2, 4].set(False))
    np.testing.assert_allclose(codes[1 + 4], encode({"params": params}, other)[2], atol=1e-5)


@pytest.mark.slow
def test_an_encoder_that_reads_padding_goes_on_reading_it():
    encoder, params, table = fresh(dataclasses.replace(SMALL, layers=1, masked=False), length=20)
    codes = reading.codes_without_tokens(encoder, params, table, 2)
    assert codes.shape == (10, 4)
    np.testing.assert_allclose(codes[0], jax.jit(encoder.apply)({"params": params}, table)[2], atol=1e-5)


@pytest.mark.parametrize(
    "config",
    [RGCNConfig(width=8, layers=4, output=4), pytest.param(GRUConfig(width=8, output=4), marks=pytest.mark.slow)],
)
def test_encoders_without_attention_are_read_by_removal(config):
    """Every token of the graph network and of the recurrent one has its effect, and masking takes away that one."""
    encoder = make_task_encoder(config)
    table = compile_tasks(TASK, PROPOSITIONS, "at_most_one")  # with padding behind the 9 tokens
    params = parameters(encoder, table)["params"]
    encode = jax.jit(lambda table: encoder.apply({"params": params}, table))
    codes = reading.codes_without_tokens(encoder, params, table, 2)
    assert codes.shape == (10, 4)
    np.testing.assert_allclose(codes[0], encode(table)[2], atol=1e-6)
    assert np.abs(codes[1:] - codes[0]).max(-1).min() > 1e-4
    # What stands at a masked place must not matter, if it has as many operands; what it was must.
    black, other = table.tokens[2, 4], table.tokens[2, 2]
    elsewhere = dataclasses.replace(table, tokens=table.tokens.at[2, 4].set(other), mask=table.mask.at[2, 4].set(False))
    assert black != other
    np.testing.assert_allclose(codes[1 + 4], encode(elsewhere)[2], atol=1e-6)
    with pytest.raises(ValueError, match="has none; removal reads it too"):
        reading.attention_received(encoder, params, table, 2)


def test_a_removed_node_takes_what_hangs_on_it_along():
    """Without the second until (5), no token below it (6 to 8) changes anything; without the first, none at all."""
    encoder = make_task_encoder(RGCNConfig(width=8, layers=4, output=4))
    table = compile_tasks(TASK, PROPOSITIONS, "at_most_one")
    params = parameters(encoder, table)["params"]
    encode = jax.jit(lambda mask: encoder.apply({"params": params}, dataclasses.replace(table, mask=mask))[2])
    tokens = table.tokens[2]
    assert tokens.shape[0] == 14 and operands(tokens)[5] == 2 and second_operand(tokens)[5] == 8
    without_until = table.mask.at[2, 5].set(False)
    for below in (6, 7, 8):
        np.testing.assert_array_equal(encode(without_until.at[2, below].set(False)), encode(without_until))
    assert np.abs(encode(without_until.at[2, 4].set(False)) - encode(without_until)).max() > 1e-4
    without_root = table.mask.at[2, 0].set(False)
    np.testing.assert_array_equal(encode(without_root.at[2, 4].set(False)), encode(without_root))


class Blind(nn.Module):
    """Reads tokens, and does not care what is masked."""

    def __call__(self, table):
        return table.tokens.astype(jnp.float32)


def test_an_encoder_that_ignores_the_mask_cannot_be_read():
    table = compile_tasks(TASK, PROPOSITIONS, "at_most_one")
    with pytest.raises(ValueError, match="Blind gives the same code whatever token is masked"):
        reading.codes_without_tokens(Blind(), {}, table, 2)


class ClockEnv(ProbeEnv):
    """Counts its steps and shows the count; Up with the third step, Down with the fifth."""

    observation_size = 1

    def reset(self, rng, params=None):
        return State(jnp.float32(0), jnp.zeros(1), jnp.float32(0), jnp.float32(0))

    def step(self, state, action, params=None):
        return state.replace(pipeline_state=state.pipeline_state + 1, obs=state.obs + 1)

    def labels(self, state):
        return jnp.stack([state.pipeline_state == 3, state.pipeline_state == 5])


def linear(params, carry, obs, task, other):
    """Policy changes by the size of what changes in the code, the value by its sum times the observation."""
    return jnp.full(len(obs), jnp.abs(other - task).sum()), (other - task).sum() * obs[:, 0]


STUB = Agent(
    init=lambda key, env_params: None,
    iterate=lambda state, env_params: (state, None),  # type: ignore[return-value, arg-type]
    embed=lambda params, table: jnp.zeros((table.num_rows, 1)),
    act=lambda *arguments: jnp.zeros((*arguments[-3].shape, 1)),  # of the rows
    frames_per_iteration=1,
    begin=lambda: jnp.zeros(()),  # remembers how many steps it made
    remember=lambda params, carry, obs, action, reward: carry + 1,
    compare=linear,
)


@pytest.mark.slow
def test_observations_are_drawn_from_the_steps_in_the_row():
    clock = ClockEnv()
    env = TaskEnv(clock, compile_tasks(["F(Up & F Down)"], clock.propositions, clock.alphabet))
    given, whole = env.make_params(0), int(env.table.initial_row[0])
    (rest,) = set(range(2, env.table.num_rows)) - {whole}
    play = jax.jit(partial(reading.meet, env, STUB, None, given), static_argnums=(2, 3))
    first = play(jax.random.key(0), whole, 600, 100)
    assert (first.steps == 3).all() and (first.carry == first.obs[:, 0]).all()
    counts = np.bincount(np.asarray(first.obs[:, 0]).astype(int), minlength=3)
    assert len(counts) == 3 and stats.chisquare(counts).pvalue > 0.001
    later = play(jax.random.key(0), rest, 600, 100)
    assert (later.steps == 2).all() and set(np.asarray(later.obs[:, 0])) == {3.0, 4.0}
    never = play(jax.random.key(0), 0, 600, 100)
    assert (never.steps == 0).all() and (never.obs == 0).all()
    assert (play(jax.random.key(0), rest, 600, 4).steps == 1).all()  # the time limit


def test_effects_are_means_over_the_episodes_that_met_the_row():
    codes = jnp.array([[0.0, 0.0], [1.0, 2.0], [-1.0, 0.0]])
    obs = jnp.array([[1.0], [2.0], [7.0]])
    effect = reading.removal_effects(STUB, None, codes, Met(obs, (), jnp.array([3, 1, 0])))
    np.testing.assert_allclose(effect.policy, [3.0, 1.0])
    np.testing.assert_allclose(effect.value, [4.5, 1.5])
    assert (effect.observations, effect.met) == (2, True)
    unmet = reading.removal_effects(STUB, None, codes, Met(obs, (), jnp.zeros(3, jnp.int32)))
    assert (unmet.observations, unmet.met) == (3, False)
    with pytest.raises(ValueError, match="cannot compare"):
        reading.removal_effects(STUB._replace(compare=None), None, codes, Met(obs, (), jnp.array([3, 1, 0])))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"row": 9}, "rows 0 to"),
        ({"layers": (2,)}, "layers 0 to 1"),
        ({"layers": ()}, "layers 0 to 1"),
        ({"queries": "last"}, 'queries are "all" or "root"'),
    ],
)
def test_impossible_readings_are_refused(small, arguments, said):
    encoder, params, table = small
    with pytest.raises(ValueError, match=said):
        reading.attention_received(encoder, params, table, **{"row": 2, **arguments})
