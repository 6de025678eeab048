"""Proximal policy optimisation with the constants and details of the published code (reference: Schulman et al., 2017).

Read `make_ppo` from top to bottom: collect a rollout, estimate advantages, update in epochs of minibatches. One
iteration is one pure function of the training state.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import optax
from flax import struct

from t2tl_jax import checks
from t2tl_jax.agent import Agent, EpisodeTotals, Metrics, Params, repeated
from t2tl_jax.ltl import TaskTable
from t2tl_jax.networks.actor_critic import ActorCritic, NetworkConfig
from t2tl_jax.networks.context import Memory, Segment, Window
from t2tl_jax.task_env import TaskEnv
from t2tl_jax.training.best import keep_best
from t2tl_jax.training.episodes import Episode, Outcome, begin
from t2tl_jax.training.optimizer import clipped_adam
from t2tl_jax.training.rollout import Transitions, generalised_advantages, rollout


@dataclass(frozen=True)
class PPOConfig:
    """PPO's constants. The defaults were tuned on `phi_zone`; the published ones make up `zone_ppo_published`."""

    num_envs: int = 2048
    """Parallel environments."""
    rollout_steps: int = 64
    """Steps of every environment in one iteration."""
    epochs: int = 4
    """Passes over the rollout in one iteration."""
    minibatch_size: int = 8192
    """Samples of one gradient step; must divide num_envs x rollout_steps."""
    discount: float = 0.998
    """Discount factor gamma."""
    gae_lambda: float = 0.97
    """Lambda of generalised advantage estimation."""
    learning_rate: float = 3e-4
    """Step size of Adam."""
    anneal_learning_rate: bool = False
    """Decay the learning rate linearly to zero over the run."""
    adam_epsilon: float = 1e-8
    """Epsilon of Adam."""
    clip: float = 0.2
    """Clipping range of the probability ratio and of the value."""
    clip_value: bool = True
    """Clip the value loss around the old value (the larger of the two squared errors counts)."""
    value_coefficient: float = 0.5
    """Weight of the value loss."""
    entropy_coefficient: float = 0.0
    """Weight of the entropy, which is averaged over action dimensions as published."""
    noise_time: float = 33.0
    """Correlation time of the exploration noise at the start of the run, in steps; 0 is white noise as published.
    Continuous actions only: discrete ones are drawn independently."""
    noise_decay: float = 0.5
    """Share of the run over which the correlation time falls linearly to 0."""
    max_gradient_norm: float = 0.5
    """Global norm at which gradients are clipped."""
    normalise_advantage: bool = False
    """Standardise advantages within a minibatch."""
    timeout_is_terminal: bool = False
    """Treat the time limit as an end of the task (published code) instead of bootstrapping from the last state."""
    staggered_start: bool = True
    """Cut the very first episode of each environment at a random length, so that resets do not come in step."""

    def __post_init__(self) -> None:
        checks.counts(self, "num_envs", "rollout_steps", "epochs", "minibatch_size", "batch_size")
        checks.shares(self, "discount", "gae_lambda")
        checks.positive(self, "adam_epsilon", "clip", "noise_decay", "max_gradient_norm")
        checks.not_negative(self, "learning_rate", "value_coefficient", "entropy_coefficient", "noise_time")
        if self.batch_size % self.minibatch_size:
            raise ValueError(
                f"minibatch_size must divide num_envs x rollout_steps = {self.num_envs} x {self.rollout_steps} = "
                f"{self.batch_size}, got minibatch_size={self.minibatch_size}"
            )

    @property
    def frames_per_iteration(self) -> int:
        """Environment steps in one iteration."""
        return self.num_envs * self.rollout_steps

    @property
    def batch_size(self) -> int:
        """Samples of one epoch, which are all steps of the iteration."""
        return self.frames_per_iteration

    @property
    def num_minibatches(self) -> int:
        """Gradient steps in one epoch."""
        return self.batch_size // self.minibatch_size


@struct.dataclass
class PPOState:
    """Everything that the next iteration depends on."""

    params: Params
    opt_state: optax.OptState
    episodes: Episode  # the N environments, leading axis [N]
    noise: jax.Array | None  # float32[N, A], the last exploration noise (unit variance); None for discrete actions
    memory: Memory  # the context window of every environment, leading axis [N]; () without context
    key: jax.Array
    iteration: jax.Array  # int32
    best_params: Params
    best_score: jax.Array  # float32, discounted return of the best rollout so far
    table: TaskTable | None = None  # the current tasks, where they change during training; else they are a constant


@struct.dataclass
class Batch:
    """Samples of a rollout in segments of S successive steps, [B / S, S]; S is 1 without context."""

    obs: jax.Array
    row: jax.Array
    action: jax.Array
    log_prob: jax.Array
    value: jax.Array
    advantage: jax.Array
    memory: Segment | tuple[()] = ()  # the windows that acted


# What acting carries from step to step: exploration noise, the context window, and the same window as it is read.
Known = tuple[jax.Array | None, Memory, Memory]


def noise_correlation(config: PPOConfig, progress: jax.Array) -> jax.Array:
    """Correlation of successive exploration noises, exp(-1 / time), where the time falls linearly with `progress`."""
    time = config.noise_time * jnp.maximum(0.0, 1.0 - progress / config.noise_decay)
    return jnp.where(time > 0, jnp.exp(-1.0 / jnp.maximum(time, 1e-3)), 0.0)


def check_segments(config: PPOConfig, segment: int) -> None:
    """Refuse segments of a context that do not fill the rollout or the minibatches."""
    for name, size in (("rollout_steps", config.rollout_steps), ("minibatch_size", config.minibatch_size)):
        if size % segment:
            raise ValueError(
                f"context.segment_length must divide ppo.{name}, got segment_length={segment} and {name}={size}; "
                "1 fits always"
            )


def ppo_loss(
    config: PPOConfig, network: ActorCritic, params: Params, task: jax.Array, batch: Batch
) -> tuple[jax.Array, dict[str, jax.Array]]:
    """Clipped surrogate, clipped value loss and entropy; `task` is the encoded formula of every sample, [..., dim]."""
    apply: Callable[..., Any] = network.apply  # Flax declares more results than this call can have
    distribution, value = apply(params, batch.obs, task, batch.memory)
    ratio = jnp.exp(distribution.log_prob(batch.action) - batch.log_prob)
    advantage = batch.advantage
    if config.normalise_advantage:
        advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
    clipped_ratio = jnp.clip(ratio, 1 - config.clip, 1 + config.clip)
    policy_loss = -jnp.minimum(ratio * advantage, clipped_ratio * advantage).mean()

    target = batch.value + batch.advantage
    value_error = jnp.square(value - target)
    if config.clip_value:
        clipped_value = batch.value + jnp.clip(value - batch.value, -config.clip, config.clip)
        value_error = jnp.maximum(value_error, jnp.square(clipped_value - target))
    value_loss = value_error.mean()

    entropy = distribution.entropy().mean()  # over samples and action dimensions
    loss = policy_loss - config.entropy_coefficient * entropy + config.value_coefficient * value_loss
    return loss, {
        "policy_loss": policy_loss,
        "value_loss": value_loss,
        "entropy": entropy,
        "value": value.mean(),
        "clip_fraction": (jnp.abs(ratio - 1) > config.clip).mean(),
        "kl": (ratio - 1 - jnp.log(ratio)).mean(),
    }


def make_ppo(
    env: TaskEnv,
    network_config: NetworkConfig,
    config: PPOConfig,
    episode_length: int,
    iterations: int,
    renewable: bool = False,
) -> Agent:
    """The learner for one seed.

    `iterations` is the length of the run, which schedules refer to. With `renewable`, the table that is trained on is
    part of the state: that of `env` until `renew` puts another one in its place. `embed` always encodes that of `env`.
    """
    context, discrete = network_config.context, env.num_actions is not None
    segment, aligned = (1, True) if context is None else (context.segment_length, context.aligned)
    check_segments(config, segment)
    network = ActorCritic(network_config, env.num_actions or env.action_size, discrete)
    # Parameters stand still while acting, so what was seen is embedded once and not at every step that remembers it.
    as_seen = None if context is None else replace(context, recompute=False)
    actor: Callable[..., Any] = ActorCritic(
        replace(network_config, context=as_seen), network.action_size, discrete
    ).apply
    apply: Callable[..., Any] = network.apply  # as in ppo_loss
    begin_memory = partial(network.begin, env.observation_size)
    remember = partial(apply, method="remember")
    gradient_steps = iterations * config.epochs * config.num_minibatches
    optimizer = clipped_adam(
        config.learning_rate,
        config.max_gradient_norm,
        gradient_steps,
        anneal=config.anneal_learning_rate,
        epsilon=config.adam_epsilon,
    )

    def world_of(state: PPOState) -> TaskEnv:
        """The environment with the tasks that are trained on."""
        return env if state.table is None else env.with_table(state.table)

    def embed(params: Params, table: TaskTable = env.table) -> jax.Array:
        return apply(params, table, method="embed")

    def act(
        params: Params,
        embedding: jax.Array,
        memory: Memory,
        obs: jax.Array,
        row: jax.Array,
        key: jax.Array,
        deterministic: bool,
    ) -> jax.Array:
        distribution = apply(params, obs, embedding[row], memory, method="policy")
        return distribution.mode() if deterministic else distribution.sample(key)[0]

    def compare(
        params: Params, memory: Memory, obs: jax.Array, task: jax.Array, other: jax.Array
    ) -> tuple[jax.Array, jax.Array]:
        (policy, value), (other_policy, other_value) = (
            apply(params, obs, jnp.broadcast_to(code, (len(obs), *code.shape)), memory) for code in (task, other)
        )
        return policy.kl(other_policy), other_value - value

    def begin_all(world: TaskEnv, key: jax.Array, limit_key: jax.Array) -> Episode:
        keys = jax.random.split(key, config.num_envs)
        limits = jnp.full(config.num_envs, episode_length)
        if config.staggered_start:
            limits = jax.random.randint(limit_key, (config.num_envs,), 1, episode_length + 1)
        return jax.vmap(partial(begin, world))(keys, limits, jnp.arange(config.num_envs))

    def init(key: jax.Array) -> PPOState:
        params_key, episodes_key, limit_key, noise_key, key = jax.random.split(key, 5)
        episodes = begin_all(env, episodes_key, limit_key)
        memory = repeated(begin_memory(), config.num_envs)
        params = network.init(
            params_key, env.table, episodes.state.obs, episodes.state.pipeline_state.row, memory, method="initialise"
        )
        return PPOState(
            params=params,
            opt_state=optimizer.init(params),
            episodes=episodes,
            noise=None if discrete else jax.random.normal(noise_key, (config.num_envs, env.action_size)),
            memory=memory,
            key=key,
            iteration=jnp.int32(0),
            best_params=params,
            best_score=jnp.float32(-jnp.inf),
            table=env.table if renewable else None,
        )

    def renew(state: PPOState, table: TaskTable) -> PPOState:
        """Episodes under way are dropped: their rows mean nothing in the new table. So do scores on other tasks."""
        episodes_key, limit_key, key = jax.random.split(state.key, 3)
        episodes = begin_all(env.with_table(table), episodes_key, limit_key)
        memory = network.next_episode(state.memory, jnp.ones(config.num_envs, bool))
        return replace(state, episodes=episodes, memory=memory, key=key, best_score=jnp.float32(-jnp.inf), table=table)

    def collect(world: TaskEnv, state: PPOState, key: jax.Array) -> tuple[Known, Episode, Transitions, EpisodeTotals]:
        embedding = embed(state.params, world.table)
        correlation = noise_correlation(config, state.iteration / iterations)

        def policy(known: Known, obs: jax.Array, row: jax.Array, key: jax.Array):
            noise, memory, window = known
            distribution = actor(state.params, obs, embedding[row], window, method="policy")
            # White noise on this bang-bang robot averages out within a metre; noise that persists carries it along.
            # Every action by itself still has the policy's distribution, whose density the loss uses.
            action, noise = distribution.sample(key, noise, correlation)
            return (noise, memory, window), action, distribution.log_prob(action)

        def go_on(known: Known, obs: jax.Array, action: jax.Array, outcome: Outcome) -> Known:
            noise, memory, window = known
            ended, step = outcome.terminated | outcome.truncated, (obs, action, outcome.reward)
            memory = network.next_episode(remember(state.params, memory, *step), ended)
            window = network.next_episode(actor(state.params, window, *step, method="remember"), ended)
            return noise, memory, window

        return rollout(
            world,
            policy,
            (state.noise, state.memory, embedded(state.params, state.memory)),
            state.episodes,
            key,
            config.rollout_steps,
            episode_length,
            config.discount,
            go_on,
            segment,
        )

    def embedded(params: Params, memory: Memory) -> Memory:
        """The window with embeddings of what was seen in it."""
        if not isinstance(memory, Window) or context is None or not context.recompute:
            return memory
        return replace(memory, seen=apply(params, memory.seen, method="see"))

    def in_segments(x: jax.Array) -> jax.Array:
        """[T, N, ...] -> [T / S x N, S, ...]."""
        segments = config.rollout_steps // segment  # sizes are written out: an observation may have none
        x = x.reshape(segments, segment, *x.shape[1:])
        return jnp.moveaxis(x, 1, 2).reshape(segments * config.num_envs, segment, *x.shape[3:])

    def by_time(x: jax.Array) -> jax.Array:
        """[T / S x N, S] or these in several parts -> [T, N]."""
        x = x.reshape(-1, config.num_envs, segment)
        return jnp.moveaxis(x, 2, 1).reshape(config.rollout_steps, config.num_envs)

    def segments_of(params: Params, transitions: Transitions) -> Segment | tuple[()]:
        """The segments of a rollout, [T / S x N], without their observations where these are embedded anew."""
        if context is None:
            return ()
        _, memory, _ = transitions.memory
        ended = transitions.terminated | transitions.truncated
        action, reward, ended = (in_segments(x) for x in (transitions.action, transitions.reward, ended))
        # The same numbers as when acting: from the same parameters.
        seen = None if context.recompute else apply(params, in_segments(transitions.obs), method="see")
        start = jax.tree.map(lambda x: x.reshape(x.shape[0] * x.shape[1], *x.shape[2:]), memory)
        return Segment(start=start, action=action, reward=reward, ended=ended, seen=seen)

    def make_batch(table: TaskTable, params: Params, transitions: Transitions) -> Batch:
        embedding = embed(params, table)

        names = ("obs", "row", "next_obs", "next_row", "action", "log_prob")
        steps = {name: in_segments(getattr(transitions, name)) for name in names}
        memory = segments_of(params, transitions)

        def evaluate(part: tuple[dict[str, jax.Array], Segment | tuple[()]]) -> tuple[jax.Array, jax.Array]:
            steps, memory = part
            value = apply(params, steps["obs"], embedding[steps["row"]], memory, method="value")
            next_task = embedding[steps["next_row"]]
            return value, apply(params, steps["obs"], steps["next_obs"], next_task, memory, method="value_after")

        if context is None:
            values = evaluate((steps, memory))
        else:  # a token of a window takes much more memory than a value, so no more samples at once than in the update
            parts = jax.tree.map(
                lambda x: x.reshape(config.num_minibatches, len(x) // config.num_minibatches, *x.shape[1:]),
                (steps, memory),
            )
            values = jax.lax.map(evaluate, parts)
        value, next_value = (by_time(x) for x in values)
        terminated, truncated = transitions.terminated, transitions.truncated
        if config.timeout_is_terminal:
            terminated, truncated = terminated | truncated, jnp.zeros_like(truncated)
        advantage = generalised_advantages(
            transitions.reward, value, next_value, terminated, truncated, config.discount, config.gae_lambda
        )
        return Batch(
            obs=steps["obs"],
            row=steps["row"],
            action=steps["action"],
            log_prob=steps["log_prob"],
            value=in_segments(value),
            advantage=in_segments(advantage),
            memory=misaligned(memory) if isinstance(memory, Segment) and not aligned else memory,
        )

    def misaligned(memory: Segment) -> Segment:
        """Windows as published: flattened by time and then environment, beside samples in the opposite order."""

        def other_order(x: jax.Array) -> jax.Array:
            return x.reshape(config.num_envs, config.rollout_steps, *x.shape[1:]).swapaxes(0, 1).reshape(x.shape)

        return replace(memory, start=jax.tree.map(other_order, memory.start))

    def gradient_step(table: TaskTable, carry: tuple[Params, optax.OptState], minibatch: Batch):
        params, opt_state = carry

        def loss(params: Params) -> tuple[jax.Array, dict[str, jax.Array]]:
            # Each distinct formula is encoded once; the gather's gradient sums over the samples of a row.
            return ppo_loss(config, network, params, embed(params, table)[minibatch.row], minibatch)

        gradient, scalars = jax.grad(loss, has_aux=True)(params)
        updates, opt_state = optimizer.update(gradient, opt_state, params)
        scalars["gradient_norm"] = optax.tree.norm(gradient)
        return (optax.apply_updates(params, updates), opt_state), scalars

    def epoch(table: TaskTable, carry: tuple[Params, optax.OptState], key: jax.Array, batch: Batch):
        order = jax.random.permutation(key, config.batch_size // segment).reshape(config.num_minibatches, -1)

        def minibatch_step(carry, segments):
            return gradient_step(table, carry, jax.tree.map(lambda x: x[segments], batch))

        return jax.lax.scan(minibatch_step, carry, order)

    def iterate(state: PPOState) -> tuple[PPOState, Metrics]:
        key, rollout_key, epochs_key = jax.random.split(state.key, 3)
        world = world_of(state)

        # COLLECT
        (noise, memory, _), episodes, transitions, totals = collect(world, state, rollout_key)

        # ADVANTAGE
        batch = make_batch(world.table, state.params, transitions)

        # UPDATE
        (params, opt_state), scalars = jax.lax.scan(
            lambda carry, key: epoch(world.table, carry, key, batch),
            (state.params, state.opt_state),
            jax.random.split(epochs_key, config.epochs),
        )

        # The rollout scores the parameters that made it, not the ones it led to.
        best_params, best_score = keep_best(state.params, totals, state.best_params, state.best_score)
        new_state = PPOState(
            params=params,
            opt_state=opt_state,
            episodes=episodes,
            noise=noise,
            memory=memory,
            key=key,
            iteration=state.iteration + 1,
            best_params=best_params,
            best_score=best_score,
            table=state.table,
        )
        return new_state, Metrics(episodes=totals, scalars=jax.tree.map(jnp.mean, scalars))

    return Agent(
        init=init,
        iterate=iterate,
        embed=embed,
        act=act,
        frames_per_iteration=config.frames_per_iteration,
        renew=renew if renewable else None,
        begin=begin_memory,
        remember=remember,
        compare=compare,
    )
