"""The codes that are read off the table: against a slow reading in Python, and what they must not depend on."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from experiments import configs  # noqa: F401, registers the configurations
from t2tl_jax.ltl import TaskTable, compile_pool, compile_reward_machines, compile_tasks, named_machines
from t2tl_jax.networks.automaton_encoder import AutomatonConfig
from t2tl_jax.networks.joined import JoinedConfig
from t2tl_jax.networks.lookahead import LookaheadConfig, LookaheadTaskEncoder
from t2tl_jax.networks.rgcn import RGCNConfig
from t2tl_jax.networks.task_encoders import make_task_encoder
from t2tl_jax.registry import make_env, named_config
from t2tl_jax.runs.pools import make_pools
from tests.parameters import parameters

COLOURS = ("Blue", "Green", "Magenta", "Yellow")
TASKS = ("!Blue U (Green & (!Magenta U Yellow))", "F Green & F(Blue | Yellow)", "X(Blue & X F Green)")
CONFIG = LookaheadConfig(propositions=5, steps=3)
SMALL = AutomatonConfig(width=7, rounds=4, output=5)
READERS = {"lookahead": CONFIG, "automaton": SMALL}


def table_of(*tasks: str, alphabet: str = "at_most_one") -> TaskTable:
    return compile_tasks(tasks, COLOURS, alphabet)


def look(config: LookaheadConfig, table: TaskTable) -> np.ndarray:
    return np.asarray(jax.jit(LookaheadTaskEncoder(config).apply)({}, table))


def slow_code(table: TaskTable, row: int, config: LookaheadConfig) -> list[float]:
    """The same code, step by step, from the automaton in plain Python."""
    automaton = table.automaton()
    names = [letter.split(" & ") for letter in config.letters] or [[name] for name in table.propositions]
    some = config.letters or config.one_at_a_time
    letters = [automaton.letter(of) for of in ([], *names)] if some else range(automaton.next_row.shape[1])

    def distance(start: int) -> float:
        front, seen, steps = {start}, {start}, 0
        while front:
            if 0 in front:
                return steps
            front = {int(automaton.next_row[now, letter]) for now in front for letter in letters} - seen
            seen |= front
            steps += 1
        return float("inf")

    def told(now: int) -> list[float]:
        if automaton.verdict[now]:
            return [0.0] * (config.kinds * config.told)
        after = [int(automaton.next_row[now, automaton.letter(of)]) for of in names]
        spare = [0.0] * (config.told - len(after))
        fails = [float(automaton.verdict[then] < 0) for then in after]
        nears = [float(distance(then) < distance(now)) for then in after]
        farther = [float(distance(then) > distance(now)) * (1 - fail) for then, fail in zip(after, fails, strict=True)]
        if config.avoid_farther:
            fails = [fail + far for fail, far in zip(fails, farther, strict=True)]
        return [*fails, *spare, *nears, *spare, *([*farther, *spare] if config.farther else [])]

    code, now = [], row
    for _ in range(config.steps):
        code += told(now)
        now = min((int(automaton.next_row[now, letter]) for letter in letters), key=distance)
    far = 0.0 if automaton.verdict[row] or np.isinf(distance(row)) else distance(row)
    return [*code, far]


@pytest.mark.parametrize(
    ("alphabet", "config"),
    [
        ("at_most_one", CONFIG),
        ("every_subset", CONFIG),
        ("every_subset", dataclasses.replace(CONFIG, one_at_a_time=True)),
        ("every_subset", dataclasses.replace(CONFIG, one_at_a_time=True, farther=True, avoid_farther=True)),
        ("at_most_one", dataclasses.replace(CONFIG, farther=True)),
        ("at_most_one", dataclasses.replace(CONFIG, farther=True, avoid_farther=True)),
        ("every_subset", LookaheadConfig(letters=("Green", "Blue & Green", "Yellow", "Magenta"), farther=True)),
    ],
)
def test_look_ahead_equals_a_walk_through_the_automaton(alphabet, config):
    table = table_of(*TASKS, "(Blue -> F Magenta) U Yellow", "F(Blue & Green) & F Yellow", alphabet=alphabet)
    code = look(config, table)
    assert code.shape == (table.num_rows, config.code_size)
    np.testing.assert_array_equal(code, [slow_code(table, row, config) for row in range(table.num_rows)])


def test_what_leads_farther_can_be_avoided_like_what_fails():
    """Blue after Green throws F(Green & (!Blue U Yellow)) back to its beginning, and fails nothing."""
    table = table_of("F(Green & (!Blue U Yellow))")
    row = int(table.step(table.initial_row[0], table.letter(jnp.array([False, True, False, False])))[0])
    first = {
        name: look(dataclasses.replace(CONFIG, **flags), table)[row][: len(table.propositions)].tolist()
        for name, flags in (("fails", {"farther": True}), ("both", {"farther": True, "avoid_farther": True}))
    }
    blue = table.propositions.index("Blue")
    assert first["fails"] == [0, 0, 0, 0] and first["both"] == [float(i == blue) for i in range(4)]
    with pytest.raises(ValueError, match="avoid_farther=True needs farther=True"):
        LookaheadConfig(avoid_farther=True)


def test_of_what_may_hold_together_one_thing_comes_after_the_other_if_only_one_counts_at_a_time():
    """Where balls can overlap, F(Green & F Yellow) is true after one letter, and Green alone brings it no nearer."""
    table = table_of("F(Green & F Yellow)", alphabet="every_subset")
    row, green = int(table.initial_row[0]), table.propositions.index("Green")
    code = {
        alone: look(dataclasses.replace(CONFIG, propositions=4, one_at_a_time=alone), table)[row]
        for alone in (False, True)
    }
    assert code[False][-1] == 1 and not code[False][4:8].any()
    assert code[True][-1] == 2 and code[True][4:8].tolist() == [float(i == green) for i in range(4)]
    with pytest.raises(ValueError, match="says what can hold at once already"):
        LookaheadConfig(letters=("Green",), one_at_a_time=True)


def test_ways_that_cannot_be_gone_do_not_count():
    """Green, Blue and Magenta hold together nowhere, so Magenta comes first; otherwise one step would do."""
    table = table_of("!Yellow U (Green & Blue) & (!Green U Magenta)", alphabet="every_subset")
    row = int(table.initial_row[0])
    config = LookaheadConfig(steps=2, letters=("Blue", "Green", "Magenta", "Yellow", "Blue & Green"))
    fails, nears, then_fails, then_nears, far = np.split(look(config, table)[row], [5, 10, 15, 20])
    np.testing.assert_array_equal(fails, [0, 1, 0, 1, 1])
    np.testing.assert_array_equal(nears, [0, 0, 1, 0, 0])
    np.testing.assert_array_equal(then_fails, [0, 0, 0, 1, 0])
    np.testing.assert_array_equal(then_nears, [0, 0, 0, 0, 1])
    assert far == 2 and look(CONFIG, table)[row][-1] == 1
    with pytest.raises(ValueError, match="speaks of Red; this environment has Blue"):
        look(LookaheadConfig(letters=("Red & Blue",)), table)
    with pytest.raises(ValueError, match="a letter comes twice"):
        LookaheadConfig(letters=("Red & Blue", "Blue & Red"))


def test_what_it_says_of_a_task_is_what_a_reader_would_say():
    table = table_of("!Blue U (Green & F(Magenta | Yellow))")
    code = look(LookaheadConfig(propositions=4, steps=2), table)
    now_fails, now_nears, then_fails, then_nears, far = np.split(code[int(table.initial_row[0])], [4, 8, 12, 16])
    np.testing.assert_array_equal(now_fails, [1, 0, 0, 0])
    np.testing.assert_array_equal(now_nears, [0, 1, 0, 0])
    np.testing.assert_array_equal(then_fails, [0, 0, 0, 0])
    np.testing.assert_array_equal(then_nears, [0, 0, 1, 1])
    assert far == [2]
    assert not code[:2].any()  # true and false


@pytest.mark.slow
@pytest.mark.parametrize("name", READERS)
def test_a_row_has_the_same_code_in_every_table(name):
    """Alone, where unused propositions have no letter; beside other tasks; and in a pool, where rows are left over."""
    encoder = make_task_encoder(READERS[name])
    task = "!Blue U (Green & F Yellow)"
    alone, beside = table_of(task), table_of(*TASKS, task)
    params = parameters(encoder, alone)
    encode = jax.jit(encoder.apply)
    expected = encode(params, alone)[alone.initial_row[0]]
    np.testing.assert_allclose(encode(params, beside)[beside.initial_row[-1]], expected, atol=1e-5)
    pool = compile_pool("chains", COLOURS, "at_most_one", 0, size=12, rows=64, length=30)
    codes = encode(params, pool)
    assert codes.shape == (64, READERS[name].code_size) and np.isfinite(codes).all()
    row = int(pool.initial_row[3])
    own = table_of(str(pool.formula(row)))
    np.testing.assert_allclose(encode(params, own)[own.initial_row[0]], codes[row], atol=1e-5)


def test_other_tables_of_equal_shapes_need_no_compilation():
    pools = [compile_pool("chains", COLOURS, "at_most_one", seed, size=8, rows=64, length=30) for seed in (0, 1)]
    traced = []

    @jax.jit
    def encode(table: TaskTable) -> jax.Array:
        traced.append(table.num_rows)
        return LookaheadTaskEncoder(CONFIG).apply({}, table)

    assert not np.array_equal(*map(encode, pools)) and traced == [64]


@pytest.mark.slow
def test_the_automaton_tells_rows_apart_by_their_future():
    """Every row has its own code if it listens long enough; after one round, rows with equal next verdicts do not."""
    table = table_of("X X X Blue")

    def distances(rounds: int) -> np.ndarray:
        encoder = make_task_encoder(AutomatonConfig(width=16, rounds=rounds, output=5))
        code = np.asarray(jax.jit(encoder.apply)(parameters(encoder, table), table))
        return np.abs(code[:, None] - code[None]).max(-1)

    assert (distances(4) + np.eye(table.num_rows) > 1e-4).all()
    assert distances(1)[2, 3] < 1e-6  # three and two steps to go, both open whatever comes next


def test_machines_are_read_too():
    table = compile_reward_machines(named_machines("rm_t10"), tuple("abcdef"), "every_subset")
    code = look(LookaheadConfig(propositions=6), table)
    np.testing.assert_array_equal(code, [slow_code(table, row, LookaheadConfig(6)) for row in range(table.num_rows)])
    encoder = make_task_encoder(SMALL)
    shape = jax.eval_shape(lambda key: encoder.apply(encoder.init(key, table), table), jax.random.key(0))
    assert shape.shape == (table.num_rows, 5)


@pytest.mark.slow
def test_two_encoders_side_by_side_are_both():
    table = table_of(*TASKS)
    config = JoinedConfig(CONFIG, RGCNConfig(6, 2, 5))
    encoder = make_task_encoder(config)
    params = parameters(encoder, table)
    own = {"params": params["params"]["second"]}
    code, second = jax.jit(lambda: (encoder.apply(params, table), make_task_encoder(config.second).apply(own, table)))()
    np.testing.assert_array_equal(code[:, : CONFIG.code_size], look(CONFIG, table))
    np.testing.assert_allclose(code[:, CONFIG.code_size :], second, atol=1e-6)
    assert config.learned and config.carries_over and config.reads_tokens
    assert not JoinedConfig(CONFIG, CONFIG).learned


def test_too_many_propositions_are_refused():
    with pytest.raises(ValueError, match=r"room for 3 propositions .* the 4 .* task_encoder.propositions to 4 or more"):
        LookaheadTaskEncoder(LookaheadConfig(propositions=3)).apply({}, table_of("F Blue"))
    with pytest.raises(ValueError, match="steps must be at least 1"):
        LookaheadConfig(steps=0)


def test_it_may_stand_in_a_loss():
    """Nothing in it is to be learned, whatever the loop inside."""
    table, encoder = table_of("F Blue"), make_task_encoder(CONFIG)
    slope = jax.jit(jax.grad(lambda weight: (weight * encoder.apply({}, table)).sum()))(jnp.float32(2.0))
    assert slope == look(CONFIG, table).sum()
    assert not jax.tree.leaves(jax.eval_shape(encoder.init, jax.random.key(0), table))


@pytest.mark.slow
def test_the_agent_of_waterworld_is_told_a_goal_in_every_open_row():
    """Balls can overlap there, and where letters of several balls count, no single one brings a chain nearer."""
    config = named_config("water_any")
    pool = make_pools(config, make_env(config.env)).training(0)
    reader = config.learner.task_encoder
    told = look(reader, pool)[:, : reader.kinds * reader.told].reshape(pool.num_rows, reader.kinds, -1)
    is_open = np.asarray(pool.verdict) == 0
    assert is_open.sum() > 100 and told[is_open, 1].any(axis=-1).all()
    blind = look(dataclasses.replace(reader, one_at_a_time=False), pool)
    assert not blind[:, : reader.kinds * reader.told].reshape(pool.num_rows, reader.kinds, -1)[is_open, 1].any(-1).all()
