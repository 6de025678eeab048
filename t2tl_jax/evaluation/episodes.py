"""Complete episodes of a fixed policy: a fixed number of them, the first one of every environment."""

from typing import Any

import jax
import jax.numpy as jnp
from flax import struct

from t2tl_jax.task_env import TaskEnv, TaskParams
from t2tl_jax.training.compiler_options import compiler_options
from t2tl_jax.training.program import OVER_SEEDS
from t2tl_jax.training.types import Agent, AgentCarry, Params, repeated
from t2tl_jax.training.unroll import Episode, Player, Step, begin, player_of, unroll

CHUNK = 25
"""Steps between two looks at whether all episodes are over."""


@struct.dataclass
class Episodes:
    """Outcomes of E episodes of every evaluated policy, ``[..., E]``. No flag at all means: cut by the time limit."""

    success: jax.Array  # bool, the formula became true
    violation: jax.Array  # bool, the formula became false
    env_termination: jax.Array  # bool, ended by the environment itself while the task was open
    total_reward: jax.Array  # float32, undiscounted
    discounted_return: jax.Array  # float32, sum of discount^t r_t from t = 0
    paper_return: jax.Array  # float32, total_reward * discount^(length - 1), what the paper's code logs
    length: jax.Array  # int32, environment steps


def play(
    env: TaskEnv,
    agent: Agent,
    params: Params,
    env_params: TaskParams,
    key: jax.Array,
    episodes: int,
    episode_length: int,
    discount: float | jax.Array,
    deterministic: bool,
) -> Episodes:
    """Play ``episodes`` episodes side by side, each to its end or to ``episode_length`` steps; tasks take turns.

    Works on one seed and is pure: jit it, and vmap it over seeds. Every environment plays one episode only, since
    counting all that end within some time would favour short ones.
    """
    policy = player_of(agent, env, params, agent.embed(params, env_params.table), deterministic)
    carry = repeated(agent.begin(), episodes)
    return first_episodes(env, policy, carry, env_params, key, episodes, episode_length, discount)


def first_episodes(
    env: TaskEnv,
    policy: Player,
    carry: AgentCarry,
    env_params: TaskParams,
    key: jax.Array,
    episodes: int,
    episode_length: int,
    discount: float | jax.Array,
) -> Episodes:
    """As `play`, for any policy; `carry` is what it begins with in each of the environments."""
    reset_key, key = jax.random.split(key)
    first = begin(env, env_params, reset_key, episodes, episode_length)
    none, zero = jnp.zeros(episodes, bool), jnp.zeros(episodes)
    unknown = Episodes(none, none, none, zero, zero, zero, jnp.zeros(episodes, jnp.int32))

    def result(step: Step) -> Episodes:
        """What the step adds: the outcome of a first episode in its last step, else nothing."""
        ended = (step.terminated | step.truncated) & (step.turn == first.turn)
        verdict = env.verdict(step.state, env_params)
        return Episodes(
            success=ended & (verdict > 0),
            violation=ended & (verdict < 0),
            env_termination=ended & step.terminated & (verdict == 0),
            total_reward=jnp.where(ended, step.total, 0.0),
            discounted_return=jnp.where(ended, step.discounted, 0.0),
            paper_return=jnp.where(ended, step.total * discount ** (step.elapsed - 1.0), 0.0),
            length=jnp.where(ended, step.elapsed, 0),
        )

    def under_way(loop: tuple) -> jax.Array:
        _, _, known, _ = loop
        return (known.length == 0).any()

    def go_on(loop: tuple) -> tuple:
        under_way, carry, known, chunk = loop
        under_way, carry, results = unroll(
            env,
            env_params,
            policy,
            under_way,
            carry,
            jax.random.fold_in(key, chunk),
            min(CHUNK, episode_length),
            episode_length,
            discount,
            result,
        )
        known = jax.tree.map(lambda so_far, new: (so_far + new.sum(0)).astype(so_far.dtype), known, results)
        return under_way, carry, known, chunk + 1

    start: tuple[Episode, AgentCarry, Episodes, jax.Array] = (first, carry, unknown, jnp.int32(0))
    return jax.lax.while_loop(under_way, go_on, start)[2]


def distinct(env: TaskEnv, episodes: int, deterministic: bool) -> int:
    """How many of so many episodes can differ: a deterministic policy from a fixed start has one for each task."""
    return min(episodes, env.table.num_tasks) if deterministic and env.env.fixed_start else episodes


def player_of_seeds(
    env: TaskEnv, agent: Agent, episodes: int, episode_length: int, discount: float, deterministic: bool
) -> Any:
    """`play` for every seed as one jitted function, ``(params, env_params, keys) -> Episodes``, ``[seeds, episodes]``.

    The parameters have a leading axis [seeds], those of the environment are of ``params_of_seeds``, and the keys are
    ``key[seeds]``, of a stream kept for the purpose. Numbers that come in with those of the environment are taken
    instead of the learner's own.

    Args:
        env: the environment.
        agent: of which ``embed``, ``begin``, ``act`` and ``remember`` are used.
        episodes: number of episodes per seed.
        episode_length: time limit in steps.
        discount: gamma of the discounted return.
        deterministic: whether to take the mode of the policy instead of a sample.
    """

    def one_seed(params: Params, env_params: TaskParams, key: jax.Array) -> Episodes:
        player = agent if agent.given is None else agent.given(env_params)
        gamma = env_params.numbers.get("discount", discount)
        return play(env, player, params, env_params, key, episodes, episode_length, gamma, deterministic)

    return jax.jit(jax.vmap(one_seed, (0, OVER_SEEDS, 0)), compiler_options=compiler_options())
