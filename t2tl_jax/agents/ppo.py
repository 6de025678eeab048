"""Proximal policy optimisation with the constants and details of the published code (reference: Schulman et al., 2017).

Read `make_ppo` from top to bottom: collect a rollout, estimate advantages, update in epochs of minibatches. One
iteration is one pure function of the training state. The loss is in `ppo_learning.py`.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import optax
from flax import struct

from t2tl_jax.agents.acting import acting_of
from t2tl_jax.agents.next_values import at_steps, last_steps, segment_and_place, values_of_next
from t2tl_jax.agents.ppo_config import PPOConfig
from t2tl_jax.agents.ppo_learning import Batch, by_time, in_parts, in_segments, minibatch_order, misaligned, ppo_loss
from t2tl_jax.agents.row_codes import make_codes
from t2tl_jax.env import State
from t2tl_jax.ltl import TaskTable
from t2tl_jax.networks.actor_critic import ActorCritic
from t2tl_jax.networks.windows import Carry, Segment, Window
from t2tl_jax.registry import register_agent
from t2tl_jax.task_env import TaskEnv, TaskParams
from t2tl_jax.training import few_kernels
from t2tl_jax.training.advantages import generalised_advantages
from t2tl_jax.training.devices import on_each, over_envs
from t2tl_jax.training.optimizer import clipped_adam
from t2tl_jax.training.types import Agent, EpisodeTotals, Metrics, Params, TaskTotals, repeated
from t2tl_jax.training.unroll import Episode, Player, Step, begin, env_scalars, summed, task_totals, unroll


@struct.dataclass
class PPOState:
    """Everything that the next iteration depends on."""

    params: Params
    opt_state: optax.OptState
    episodes: Episode  # the N environments, leading axis [N]
    noise: jax.Array | None  # float32[N, A], the last exploration noise (unit variance); None for discrete actions
    carry: Carry  # the context window, or carried state, of every environment, leading axis [N]; () without context
    key: jax.Array
    iteration: jax.Array  # int32


@struct.dataclass
class Transitions:
    """A rollout of T steps in N environments; every array leads with [T, N], those of the carry excepted."""

    obs: jax.Array  # float32[T, N, O]
    row: jax.Array  # int32[T, N]
    action: jax.Array  # [T, N, A]
    log_prob: jax.Array  # float32[T, N], of the action under the policy that took it
    reward: jax.Array  # float32[T, N]
    terminated: jax.Array  # bool[T, N]
    truncated: jax.Array  # bool[T, N]
    next_obs: jax.Array  # float32[T, N, O], of s' before any reset
    next_row: jax.Array  # int32[T, N]
    carry: Carry  # the window, or state, that acted at the first step of every segment, leading axes [T / S, N]


# What acting takes from step to step: exploration noise, the carry, and of a window the same with embeddings; ()
# instead where the first is read as it is.
Known = tuple[jax.Array | None, Carry, Carry]


MADE_UP = 2**20
"""Tells the key of made-up actions from the numbers of the first noise, which are drawn with the same one."""


def noise_correlation(config: PPOConfig, progress: jax.Array) -> jax.Array:
    """Correlation of successive exploration noises, exp(-1 / time), where the time falls linearly with `progress`."""
    time = config.noise_time * jnp.maximum(0.0, 1.0 - progress / config.noise_decay)
    return jnp.where(time > 0, jnp.exp(-1.0 / jnp.maximum(time, 1e-3)), 0.0)


def make_ppo(env: TaskEnv, config: PPOConfig, episode_length: int, iterations: int) -> Agent:
    """The learner for one seed. `iterations` is the length of the run, which schedules refer to."""
    context, discrete = config.network.context, env.num_actions is not None
    config.network.state.check(env.objects, config.task_encoder)
    network = ActorCritic(config.network, env.num_actions or env.action_size, discrete, env.objects)
    apply: Callable[..., Any] = network.apply  # Flax declares more results than this call can have
    # Parameters stand still while acting, so what was seen is embedded once and not at every step that remembers it;
    # but tasks do not stand still, and states that read them are made anew. What is carried holds nothing to embed.
    as_it_is = context is None or context.carried or config.network.windows_by_task
    as_seen = context if context is None or as_it_is else replace(context, recompute=False)
    actor: Callable[..., Any] = ActorCritic(
        replace(config.network, context=as_seen), network.action_size, discrete, env.objects
    ).apply
    begin_carry = partial(network.begin, env.observation_size)
    remember = partial(apply, method="remember")
    segments = partial(in_segments, config)
    gradient_steps = iterations * config.epochs * config.num_minibatches
    optimizer = clipped_adam(
        config.learning_rate,
        config.max_gradient_norm,
        gradient_steps,
        anneal=config.anneal_learning_rate,
        epsilon=config.adam_epsilon,
        task_encoder_learning_rate=config.task_encoder_learning_rate,
        freeze_task_encoder=config.freezes_task_encoder,
        each=config.gradient_clipping == "each",
    )

    embed, codes = make_codes(
        config.task_encoder,
        config.freezes_task_encoder,
        partial(apply, method="embed"),
        partial(apply, method="embed_rows"),
    )

    def begin_all(env_params: TaskParams, key: jax.Array) -> Episode:
        return begin(env, env_params, key, config.num_envs, episode_length, config.staggered_start)

    def made_up(key: jax.Array) -> jax.Array:
        """A random action in every environment, which nobody takes: [N, A], or int32[N] where actions are discrete."""
        key = jax.random.fold_in(key, MADE_UP)
        if discrete:
            return jax.random.randint(key, (config.num_envs,), 0, network.action_size)
        return jax.random.uniform(key, (config.num_envs, network.action_size), minval=-1.0, maxval=1.0)

    def init(key: jax.Array, env_params: TaskParams) -> PPOState:
        params_key, episodes_key, noise_key, key = jax.random.split(key, 4)
        episodes = begin_all(env_params, episodes_key)
        carry = repeated(begin_carry(), config.num_envs)
        obs, row = episodes.state.obs, env.row(episodes.state)
        params = network.init(params_key, env_params.table, obs, row, carry, method="initialise")
        if context is not None and context.first_token == "made_up":
            carry = remember(params, carry, obs, made_up(noise_key), jnp.zeros(config.num_envs))
        return PPOState(
            params=params,
            opt_state=optimizer.init(params),
            episodes=episodes,
            noise=None if discrete else jax.random.normal(noise_key, (config.num_envs, env.action_size)),
            carry=carry,
            key=key,
            iteration=jnp.int32(0),
        )

    def restart(state: PPOState, env_params: TaskParams) -> PPOState:
        """Episodes under way are dropped: their rows mean nothing in the new table."""
        episodes_key, key = jax.random.split(state.key)
        return replace(
            state,
            episodes=begin_all(env_params, episodes_key),
            carry=network.next_episode(state.carry, jnp.ones(config.num_envs, bool)),
            key=key,
        )

    def collect(
        state: PPOState, env_params: TaskParams, embedding: jax.Array, key: jax.Array
    ) -> tuple[Known, Episode, Transitions, Metrics]:
        correlation = noise_correlation(config, state.iteration / iterations)

        def explore(known: Known, now: State, key: jax.Array) -> tuple[jax.Array, Known, jax.Array]:
            noise, carry, window = known
            read = carry if as_it_is else window
            distribution = actor(state.params, now.obs, embedding[env.row(now)], read, method="policy")
            # White noise on this bang-bang robot averages out within a metre; noise that persists carries it along.
            # Every action by itself still has the policy's distribution, whose density the loss uses.
            action, noise = distribution.sample(key, noise, correlation)
            return action, (noise, carry, window), distribution.log_prob(action)

        def observe(known: Known, now: State, action: jax.Array, reward: jax.Array, ended: jax.Array) -> Known:
            noise, carry, window = known
            step = now.obs, action, reward
            carry = network.next_episode(remember(state.params, carry, *step), ended)
            window = network.next_episode(actor(state.params, window, *step, method="remember"), ended)
            return noise, carry, window

        def keep(step: Step) -> tuple[Transitions, EpisodeTotals, TaskTotals | None, dict[str, jax.Array]]:
            transition = Transitions(
                obs=step.obs,
                row=step.row,
                action=step.action,
                log_prob=step.extras,
                reward=step.reward,
                terminated=step.terminated,
                truncated=step.truncated,
                next_obs=step.state.obs,
                next_row=env.row(step.state),
                carry=(),
            )
            return transition, step.totals, task_totals(step, env_params.table), step.state.metrics

        # The carry, which is large, is kept once a segment; without context there is none, and all is one stretch.
        stretch = config.unroll_length if context is None else config.segment_length

        def one_stretch(before: tuple[Episode, Known], key: jax.Array) -> tuple[tuple[Episode, Known], Any]:
            episodes, known = before
            episodes, after, kept = unroll(
                env,
                env_params,
                Player(explore, observe),
                episodes,
                known,
                key,
                stretch,
                episode_length,
                config.discount,
                keep,
            )
            _, carry, _ = known
            return (episodes, after), (carry, kept)

        start, noise, carry = over_envs((state.episodes, state.noise, state.carry))
        known = noise, carry, embedded(state.params, carry)
        keys = jax.random.split(key, config.unroll_length // stretch)
        (episodes, known), (carry, kept) = jax.lax.scan(one_stretch, (start, known), keys)
        transitions, totals, by_task, env_metrics = kept
        transitions = jax.tree.map(lambda x: x.reshape(config.unroll_length, *x.shape[2:]), transitions)
        by_task = jax.tree.map(lambda x: x.sum(axis=(0, 1)), by_task)
        metrics = Metrics(summed(totals), env_scalars(env_metrics), by_task)
        return known, episodes, replace(transitions, carry=carry), metrics

    def embedded(params: Params, carry: Carry) -> Carry:
        """The window with embeddings of what was seen in it; () where the carry is read as it is."""
        if as_it_is:
            return ()
        if not isinstance(carry, Window) or context is None or not context.recompute:
            return carry
        return replace(carry, seen=apply(params, carry.seen, method="see"))

    def segments_of(params: Params, transitions: Transitions) -> Segment | tuple[()]:
        """The segments of a rollout, [T / S x N], without their observations where these are embedded anew."""
        if context is None:
            return ()
        ended = transitions.terminated | transitions.truncated
        action, reward, ended = (segments(x) for x in (transitions.action, transitions.reward, ended))
        # The same numbers as when acting: from the same parameters.
        seen = None if context.recompute else apply(params, segments(transitions.obs), method="see")
        start = jax.tree.map(lambda x: x.reshape(x.shape[0] * x.shape[1], *x.shape[2:]), transitions.carry)
        return Segment(start=start, action=action, reward=reward, ended=ended, seen=seen)

    def make_batch(embedding: jax.Array, params: Params, transitions: Transitions) -> Batch:
        carry = segments_of(params, transitions)
        steps = jax.tree.map(segments, replace(transitions, carry=()))
        # V(s') is the next step's V(s), but for time-outs and the last step of the rollout.
        last = last_steps(transitions.truncated, episode_length)

        def values(part: tuple[Transitions, Segment | tuple[()]]) -> jax.Array:
            steps, carry = part
            return apply(params, steps.obs, embedding[steps.row], carry, method="value")

        def values_after(part: tuple[Transitions, Segment | tuple[()]]) -> jax.Array:
            steps, carry = part
            return apply(params, steps.obs, steps.next_obs, embedding[steps.next_row], carry, method="value_after")

        if context is None:  # by time and environment, as the environments are spread over devices
            value = values((replace(transitions, carry=()), ()))
            after = values_after((at_steps(replace(transitions, carry=()), last), ()))
        else:
            value = by_time(config, in_parts(config, values, (steps, carry)))
            which, place = segment_and_place(config, last)
            after = in_parts(config, values_after, jax.tree.map(lambda x: x[which], (steps, carry)))
            after = after[jnp.arange(place.size), place.reshape(-1)].reshape(place.shape)
        next_value = values_of_next(value, after, last)
        terminated, truncated = transitions.terminated, transitions.truncated
        if config.timeout_is_terminal:
            terminated, truncated = terminated | truncated, jnp.zeros_like(truncated)
        advantage = generalised_advantages(
            transitions.reward, value, next_value, terminated, truncated, config.discount, config.gae_lambda
        )
        return Batch(
            obs=steps.obs,
            row=steps.row,
            action=steps.action,
            log_prob=steps.log_prob,
            value=segments(value),
            advantage=segments(advantage),
            carry=carry if context is None or context.aligned else misaligned(config, carry),
        )

    def gradient_step(
        table: TaskTable, embedding: jax.Array, carry: tuple[Params, optax.OptState], minibatch: Batch
    ) -> tuple[tuple[Params, optax.OptState], dict[str, jax.Array]]:
        params, opt_state = carry

        def loss(params: Params) -> tuple[jax.Array, dict[str, jax.Array]]:
            with jax.named_scope("codes"):
                task = codes(params, table, embedding, minibatch.row)
            return ppo_loss(config, network, params, task, minibatch)

        with jax.named_scope("loss"):
            gradient, scalars = jax.grad(loss, has_aux=True)(params)
        with jax.named_scope("optimiser"):
            updates, opt_state = optimizer.update(gradient, opt_state, params)
            scalars["gradient_norm"] = few_kernels.global_norm(gradient)
            return (optax.apply_updates(params, updates), opt_state), scalars

    def epoch(
        table: TaskTable, embedding: jax.Array, carry: tuple[Params, optax.OptState], key: jax.Array, batch: Batch
    ):
        def minibatch_step(carry, chosen):
            return gradient_step(table, embedding, carry, over_envs(jax.tree.map(lambda x: x[chosen], batch)))

        return jax.lax.scan(minibatch_step, carry, minibatch_order(config, key))

    def iterate(state: PPOState, env_params: TaskParams) -> tuple[PPOState, Metrics]:
        table = env_params.table
        key, rollout_key, epochs_key = jax.random.split(state.key, 3)

        # COLLECT
        with jax.named_scope("codes"):  # once for acting and for the values: the parameters are the same
            embedding = embed(state.params, table)
        (noise, carry, _), episodes, transitions, metrics = collect(state, env_params, embedding, rollout_key)

        # ADVANTAGE
        with jax.named_scope("advantage"):
            batch = on_each(make_batch(embedding, state.params, transitions))  # minibatches choose among all samples

        # UPDATE
        with jax.named_scope("minibatches"):
            (params, opt_state), scalars = jax.lax.scan(
                lambda carry, key: epoch(table, embedding, carry, key, batch),
                (state.params, state.opt_state),
                jax.random.split(epochs_key, config.epochs),
            )

        new_state = PPOState(
            params=params,
            opt_state=opt_state,
            episodes=episodes,
            noise=noise,
            carry=carry,
            key=key,
            iteration=state.iteration + 1,
        )
        return new_state, replace(metrics, scalars=jax.tree.map(jnp.mean, scalars) | metrics.scalars)

    acting = acting_of(apply)
    return Agent(
        init=init,
        iterate=iterate,
        embed=embed,
        act=acting.act,
        frames_per_iteration=config.frames_per_iteration,
        begin=begin_carry,
        remember=remember,
        restart=restart,
        compare=acting.compare,
        value=acting.value,
        num_envs=config.num_envs,
    )


register_agent("ppo", PPOConfig, make_ppo)
