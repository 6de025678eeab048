"""Task encoders: the graph network against a walk over the tree, the recurrent one against a loop, codes of states."""

import math
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from flax import linen as nn

from t2tl_jax.ltl import Formula, TaskTable, compile_reward_machines, compile_tasks, named_machines
from t2tl_jax.ltl.tokens import FIRST_PROPOSITION, OPERATOR_ID
from t2tl_jax.networks.actor_critic import ActorCritic, NetworkConfig
from t2tl_jax.networks.gru import GRUConfig
from t2tl_jax.networks.q_network import QNetwork, QNetworkConfig
from t2tl_jax.networks.rgcn import RGCNConfig, second_operand
from t2tl_jax.networks.task_encoders import OneHotConfig, OneHotTaskEncoder, make_task_encoder
from t2tl_jax.networks.transformer import TransformerConfig
from tests.parameters import parameters

PROPOSITIONS = ("Black", "White", "Red", "Yellow")
TASKS = ("!Red U (Black & (!Yellow U White))", "F(Red & X(Black | F Yellow))", "F Red & F White")
SIZES = {
    "transformer": TransformerConfig(layers=1, width=9, heads=3, feed_forward=7, output=5),
    "rgcn": RGCNConfig(width=6, layers=3, output=5),
    "gru": GRUConfig(width=6, output=5),
}
READERS = tuple(SIZES)


@pytest.fixture(scope="module")
def table() -> TaskTable:
    return compile_tasks(TASKS, PROPOSITIONS, "at_most_one")


@pytest.fixture(scope="module", params=READERS)
def reader(request, table):
    """An encoder of formulas as (compiled function of params and table, params)."""
    encoder = make_task_encoder(SIZES[request.param])
    return jax.jit(encoder.apply), parameters(encoder, table)


def token_of(formula: Formula, table: TaskTable) -> int:
    """The id of a formula's root."""
    return FIRST_PROPOSITION + table.propositions.index(formula.name) if formula.name else OPERATOR_ID[formula.op]


@pytest.mark.slow
def test_code_of_a_row_depends_on_nothing_but_its_formula(reader, table):
    encode, params = reader
    code = encode(params, table)
    assert code.shape == (table.num_rows, 5) and np.isfinite(code).all()
    distances = np.abs(code[:, None] - code[None, :]).max(-1) + np.eye(table.num_rows)
    assert distances.min() > 1e-3  # every row has its own
    order = jnp.arange(table.num_rows)[::-1]
    turned = encode(params, table.replace(tokens=table.tokens[order], mask=table.mask[order]))
    np.testing.assert_allclose(turned[order], code, atol=1e-5)
    padded = compile_tasks(TASKS, PROPOSITIONS, "at_most_one", length=40)
    np.testing.assert_allclose(encode(params, padded), code, atol=1e-5)


def test_second_operand_is_where_the_tree_says(table):
    found = np.asarray(jax.jit(second_operand)(table.tokens))

    def check(formula: Formula, row: int, position: int) -> None:
        assert table.tokens[row, position] == token_of(formula, table)
        if len(formula.args) == 2:
            assert found[row, position] == position + 1 + formula.args[0].size
        for k, arg in enumerate(formula.args):
            check(arg, row, position + 1 + k * formula.args[0].size)

    for row in range(table.num_rows):
        check(table.formula(row), row, 0)


@pytest.mark.parametrize("layers", [1, 3])
def test_graph_network_equals_a_walk_over_the_tree(table, layers):
    """Round by round and node by node in NumPy, with the network's weights."""
    encoder = make_task_encoder(RGCNConfig(width=6, layers=layers, output=5))
    variables = parameters(encoder, table)
    params = variables["params"]
    (own, arg, arg1, arg2), bias = params["convolution"]["weights"], params["convolution"]["bias"]

    def start(node: Formula) -> np.ndarray:
        return params["input"]["kernel"][token_of(node, table)] + params["input"]["bias"]

    def state(node: Formula, rounds: int) -> np.ndarray:
        """The node's vector after so many rounds."""
        if rounds == 0:
            return start(node)
        heard = [np.append(state(child, rounds - 1), start(child)) for child in node.args]
        total = np.append(state(node, rounds - 1), start(node)) @ own + bias
        for message, relation in zip(heard, {0: (), 1: (arg,), 2: (arg1, arg2)}[len(heard)], strict=True):
            total = total + message @ relation
        return np.tanh(total)

    code = jax.jit(encoder.apply)(variables, table)
    for row in range(table.num_rows):
        expected = state(table.formula(row), layers) @ params["output"]["kernel"] + params["output"]["bias"]
        np.testing.assert_allclose(code[row], expected, atol=1e-5)


def test_published_graph_network_has_its_size():
    """Linear 22 -> 32, one convolution of four relations 64 -> 32 for all eight rounds, Linear 32 -> 32."""
    encoder = make_task_encoder(RGCNConfig())
    table = compile_tasks(TASKS, PROPOSITIONS, "at_most_one")
    variables = jax.eval_shape(encoder.init, jax.random.key(0), table)
    assert sum(leaf.size for leaf in jax.tree.leaves(variables)) == 22 * 32 + 32 + 4 * 64 * 32 + 32 + 32 * 32 + 32


def test_recurrent_network_equals_a_loop_over_the_tokens(table):
    encoder = make_task_encoder(SIZES["gru"])
    variables = parameters(encoder, table)
    params = variables["params"]
    cell, step = {"params": params["cell"]}, jax.jit(nn.GRUCell(6).apply)
    code = jax.jit(encoder.apply)(variables, table)
    for row in (2, table.num_rows - 1):
        state = np.zeros(6, np.float32)
        for token in np.asarray(table.tokens[row])[np.asarray(table.mask[row])]:
            state, _ = step(cell, state, params["word_embedding"]["embedding"][token])
        expected = np.tanh(state @ params["output"]["kernel"] + params["output"]["bias"])
        np.testing.assert_allclose(code[row], expected, atol=1e-5)


def test_one_hot_code_numbers_the_open_rows():
    table = compile_tasks("F(Red & F(Black & F Yellow))", PROPOSITIONS, "at_most_one")
    code = OneHotTaskEncoder(OneHotConfig(4)).apply({}, table)
    np.testing.assert_array_equal(code, [[0, 0, 0, 0], [0, 0, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]])
    for size in (6, 16, 32):
        padded = OneHotTaskEncoder(OneHotConfig(size)).apply({}, table)
        np.testing.assert_array_equal(padded, np.pad(code, ((0, 0), (0, size - 4))))
    np.testing.assert_array_equal(OneHotTaskEncoder(OneHotConfig(1)).apply({}, table), [[0], [0], [1], [2], [3]])


def test_machines_have_codes_but_nothing_to_read():
    """Both networks, so that every learner refuses in the same words."""
    table = compile_reward_machines(named_machines("rm_t10"), tuple("abcdef"), "every_subset")
    assert OneHotTaskEncoder(OneHotConfig(32)).apply({}, table).shape == (table.num_rows, 32)
    assert OneHotTaskEncoder(OneHotConfig(1)).apply({}, table)[-1] == table.num_rows - 2
    for name in READERS:
        for network in (
            ActorCritic(NetworkConfig(task_encoder=SIZES[name]), 2),
            QNetwork(QNetworkConfig(task_encoder=SIZES[name]), 5),
        ):
            with pytest.raises(ValueError, match="no formula to read: use a one-hot task encoder"):
                jax.eval_shape(partial(network.init, method="embed"), jax.random.key(0), table)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: OneHotConfig(0), "size must be at least 1"),
        (lambda: RGCNConfig(layers=0), "at least 1"),
        (lambda: NetworkConfig(env_layers=(64, 0)), r"env_layers are sizes of layers, each at least 1, got \(64, 0\)"),
        (lambda: NetworkConfig(value_scale=math.nan), "value_scale must be a finite number"),
        (lambda: NetworkConfig(value_bias=-math.inf), "value_bias must be a finite number"),
        (lambda: QNetworkConfig(state_layers=(0,)), "state_layers are sizes"),
        (lambda: QNetworkConfig(task_layer=0), "task_layer must be at least 1"),
        (lambda: QNetworkConfig(head_layers=(0,)), "head_layers are sizes"),
        (lambda: QNetworkConfig(head="bilinear", head_layers=(8,)), r"got head_layers=\(8,\); use head=concat or"),
        (lambda: GRUConfig(width=0), "at least 1"),
        (lambda: TransformerConfig(output=0), "at least 1"),
        (lambda: TransformerConfig(width=60), "heads must divide width"),
        (lambda: TransformerConfig(width=0), "at least 1"),
    ],
)
def test_sizes_are_checked(make, said):
    with pytest.raises(ValueError, match=said):
        make()


def test_too_many_states_for_the_code():
    table = compile_tasks("F(Red & F(Black & F Yellow))", PROPOSITIONS, "at_most_one")
    network = ActorCritic(NetworkConfig(task_encoder=OneHotConfig(2)), 2)
    with pytest.raises(ValueError, match=r"set task_encoder.size to 3 or more \(or to 1"):
        network.init(jax.random.key(0), table, jnp.zeros(76), jnp.int32(2), method="initialise")


def test_all_networks_take_any_encoder(table):
    """Parameters of the encoder are those under `task_encoder`, equal for both networks: transfer rests on that."""
    for name in READERS:
        shapes = [
            jax.eval_shape(partial(network.init, method="embed"), jax.random.key(0), table)["params"]["task_encoder"]
            for network in (
                ActorCritic(NetworkConfig(task_encoder=SIZES[name]), 2),
                QNetwork(QNetworkConfig(task_encoder=SIZES[name]), 5),
            )
        ]
        assert shapes[0] == shapes[1]
