"""The TL-MDP against the definition: its rewards are equation 1's, and its optimum is that of all policies with memory.

Equation 1 pays a history once: +1 when its labels settle that the formula holds, -1 when they settle that it cannot,
0 before. Here the definition itself is asked, without progression and without a table: a finite word settles the
formula if it holds (or fails) with whatever infinite word behind it.
"""

from functools import cache, partial
from itertools import product

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.env import LabelledEnv, State
from t2tl_jax.ltl import compile_tasks, parse
from t2tl_jax.task_env import TaskEnv
from tests.ltl.ltl_oracles import holds

PROPOSITIONS = ("a", "b", "c")
LABELS = [{"a"}, {"b"}, {"c"}, {"a", "b"}, set()]
"""Of the five cells of a corridor."""

FORMULAS = [
    "F(a & F b)",
    "!c U (a & (!c U b))",  # can be violated
    "!b U (a & (!c U b))",  # the guards differ: a second chance
    "X X a | F(b & c)",  # settled by when, not only by what
    "!c U X(a & b)",
]
# Enough for these formulas, of which any open one can be satisfied within two steps, and missed by nothing for ever.
ENDINGS = list(product([frozenset(text) for text in ("", "a", "b", "ab", "bc")], repeat=2))
HORIZON, DISCOUNT, SLIP = 6, 0.9, 0.25


def transitions():
    """float[cells, actions, cells]: left or right, the other way with probability SLIP; walls at both ends."""
    cells = len(LABELS)
    model = np.zeros((cells, 2, cells))
    for cell, action in product(range(cells), range(2)):
        for move, probability in ((action, 1 - SLIP), (1 - action, SLIP)):
            model[cell, action, np.clip(cell + 2 * move - 1, 0, cells - 1)] += probability
    return model


class Corridor(LabelledEnv):
    """The same cells; the action is where to go next, so that a rollout can take any path."""

    propositions, alphabet, num_actions = PROPOSITIONS, "every_subset", len(LABELS)
    action_size, observation_size, backend = 1, 1, "none"

    def reset(self, rng, params=None):
        return State(jax.random.randint(rng, (), 0, len(LABELS)), jnp.zeros(1), jnp.float32(0), jnp.float32(0))

    def step(self, state, action, params=None):
        return state.replace(pipeline_state=action, reward=jnp.float32(0), done=jnp.float32(0))

    def labels(self, state):
        return jnp.array([[name in label for name in PROPOSITIONS] for label in LABELS])[state.pipeline_state]


@cache
def equation_1(formula, word):
    """+1, -1 or 0 for a word of letters. What follows is one of ENDINGS, then nothing for ever."""
    task, outcomes = parse(formula), set()
    for ending in ENDINGS:
        outcomes.add(holds(task, [*word, *ending], [frozenset()]))
        if len(outcomes) == 2:
            return 0
    return 1 if outcomes.pop() else -1


def word_of(path, labels):
    """What is read of the states s_0 to s_t: not the first, or with labels="state" not the last."""
    return tuple(frozenset(LABELS[cell]) for cell in (path[1:] if labels == "next" else path[:-1]))


def best_with_memory(formula, model, labels, path):
    """Value of a history under the best policy that may remember all of it, by brute force."""
    if len(path) > HORIZON:
        return 0.0
    values = []
    for action in range(model.shape[1]):
        value = 0.0
        for cell in np.flatnonzero(model[path[-1], action]):
            longer = (*path, int(cell))
            reward = equation_1(formula, word_of(longer, labels))
            rest = 0.0 if reward else DISCOUNT * best_with_memory(formula, model, labels, longer)
            value += model[path[-1], action, cell] * (reward + rest)
        values.append(value)
    return max(values)


def optimum_of_product(table, model, labels):
    """Values float[cells, rows] of the TL-MDP at its start, by value iteration over HORIZON steps."""
    next_row, verdict = np.asarray(table.next_row), np.asarray(table.verdict)
    letter = [int(table.letter(np.array([name in label for name in PROPOSITIONS]))) for label in LABELS]
    cells, rows = len(LABELS), table.num_rows
    value = np.zeros((cells, rows))
    for _ in range(HORIZON):
        q = np.zeros((cells, model.shape[1], rows))
        for cell, after in product(range(cells), range(cells)):
            row = next_row[:, letter[after if labels == "next" else cell]]
            gain = verdict[row] + DISCOUNT * np.where(verdict[row] == 0, value[after, row], 0.0)
            q[cell] += model[cell, :, after][:, None] * gain
        value = q.max(axis=1)
    return value


@pytest.mark.parametrize("labels", ["next", "state"])
@pytest.mark.parametrize("formula", FORMULAS)
def test_the_optimum_is_that_of_the_best_policy_with_memory(formula, labels):
    model, table = transitions(), compile_tasks(formula, PROPOSITIONS)
    values = optimum_of_product(table, model, labels)[:, int(table.initial_row[0])]
    brute = [best_with_memory(formula, model, labels, (cell,)) for cell in range(len(LABELS))]
    np.testing.assert_allclose(values, brute, atol=1e-12)


@pytest.mark.parametrize("labels", ["next", "state"])
def test_rewards_of_rollouts_are_those_of_equation_1(labels):
    """Random paths through all formulas at once; after a verdict nothing counts."""
    env = Corridor()
    task_env = TaskEnv(env, compile_tasks(FORMULAS, PROPOSITIONS), labels=labels)
    params = task_env.make_params(0)

    @partial(jax.jit, static_argnums=1)
    def rollout(key, count):
        reset_key, action_key = jax.random.split(key)
        first = jax.vmap(partial(task_env.reset, params=params))(
            jax.random.split(reset_key, count), turn=jnp.arange(count)
        )
        actions = jax.random.randint(action_key, (HORIZON, count), 0, len(LABELS))

        def step(state, action):
            after = jax.vmap(partial(task_env.step, params=params))(state, action)
            return after, (after.reward, after.done)

        return first.pipeline_state.env, actions, jax.lax.scan(step, first, actions)[1]

    start, actions, (rewards, dones) = jax.device_get(rollout(jax.random.key(0), 100))
    seen = set()
    for k, formula in zip(range(100), FORMULAS * 20, strict=True):
        path = (int(start[k]), *actions[:, k].tolist())
        for t in range(HORIZON):
            expected = equation_1(formula, word_of(path[: t + 2], labels))
            assert (rewards[t, k], dones[t, k]) == (expected, abs(expected)), (formula, path[: t + 2])
            seen.add(expected)
            if expected:
                break
    assert seen == {-1, 0, 1}


def test_the_initial_label_counts_as_printed():
    """In a cell with `a`: as printed the first step has done F a, whatever it does; by default it has to come back."""
    env = Corridor()
    table = compile_tasks("F a", PROPOSITIONS)
    found = {}
    for labels in ("next", "state"):
        task_env = TaskEnv(env, table, labels=labels)
        state = task_env.reset_to_row(jax.random.key(0), table.initial_row[0])
        state = state.replace(pipeline_state=state.pipeline_state.replace(env=jnp.int32(0)))
        away = task_env.step(state, jnp.int32(4))
        back = task_env.step(away, jnp.int32(0))
        found[labels] = (float(away.reward), float(back.reward))
    assert found["state"][0] == 1.0
    assert found["next"] == (0.0, 1.0)
    with pytest.raises(ValueError, match="labels must be one of next, state, got 'last'"):
        TaskEnv(env, table, labels="last")
