"""Evaluation and animation carry what a policy remembers from step to step of its episode."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from t2tl_jax.evaluation.animation import record
from t2tl_jax.evaluation.episodes import play
from t2tl_jax.ltl import compile_tasks
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.training.types import Agent
from t2tl_jax.view import Scene, View
from tests.probe import ProbeEnv


class CountingEnv(ProbeEnv):
    """The agent sees nothing, and succeeds if its actions are 0, 1, 2. The state is how far it came, -1 if it erred."""

    def step(self, state, action, params=None):
        count = jnp.where(action[0] == state.pipeline_state, state.pipeline_state + 1, -1.0)
        return state.replace(pipeline_state=count)

    def labels(self, state):
        return jnp.stack([state.pipeline_state == 3, state.pipeline_state < 0])


COUNTING = Agent(  # its action is how many steps it remembers
    init=lambda key, env_params: None,
    iterate=lambda state, env_params: (state, None),
    embed=lambda params, table: jnp.zeros((table.num_rows, 1)),
    act=lambda params, embedding, carry, obs, row, key, deterministic: carry[:, None],
    frames_per_iteration=1,
    begin=lambda: jnp.float32(0),
    remember=lambda params, carry, obs, action, reward: carry + obs[..., 0],
)


@pytest.fixture
def env() -> TaskEnv:
    counting = CountingEnv()
    return TaskEnv(counting, compile_tasks(["!Down U Up"], counting.propositions, counting.alphabet))


@pytest.mark.slow
def test_every_evaluated_episode_has_a_carry_of_its_own(env):
    episodes = play(env, COUNTING, {}, env.make_params(0), jax.random.key(0), 4, 10, 0.5, True)
    assert episodes.success.all() and (episodes.length == 3).all()
    np.testing.assert_allclose(episodes.discounted_return, 0.25)


def test_the_animated_episode_has_a_carry(env):
    def scene(count, params):
        return Scene(discs=jnp.zeros((0, 2)), radii=jnp.zeros(0), agent=jnp.full(2, count), heading=jnp.zeros(2))

    view = View(scene, (0.0, 0.0), (4.0, 2.0), (), 0.25, (255, 255, 255), 0.5)
    recording = record(env, view, COUNTING, {}, env.make_params(0), jax.random.key(0), 10, True)
    assert recording.verdict == 1 and not recording.truncated
    np.testing.assert_array_equal(recording.scenes.agent[:, 0], [0, 1, 2, 3])
    assert recording.rows.tolist() == [*[int(env.table.initial_row[0])] * 3, 0]
