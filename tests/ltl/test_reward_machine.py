"""Reward machines: the ten water tasks against their published tables, the compiled table, and LTL."""

import itertools
import random

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.ltl import (
    WATER_PROPOSITIONS,
    LTLError,
    TooLargeError,
    compile_named,
    compile_reward_machines,
    compile_tasks,
    named_machines,
    parse_machine,
)
from t2tl_jax.networks.task_encoders import OneHotConfig, OneHotTaskEncoder, TransformerTaskEncoder
from t2tl_jax.networks.transformer import TransformerConfig
from t2tl_jax.task_env import TaskEnv
from tests.ltl.ltl_oracles import letters_of
from tests.probe import ProbeEnv

ABCDEF = tuple("abcdef")
LETTERS = letters_of(ABCDEF)

# ----- the published tables, in their own notation: in state s the first listed letter present fires -----

INTERLEAVED = "0: b>6, c>2; 1: a>0, c>3; 2: d>7, b>5; 3: d>8, a>2; 5: d>T; 6: c>5; 7: b>T; 8: a>7"
ORDERED = {
    "t1": "0: b>T; 1: a>0",
    "t2": "0: d>T; 1: c>0",
    "t3": "0: f>T; 1: e>0",
    "t4": INTERLEAVED,
    "t5": "0: d>6, e>2; 1: c>0, e>3; 2: f>7, d>5; 3: f>8, c>2; 5: f>T; 6: e>5; 7: d>T; 8: c>7",
    "t6": "0: b>6, e>2; 1: a>0, e>3; 2: f>7, b>5; 3: f>8, a>2; 5: f>T; 6: e>5; 7: b>T; 8: a>7",
    "t7": """0: b>12, c>4, e>2; 1: a>0, c>5, e>3; 2: b>14, c>6, f>17; 3: a>2, c>7, f>18; 4: b>11, d>21, e>6;
        5: a>4, d>22, e>7; 6: b>13, d>23, f>19; 7: a>6, d>24, f>20; 9: f>T; 10: e>9; 11: d>10, e>13; 12: c>11, e>14;
        13: d>9, f>15; 14: c>13, f>16; 15: d>T; 16: c>15; 17: b>16, c>19; 18: a>17, c>20; 19: b>15, d>25;
        20: a>19, d>26; 21: b>10, e>23; 22: a>21, e>24; 23: b>9, f>25; 24: a>23, f>26; 25: b>T; 26: a>25""",
    "t8": """0: c>12, d>3; 1: b>0, d>4; 2: a>1, d>5; 3: c>11, e>6; 4: b>3, e>7; 5: a>4, e>8; 6: c>10, f>13;
        7: b>6, f>14; 8: a>7, f>15; 10: f>T; 11: e>10; 12: d>11; 13: c>T; 14: b>13; 15: a>14""",
}
STRICT = {"t9": "abc", "t10": "def"}
START = {name: "2" if name == "t8" else "1" for name in (*ORDERED, *STRICT)}
NAMES = tuple(START)


def read_table(text):
    """Per state, the (letter, target) pairs in order."""
    table = {}
    for part in text.split(";"):
        state, moves = part.split(":")
        table[state.strip()] = [tuple(move.strip().split(">")) for move in moves.split(",")]
    return table


def published_states(name):
    return list(read_table(ORDERED[name])) if name in ORDERED else ["1", "2", "3"]


def published_step(name, state, letters, quirk=False):
    """The next state ("T" completed, "fell") and the reward, straight from the tables."""
    if name in ORDERED:
        for letter, target in read_table(ORDERED[name])[state]:
            if letter in letters:
                return target, float(target == "T")
        return state, 0.0
    stage = int(state)
    if not letters:
        return state, 0.0
    if letters == {STRICT[name][stage - 1]}:
        return ("T", 1.0) if stage == 3 else (str(stage + 1), 0.0)
    return "fell", float(quirk and stage == 3)


@pytest.fixture(scope="module", params=["rm_water", "rm_water_published"])
def water(request):
    """The table of the ten tasks, and whether it has the published quirk."""
    return compile_named(request.param, ABCDEF), request.param == "rm_water_published"


def test_ten_tasks_equal_the_published_tables_on_every_letter_set(water):
    table, quirk = water
    automaton = table.automaton()
    rows = [(name, state) for name in NAMES for state in published_states(name)]
    row_of = {task_state: 2 + index for index, task_state in enumerate(rows)}
    assert len(rows) == 77 and table.num_rows == 79 and len(LETTERS) == table.num_letters == 64
    for (name, state), row in row_of.items():
        for letters in LETTERS:
            target, reward = published_step(name, state, letters, quirk)
            letter = automaton.letter(letters)
            expected = {"T": 0, "fell": 1}.get(target) if target in ("T", "fell") else row_of[name, target]
            assert automaton.next_row[row, letter] == expected
            assert automaton.rewards[row, letter] == reward
    assert table.initial_row.tolist() == [row_of[name, START[name]] for name in NAMES]


@pytest.mark.parametrize("name", NAMES)
def test_the_host_interpreter_steps_alike(name):
    for quirk in (False, True):
        (machine,) = named_machines(f"rm_{name}_published" if quirk and name in STRICT else f"rm_{name}")
        assert machine.start == START[name] and list(machine.states) == published_states(name)
        for state, letters in itertools.product(machine.states, LETTERS):
            target, reward = published_step(name, state, letters, quirk)
            assert machine.step(state, letters) == ({"T": "done", "fell": "fail"}.get(target, target), reward)


def test_numbers_of_the_ten_tasks():
    machines = named_machines("rm_water")
    assert [len(machine.states) for machine in machines] == [2, 2, 2, 8, 8, 8, 26, 15, 3, 3]
    edges = [len({(t.source, t.target) for t in m.transitions if t.source != t.target}) for m in machines]
    assert edges == [2, 2, 2, 12, 12, 12, 54, 24, 3, 3] and sum(edges) == 126


def test_only_the_last_states_of_t9_and_t10_pay_differently_as_published():
    plain, published = compile_named("rm_water", ABCDEF), compile_named("rm_water_published", ABCDEF)
    assert (plain.next_row == published.next_row).all()
    different = np.unique(np.nonzero(np.asarray(plain.transition_reward != published.transition_reward))[0])
    assert [published.text(int(row)) for row in different] == ["t9_published.3", "t10_published.3"]
    for row in different:
        falls = np.asarray(published.next_row[row] == 1)
        assert falls.sum() == 62  # every letter set but {} and the right one
        assert (np.asarray(published.transition_reward[row])[falls] == 1).all()
        assert (np.asarray(plain.transition_reward[row])[falls] == 0).all()
    assert published.verdict.tolist() == [1, -1] + [0] * 77  # a fall is no success, whatever it pays


# ----- against LTL: an independent reading of what the tables mean -----

THEN = "F({} & X F {})"
MEANING = {
    "t1": THEN.format("a", "b"),
    "t2": THEN.format("c", "d"),
    "t3": THEN.format("e", "f"),
    "t4": f"{THEN.format('a', 'b')} & {THEN.format('c', 'd')}",
    "t5": f"{THEN.format('c', 'd')} & {THEN.format('e', 'f')}",
    "t6": f"{THEN.format('a', 'b')} & {THEN.format('e', 'f')}",
    "t7": f"{THEN.format('a', 'b')} & {THEN.format('c', 'd')} & {THEN.format('e', 'f')}",
    "t8": "F(a & X F(b & X F c)) & F(d & X F(e & X F f))",
    "t9": "N U (a & X(N U (b & X(N U c))))".replace("N", "(!a & !b & !c & !d & !e & !f)"),
    "t10": "N U (d & X(N U (e & X(N U f))))".replace("N", "(!a & !b & !c & !d & !e & !f)"),
}


def equivalent(left, right):
    """Whether the first tasks of two tables have the same verdict after every word: a walk over pairs of rows."""
    pairs = [(int(left.initial_row[0]), int(right.initial_row[0]))]
    for one, other in pairs:
        if left.verdict[one] != right.verdict[other]:
            return False
        following = zip(left.next_row[one].tolist(), right.next_row[other].tolist(), strict=True)
        pairs.extend(pair for pair in dict.fromkeys(following) if pair not in pairs)
    return True


@pytest.mark.parametrize("name", NAMES)
def test_one_letter_at_a_time_a_machine_is_its_formula(name):
    machine = compile_named(f"rm_{name}", ABCDEF, "at_most_one").automaton()
    formula = compile_tasks(MEANING[name], ABCDEF, "at_most_one").automaton()
    assert equivalent(machine, formula)
    assert len(machine.verdict) == len(formula.verdict)  # so the machine is minimal, too


def test_phi_water_as_formula_and_as_machine_agree_on_words_of_single_letters():
    single = [compile_named(name, WATER_PROPOSITIONS, "at_most_one") for name in ("phi_water", "rm_phi_water")]
    assert equivalent(*(table.automaton() for table in single))
    formula, machine = (compile_named(name, WATER_PROPOSITIONS) for name in ("phi_water", "rm_phi_water"))
    rng = np.random.default_rng(0)
    # Mostly goals, so that long words occur that are not decided at once.
    colours = rng.choice(9, size=(400, 40), p=[0.14, 0.14, 0.14, 0.14, 0.14, 0.01, 0.01, 0.01, 0.27])
    labels = jnp.asarray(colours[..., None] == np.arange(8))

    def walk(table, labels):
        def step(carry, label):
            row, total = carry
            following, reward = table.step(row, table.letter(label))
            carry = following, total + jnp.where(table.is_open[row], reward, 0)
            return carry, (table.verdict[carry[0]], carry[1])

        return jax.lax.scan(step, (table.initial_row[0], jnp.float32(0)), labels)[1]

    verdicts, returns = zip(*(jax.jit(jax.vmap(walk, (None, 0)))(t, labels) for t in (formula, machine)), strict=True)
    assert (verdicts[0] == verdicts[1]).all() and (returns[0] == returns[1]).all()
    assert set(np.unique(verdicts[0][:, -1])) == {-1, 0, 1}


@pytest.mark.parametrize(
    ("word", "formula", "machine"),
    [
        ([{"Yellow", "Purple"}, {"Magenta"}, {"Orange"}, {"Gray"}], 1, 0),  # two goals in one step
        ([{"Yellow"}, {"Purple"}, {"Magenta"}, {"Orange"}, {"Gray", "Pink"}], 1, -1),  # the last goal and an obstacle
        ([{"Yellow", "Pink"}], -1, -1),
    ],
)
def test_phi_water_as_formula_and_as_machine_on_simultaneous_letters(word, formula, machine):
    for name, verdict in (("phi_water", formula), ("rm_phi_water", machine)):
        table = compile_named(name, WATER_PROPOSITIONS).automaton()
        row = int(table.initial_row[0])
        for label in word:
            row = int(table.next_row[row, table.letter(label)])
        assert table.verdict[row] == verdict


# ----- the table -----


def slow_rows(table, machines, letter):
    """What `step_all` should give for machines, by the interpreter, row by row."""
    states = [("done", None), ("fail", None)] + [(state, machine) for machine in machines for state in machine.states]
    where = {(state, id(machine)): row for row, (state, machine) in enumerate(states)}
    rows, rewards = [0, 1], [0.0, 0.0]
    for state, machine in states[2:]:
        target, reward = machine.step(state, letter)
        rows.append({"done": 0, "fail": 1}.get(target) if target in ("done", "fail") else where[target, id(machine)])
        rewards.append(reward)
    return rows, rewards


@pytest.mark.slow
def test_all_rows_at_once_against_a_slow_loop_over_states():
    machines = named_machines("rm_water_published")
    table = compile_reward_machines(machines, ABCDEF)
    rng = random.Random(0)
    words = [[frozenset(n for n in ABCDEF if rng.random() < 0.3) for _ in range(4)] for _ in range(3)]
    labels = jnp.array([[[name in label for name in ABCDEF] for label in word] for word in words])
    rows, rewards = jax.jit(lambda table, labels: table.step_all(table.letter(labels)))(table, labels)
    assert rows.shape == rewards.shape == (79, 3, 4) and rows.dtype == jnp.int32 and rewards.dtype == jnp.float32
    for i, j in np.ndindex(3, 4):
        assert (rows[:, i, j].tolist(), rewards[:, i, j].tolist()) == slow_rows(table, machines, words[i][j])
    everywhere = np.arange(table.num_rows)[:, None, None]
    again = jax.jit(lambda table, labels: table.step(everywhere, table.letter(labels)))(table, labels)
    assert (again[0] == rows).all() and (again[1] == rewards).all()


def test_all_rows_at_once_against_a_slow_loop_over_formulas():
    from t2tl_jax.ltl import progress

    table = compile_tasks(["!a U (b & F c)", "F(a & X b)"], ("a", "b", "c"))
    assert table.transition_reward is None and table.is_open.tolist() == (np.asarray(table.verdict) == 0).tolist()
    for label in letters_of(("a", "b", "c")):
        letter = table.letter(jnp.array([name in label for name in ("a", "b", "c")]))
        rows, rewards = table.step_all(letter)
        following = [progress(table.formula(row), label) for row in range(table.num_rows)]
        shared = compile_tasks([*following, *(table.formula(int(row)) for row in rows)], ("a", "b", "c"))
        first, second = np.split(np.asarray(shared.initial_row), 2)
        assert (first == second).all()
        assert rewards.tolist() == shared.verdict[first].tolist() == table.reward(rows).tolist()


def test_the_alphabet_of_single_letters():
    full, single = compile_named("rm_water", ABCDEF), compile_named("rm_water", ABCDEF, "at_most_one")
    assert single.num_letters == 7
    for letter in [frozenset(), *({name} for name in ABCDEF)]:
        column, narrow = full.automaton().letter(letter), single.automaton().letter(letter)
        assert (full.next_row[:, column] == single.next_row[:, narrow]).all()
        assert (full.transition_reward[:, column] == single.transition_reward[:, narrow]).all()


def test_unused_propositions_and_their_order_do_not_matter():
    table = compile_named("rm_t1", ("z", "b", "y", "a"))
    assert table.letter_weights.tolist() == [0, 1, 0, 2]
    labels = jnp.array([[1, 1, 0, 0], [1, 0, 1, 1], [0, 1, 0, 0]], bool)
    row = table.initial_row[0]
    for label, name in zip(labels, ("t1.1", "t1.0", "done"), strict=True):
        row, reward = table.step(row, table.letter(label))
        assert table.text(int(row)) == name and reward == (name == "done")


def test_rows_have_names_but_no_formulas(water):
    table, _ = water
    assert table.tokens.shape == table.mask.shape == (79, 1) and not table.mask[2:].any()
    assert [table.text(row) for row in (0, 1, 2, 3)] == ["done", "fail", "t1.0", "t1.1"]
    for ask in (lambda: table.formula(2), lambda: table.vocabulary_size, lambda: table.automaton().formula(0)):
        with pytest.raises(LTLError, match=r"states of reward machines, which have no formula.* one-hot"):
            ask()
    with pytest.raises(LTLError, match=r"pay by transition.* step\(row, letter\)"):
        table.reward(jnp.int32(0))
    assert compile_tasks("F a", ABCDEF).text(2) == "F a"


def test_encoders_that_read_tokens_refuse_and_one_hot_codes_work(water):
    table, _ = water
    encoder = TransformerTaskEncoder(TransformerConfig(layers=1, heads=1, width=4, feed_forward=4, output=2))
    with pytest.raises(LTLError, match="use a one-hot task encoder"):
        encoder.init(jax.random.key(0), table)
    codes = OneHotTaskEncoder(OneHotConfig(77)).apply({}, table)  # the rows true and false have no state left
    assert (codes[:2] == 0).all() and (codes[2:] == jnp.eye(77)).all()


def test_listing():
    text = compile_named("rm_t10_published", ABCDEF, "at_most_one").describe()
    assert "row 2 [open]   <- task 0\n  state    t10_published.1\n" in text and "tokens" not in text
    assert "  -> 0     f / 1\n  -> 1     a | b | c | d | e / 1" in text
    both = compile_reward_machines(parse_machine("start -> s\notherwise -> stay\ns -> s : a & b / 0.5"), ("a", "b"))
    assert "  -> 2     !b | !a\n  -> 2     a & b / 0.5" in both.describe()


def test_limits():
    with pytest.raises(TooLargeError, match=r"needs 79 rows; the limit is max_rows=78: raise it"):
        compile_reward_machines(named_machines("rm_water"), ABCDEF, max_rows=78)
    with pytest.raises(LTLError, match="at least one task"):
        compile_reward_machines([], ABCDEF)


@pytest.mark.parametrize(("published", "reward"), [(False, 0.0), (True, 1.0)])
def test_task_env_pays_by_transition_and_ends_on_the_verdict(published, reward):
    text = "start -> 1\notherwise -> stay\n1 -> 2 : Up / 0.25\n2 -> fail : Up" + " / 1" * published
    probe = ProbeEnv()
    env = TaskEnv(probe, compile_reward_machines(parse_machine(text), probe.propositions, probe.alphabet))
    state = env.reset(jax.random.key(0))
    seen = []
    for action in (-1.0, 1.0, 0.0, 1.0):
        state = env.step(state, jnp.array([action]))
        seen.append((float(state.reward), float(state.done), env.table.text(int(env.row(state)))))
    assert seen == [(0, 0, "machine.1"), (0.25, 0, "machine.2"), (0, 0, "machine.2"), (reward, 1, "fail")]
