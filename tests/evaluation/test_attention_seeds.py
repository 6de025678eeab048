"""The attention figure over seeds: agreement, what is entered first, the summary and its file."""

import csv
import json
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.evaluation.attention import Attention, Removal
from t2tl_jax.evaluation.attention_seeds import Reading, summarise, table, write_csv
from t2tl_jax.evaluation.first_entered import first_entered, shares
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.training.types import Agent
from tests.probe import DiscreteProbeEnv

TOKENS = ("a", "b", "c")


def read(seed, stage, attention, effect, row=2, first=0.5):
    weights = None if attention is None else Attention(TOKENS, np.array([attention], float))
    removal = Removal(np.array(effect, float), np.zeros(3), 10, True)
    return Reading(seed, stage, row, row == 2, "F a", TOKENS, weights, removal, {"Up": first, "none": 1 - first})


READINGS = [
    read(0, "start", [0.2, 0.5, 0.3], [0, 0, 0]),  # nothing moves the policy: unknown
    read(1, "start", [0.2, 0.5, 0.3], [0, 1, 2]),
    read(0, "end", [0.2, 0.5, 0.3], [0, 2, 1], first=0.25),
    read(0, "end", [0.5, 0.2, 0.3], [0, 2, 1], row=3),  # a sub-task, which does not agree
    read(1, "end", [0.6, 0.1, 0.3], [3, 2, 1], first=0.75),
    read(2, "end", None, [3, 2, 1]),  # no attention: removal alone
]


def test_agreement_is_token_star_being_the_needed_one():
    assert [one.agrees for one in READINGS] == [None, False, True, False, True, None]


def test_summary_counts_seeds_and_has_intervals():
    found = summarise(READINGS)
    assert list(found) == ["start", "end"]
    end = found["end"]
    assert end["seeds"] == [0, 1, 2]
    assert end["token_star"] == {"1: b": 1, "0: a": 1} and end["needed_token"] == {"0: a": 2, "1: b": 1}
    assert end["agreement"]["value"] == 1.0 and end["agreement"]["count"] == 2 and end["agreement"]["low"] < 0.5
    assert end["agreement_over_rows"]["value"] == pytest.approx((0.5 + 1.0) / 2)
    assert end["first"]["Up"]["value"] == pytest.approx(0.5)
    assert [one["value"] for one in end["attention_received"]] == pytest.approx([0.4, 0.3, 0.3])
    assert found["start"]["agreement"]["value"] == 0.0 and found["start"]["agreement"]["count"] == 1
    assert json.loads(json.dumps(found)) == found
    shown = table(READINGS)
    assert "token* is the needed one in 1.00 [" in shown and "0: a (2 seeds)" in shown


def test_file_has_a_line_for_every_reading(tmp_path):
    write_csv(tmp_path / "x.csv", READINGS)
    with (tmp_path / "x.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(READINGS)
    assert [row["agrees"] for row in rows] == ["", "0", "1", "0", "1", ""]
    assert rows[2]["token_star"] == "b" and rows[5]["token_star"] == "" and rows[2]["first_Up"] == "0.25"


class Later(DiscreteProbeEnv):
    """The cell is the action; nothing before the third step."""

    def reset(self, rng, params=None):
        return super().reset(rng).replace(pipeline_state=jnp.zeros(2))

    def step(self, state, action, params=None):
        time = state.pipeline_state[0] + 1
        sign = jnp.array([0.0, 1.0, -1.0])[action]
        return state.replace(pipeline_state=jnp.stack([time, jnp.where(time >= 3, sign, 0.0)]))

    def labels(self, state):
        return jnp.stack([state.pipeline_state[1] > 0.5, state.pipeline_state[1] < -0.5])


def choose(params, embedding, carry, obs, row, key, deterministic):
    """Always the action `params`; any one for -1."""
    return jnp.where(params < 0, jax.random.randint(key, row.shape, 0, 3), params)


PLAYER = Agent(
    init=lambda key, env_params: None,
    iterate=lambda state, env_params: (state, None),  # type: ignore[return-value, arg-type]
    embed=lambda params, table: jnp.zeros((table.num_rows, 1)),
    act=choose,
    frames_per_iteration=1,
)


@pytest.fixture(scope="module")
def run():
    env = Later()
    task_env = TaskEnv(env, compile_tasks(["F(Up & F Down)"], env.propositions, env.alphabet))
    params = task_env.make_params(0)
    play = jax.jit(partial(first_entered, task_env, PLAYER), static_argnums=(3, 4))

    def run(action, length=20):
        return np.asarray(play(jnp.int32(action), params, jax.random.key(0), 200, length))

    return run


@pytest.mark.slow
def test_what_the_next_episode_enters_does_not_count(run):
    """Nothing holds before the third step, and episodes are cut after two."""
    assert (run(2, length=2) == -1).all()


def test_first_is_what_first_holds(run):
    assert (run(2) == 1).all()
    assert (run(0) == -1).all()
    found = shares(run(-1), Later().propositions)
    assert found["Up"] == pytest.approx(0.5, abs=0.15) and found["none"] < 0.05
    assert sum(found.values()) == pytest.approx(1.0)
