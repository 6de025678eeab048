"""Tasks for foreign trainers, which know observations and rewards but no rows of a table."""

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from t2tl_jax.env import Env, Purpose, State
from t2tl_jax.task_env import TaskEnv, TaskParams


class TaskInObservation(Env):
    """A task environment that shows the task: its observation is the environment's, then a code of the row.

    For trainers that take any brax environment, such as brax's own PPO. Their auto-reset restores `pipeline_state`,
    where the row lives, and the observation, so that an episode starts with its task and shows it.

    A trainer that knows no `params` gets those of ``make_params(0)``: seed 0's maps of training, in its own evaluation
    too. For an evaluation on other maps pass ``make_params(seed, "evaluation")`` to `reset` and `step`.

    Args:
        env: the environment with its tasks.
        features: float[rows, d], the code of every row of its table; by default a one-hot code.

    Raises:
        ValueError: when `features` are not as many as the table has rows.
    """

    def __init__(self, env: TaskEnv, features: ArrayLike | None = None) -> None:
        rows = env.table.num_rows
        codes = jnp.eye(rows) if features is None else jnp.asarray(features, jnp.float32)
        if codes.ndim != 2 or len(codes) != rows:
            raise ValueError(f"features are float[rows, d] for the {rows} rows of the table, got shape {codes.shape}")
        self.env = env
        self._codes = codes

    def make_params(self, seed: int, purpose: Purpose = "training") -> TaskParams:
        """Those of the task environment."""
        return self.env.make_params(seed, purpose)

    def reset(self, rng: jax.Array, params: TaskParams | None = None) -> State:
        """The start of an episode of one of the tasks, drawn uniformly."""
        return self._shown(self.env.reset(rng, params))

    def step(self, state: State, action: jax.Array, params: TaskParams | None = None) -> State:
        """The state one step later, with the code of the row that is left."""
        hidden = state.replace(obs=state.obs[: self.env.observation_size])
        return self._shown(self.env.step(hidden, action, params))

    def _shown(self, state: State) -> State:
        return state.replace(obs=jnp.concatenate([state.obs, self._codes[self.env.row(state)]]))

    @property
    def observation_size(self) -> int:
        """That of the environment and the length of a code."""
        return self.env.observation_size + self._codes.shape[1]

    @property
    def action_size(self) -> int:
        """Size of a continuous action."""
        return self.env.action_size

    @property
    def backend(self) -> str:
        """Name of the physics."""
        return self.env.backend
