"""Double DQN that can learn every sub-task from every step, or of large tables some of them, drawn anew each time.

A stored transition is (s, a, s', letter). The letter says where each formula of the table goes, so one transition is a
transition of every row (equation 3 of the paper; with one-hot rows it is CRM of the reward-machine paper). What the
environment pays by itself is paid to every row, and an end that it makes is the end of all. Targets and loss are in
`td_learning.py`. Read `make_dqn` from top to bottom: act, store, sample, update.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import optax
from flax import struct

from t2tl_jax.agents import counting
from t2tl_jax.agents.dqn_config import DQNConfig
from t2tl_jax.agents.learning_rows import drawn_rows, marks
from t2tl_jax.agents.replay import make_replay
from t2tl_jax.agents.row_codes import LARGE, make_codes
from t2tl_jax.agents.shaping import potential
from t2tl_jax.agents.td_learning import Embedding, Marked, Transition, code_change, dqn_loss
from t2tl_jax.env import State
from t2tl_jax.ltl import TaskTable
from t2tl_jax.networks.q_network import QNetwork
from t2tl_jax.networks.windows import Carry
from t2tl_jax.registry import register_agent
from t2tl_jax.task_env import Shared, TaskEnv, TaskParams
from t2tl_jax.training.devices import on_each, over_envs
from t2tl_jax.training.optimizer import clipped_adam
from t2tl_jax.training.transfer import PART, with_encoder
from t2tl_jax.training.types import Agent, Metrics, Params, repeated
from t2tl_jax.training.unroll import Episode, Player, Step, advance, begin, by_task, env_scalars, summed, task_totals

ROWS = 1
"""What the key of a batch is folded with for the rows that learn from it."""

MAX_TASKS_APART = 16
"""Up to so many tasks of a table have columns of their own among the metrics."""


@struct.dataclass
class DQNState:
    """Everything that the next iteration depends on."""

    params: Params
    target_params: Params
    target_embedding: Any  # float32[rows, dim], the rows encoded by the target network; () if they never are as a whole
    opt_state: optax.OptState
    episodes: Episode  # the N environments, leading axis [N]
    carry: Carry  # the context window of every environment, leading axis [N]; () without context
    buffer: Any  # flashbax's state, see `replay.py`
    key: jax.Array
    iteration: jax.Array  # int32


def epsilon(config: DQNConfig, progress: jax.Array) -> jax.Array:
    """Share of random actions, linear in `progress` (0 to 1 over the run) until `epsilon_fraction`, then constant."""
    share = jnp.clip(progress / config.epsilon_fraction, 0.0, 1.0)
    return config.epsilon_start + share * (config.epsilon_end - config.epsilon_start)


def make_dqn(env: TaskEnv, config: DQNConfig, episode_length: int, iterations: int) -> Agent:
    """The learner for one seed. `iterations` is the length of the run, which the epsilon schedule refers to."""
    if env.num_actions is None:
        raise ValueError("DQN needs discrete actions, and this environment's are continuous; use PPO")
    num_actions = env.num_actions
    config.network.state.check(env.objects, config.task_encoder)
    network = QNetwork(config.network, num_actions, env.objects)
    apply: Callable[..., Any] = network.apply  # as in dqn_loss
    reader = config.task_encoder
    codes_move = reader.learned and not config.freezes_task_encoder
    rows_drawn = config.rows_drawn
    begin_carry = partial(network.begin, env.observation_size)
    remember = partial(apply, method="remember")
    total_steps = iterations * config.unroll_length
    first_update = config.learning_starts // config.num_envs  # the step with the first gradient step
    optimizer = clipped_adam(
        config.learning_rate,
        config.max_gradient_norm,
        iterations * config.updates_per_iteration,
        anneal=config.anneal_learning_rate,
        task_encoder_learning_rate=config.task_encoder_learning_rate,
        freeze_task_encoder=config.freezes_task_encoder,
        each=config.gradient_clipping == "each",
    )
    # To ask whether the target is due for a copy reads and writes all parameters. It can be due only at gradient steps
    # whose number is a multiple of the period, so steps are taken in blocks, and it is asked at their beginning.
    period, rest = divmod(config.target_period, config.updates_per_step)
    copies_between = rest == 0
    together = math.gcd(period, config.unroll_length) if copies_between else config.unroll_length
    replay = make_replay(config.buffer_size, config.batch_size, config.num_envs, config.network.context)

    embed, codes_of = make_codes(
        reader, config.freezes_task_encoder, partial(apply, method="embed"), partial(apply, method="embed_rows")
    )

    def apart(table: TaskTable) -> bool:
        """Whether of a large table only the rows that act and learn are encoded."""
        return bool(rows_drawn) and codes_move and reader.rows_apart and table.num_rows > LARGE

    def with_mark(transition: Transition, marked: Any) -> Transition:
        """As replay keeps it, where `marked` are the marks of the rows."""
        return Marked(**vars(transition), mark=marked[transition.row]) if rows_drawn else transition

    def embed_target(params: Params, table: TaskTable) -> jax.Array | tuple[()]:
        return () if apart(table) else embed(params, table)

    def action_values(params: Params, embedding: jax.Array, carry: Carry, obs: jax.Array, row: jax.Array) -> jax.Array:
        """Q of every action, [..., A], for rows [...]."""
        obs, carry = jax.tree.map(lambda x: x.reshape(-1, *x.shape[row.ndim :]), (obs, carry))
        q = apply(params, obs, embedding, row.reshape(-1), carry)
        return q.reshape(*row.shape, num_actions)

    def choose(
        params: Params,
        embedding: jax.Array,
        carry: Carry,
        obs: jax.Array,
        row: jax.Array,
        key: jax.Array,
        share: jax.Array | float,
    ) -> jax.Array:
        greedy = action_values(params, embedding, carry, obs, row).argmax(axis=-1).astype(jnp.int32)
        which_key, action_key = jax.random.split(key)
        random = jax.random.randint(action_key, greedy.shape, 0, num_actions)
        return jnp.where(jax.random.uniform(which_key, greedy.shape) < share, random, greedy)

    def act(
        params: Params,
        embedding: jax.Array,
        carry: Carry,
        obs: jax.Array,
        row: jax.Array,
        key: jax.Array,
        deterministic: bool,
    ) -> jax.Array:
        return choose(params, embedding, carry, obs, row, key, 0.0 if deterministic else config.epsilon_end)

    def compare(
        params: Params, carry: Carry, obs: jax.Array, task: jax.Array, other: jax.Array
    ) -> tuple[jax.Array, jax.Array]:
        q = apply(params, obs, jnp.stack([task, other]), carry, method="every_row")  # [B, 2, A]
        action, value = q.argmax(axis=-1), q.max(axis=-1)
        return (action[:, 0] != action[:, 1]).astype(jnp.float32), value[:, 1] - value[:, 0]

    def value(params: Params, embedding: jax.Array, carry: Carry, obs: jax.Array, row: jax.Array) -> jax.Array:
        return action_values(params, embedding, carry, obs, row).max(axis=-1)

    def map_params(state: DQNState, function: Callable[[Params], Params]) -> DQNState:
        return replace(
            state,
            params=function(state.params),
            target_params=function(state.target_params),
        )

    def begin_all(env_params: TaskParams, key: jax.Array) -> Episode:
        return begin(env, env_params, key, config.num_envs, episode_length, staggered=config.num_envs > 1)

    def init(key: jax.Array, env_params: TaskParams) -> DQNState:
        params_key, episodes_key, key = jax.random.split(key, 3)
        episodes = begin_all(env_params, episodes_key)
        carry = repeated(begin_carry(), config.num_envs)
        params = network.init(params_key, env_params.table, episodes.state.obs, carry, method="initialise")
        obs = episodes.state.obs[0]
        steps = apply(params, begin_carry(), obs, jnp.int32(0), jnp.float32(0), method="extend")
        nothing = Shared(letter=jnp.int32(0), reward=jnp.float32(0), ended=jnp.bool_(False))
        blank = Transition(obs, jnp.int32(0), obs, jnp.int32(0), nothing, jnp.bool_(False), steps)
        return DQNState(
            params=params,
            target_params=params,
            target_embedding=embed_target(params, env_params.table),
            opt_state=optimizer.init(params),
            episodes=episodes,
            carry=carry,
            buffer=replay.init(with_mark(blank, jnp.zeros(1, jnp.uint32))),
            key=key,
            iteration=jnp.int32(0),
        )

    def restart(state: DQNState, env_params: TaskParams) -> DQNState:
        """Episodes under way are dropped: their rows mean nothing in the new table. What replay keeps stays."""
        episodes_key, key = jax.random.split(state.key)
        return replace(
            state,
            episodes=begin_all(env_params, episodes_key),
            carry=network.next_episode(state.carry, jnp.ones(config.num_envs, bool)),
            target_embedding=embed_target(state.target_params, env_params.table),
            key=key,
        )

    def interact(
        state: DQNState, env_params: TaskParams, embedding: Embedding, marked: Any, step: jax.Array, key: jax.Array
    ) -> tuple[DQNState, Step]:
        """One step of all environments, stored."""

        def explore(carry: Carry, now: State, key: jax.Array) -> tuple[jax.Array, Carry, tuple[()]]:
            share, row, coded = epsilon(config, step / float(total_steps)), env.row(now), embedding
            if callable(coded):  # of the rows that act, one after another
                row, coded = jnp.arange(config.num_envs), coded(row)
            return choose(state.params, coded, carry, now.obs, row, key, share), carry, ()

        def observe(carry: Carry, now: State, action: jax.Array, reward: jax.Array, ended: jax.Array) -> Carry:
            return network.next_episode(remember(state.params, carry, now.obs, action, reward), ended)

        episodes, carry = over_envs((state.episodes, state.carry))
        episodes, carry, done = advance(
            env,
            env_params,
            Player(explore, observe),
            episodes,
            carry,
            key,
            episode_length,
            config.discount,
        )
        steps = apply(state.params, done.carry, done.obs, done.action, done.reward, method="extend")
        stored = Transition(done.obs, done.action, done.state.obs, done.row, done.shared, done.truncated, steps)
        with jax.named_scope("replay"):
            buffer = replay.add(state.buffer, on_each(with_mark(stored, marked)))  # batches are drawn from all of it
        return replace(state, episodes=episodes, carry=carry, buffer=buffer), done

    def encode(state: DQNState, table: TaskTable, known: Any) -> tuple[Embedding, Callable | None]:
        """The rows of the table, encoded once for acting and learning.

        `known` is what an encoder that is frozen or learns nothing makes of them, at every step alike; or, of rows that
        are encoded apart, their codes of before; else None. Also returns the way back from a gradient of the embedding
        to one of the parameters, where there is one.
        """
        if apart(table):
            return partial(codes_of, state.params, table, known), None
        if codes_move:
            with jax.named_scope("codes"):
                return jax.vjp(lambda params: embed(params, table), state.params)
        return known, None

    def copied(state: DQNState, embedding: Any, count: jax.Array) -> DQNState:
        """The target network as gradient step `count` needs it: copied if it is due, with the rows' present codes.

        The count may be less than the true one by any multiple of the period.
        """
        params = state.params
        if callable(embedding):  # of rows that are encoded apart the target keeps no codes
            embedding = ()
        if reader.learned and not codes_move:
            params = with_encoder(params, state.target_params["params"][PART])  # the same: nothing to be copied
        with jax.named_scope("target"):
            target_params, target_embedding = optax.periodic_update(
                (params, embedding),
                (state.target_params, state.target_embedding),
                count,
                config.target_period,
            )
        return replace(state, target_params=target_params, target_embedding=target_embedding)

    def update(
        state: DQNState,
        table: TaskTable,
        known: Any,
        embedding: Any,
        pullback: Callable | None,
        marked: Any,
        phi: jax.Array | None,
        ready: jax.Array,
        annealed: jax.Array,
        key: jax.Array,
    ) -> tuple[DQNState, dict[str, jax.Array]]:
        """One gradient step on a sampled batch.

        Until it is `ready` nothing moves. To choose between old and new parameters would read and write all of them at
        every step; with gradients of zero Adam's moments and the parameters stay what they were, and only its counter
        has to be held. The step size is `annealed` by that share where Adam's counter is too small for the run.
        """
        with jax.named_scope("replay"):
            batch = over_envs(replay.sample(state.buffer, key))
        rows, movement = None, {}
        if isinstance(batch, Marked):
            rows = drawn_rows(table, batch, marked, rows_drawn, jax.random.fold_in(key, ROWS))
        target_embedding = state.target_embedding
        if apart(table):
            target_embedding = partial(codes_of, state.target_params, table, known)
        elif codes_move:
            movement = code_change(table, embedding, target_embedding)

        def loss(params: Params, embedding: Embedding) -> tuple[jax.Array, dict[str, jax.Array]]:
            target = state.target_params, target_embedding
            return dqn_loss(config, network, table, params, embedding, *target, batch, phi, rows)

        with jax.named_scope("loss"):
            if pullback is not None:
                (direct, by_embedding), scalars = jax.grad(loss, argnums=(0, 1), has_aux=True)(state.params, embedding)
                gradient = optax.tree.add(direct, pullback(by_embedding)[0])
            else:

                def direct_loss(params: Params) -> tuple[jax.Array, dict[str, jax.Array]]:
                    return loss(params, partial(codes_of, params, table, known) if apart(table) else embedding)

                gradient, scalars = jax.grad(direct_loss, has_aux=True)(state.params)
            gradient = jax.tree.map(lambda x: jnp.where(ready, x, 0.0), gradient)
        with jax.named_scope("optimiser"):
            updates, opt_state = optimizer.update(gradient, state.opt_state, state.params, share=annealed)
            opt_state = jax.tree.map(
                lambda new, old: jnp.where(ready, new, old) if new.ndim == 0 else new, opt_state, state.opt_state
            )
            params = optax.apply_updates(state.params, updates)
        return replace(state, params=params, opt_state=opt_state), scalars | movement

    def iterate(state: DQNState, env_params: TaskParams) -> tuple[DQNState, Metrics]:
        table = env_params.table
        key, scan_key = jax.random.split(state.key)
        iteration = state.iteration
        first = counting.before(iteration, config.unroll_length, total_steps)
        # Less than 0, so that no count of this iteration overflows.
        first_count = counting.product_modulo(iteration, config.updates_per_iteration, config.target_period)
        first_count -= config.target_period
        known = embed(state.params, table) if apart(table) or not codes_move else None
        marked = marks(table) if rows_drawn else None
        if table.starts is not None:  # pools take turns: this one may be new
            state = replace(state, target_embedding=embed_target(state.target_params, table))
        phi = potential(table, config.discount) if config.shaping else None

        def one_step(state: DQNState, inputs: tuple[jax.Array, jax.Array]):
            place, key = inputs  # the place in the iteration
            step = first + place
            act_key, *update_keys = jax.random.split(key, 1 + config.updates_per_step)
            count = first_count + place * config.updates_per_step  # from which the target's copies are timed
            embedding, pullback = encode(state, table, known)
            if not copies_between:
                state = copied(state, embedding, count)

            # ACT
            state, done = interact(state, env_params, embedding, marked, step, act_key)

            # UPDATE
            ready = counting.has_reached(iteration, place, config.unroll_length, first_update)
            annealed = jnp.maximum(step - first_update, 0) / float(total_steps)
            for i, update_key in enumerate(update_keys):
                if i > 0:
                    embedding, pullback = encode(state, table, known)
                    if not copies_between:
                        state = copied(state, embedding, count + i)
                state, scalars = update(
                    state, table, known, embedding, pullback, marked, phi, ready, annealed, update_key
                )
            scores = done.task, done.total / done.elapsed
            kept = done.totals, done.state.metrics, scores, task_totals(done, table)
            return state, (kept, scalars)

        def some_steps(state: DQNState, inputs: tuple[jax.Array, jax.Array]):
            if copies_between:
                embedding = embed_target(state.params, table) if codes_move else known
                state = copied(state, embedding, first_count + inputs[0][0] * config.updates_per_step)
            return jax.lax.scan(one_step, state, inputs)

        places = jnp.arange(config.unroll_length)
        keys = jax.random.split(scan_key, config.unroll_length)
        state, kept = jax.lax.scan(some_steps, state, (places.reshape(-1, together), keys.reshape(-1, together)))
        (totals, env_metrics, scores, tasks), scalars = jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), kept)
        scalars = jax.tree.map(jnp.mean, scalars) | env_scalars(env_metrics)
        scalars["epsilon"] = epsilon(config, first / float(total_steps))
        if 1 < table.num_tasks <= MAX_TASKS_APART:
            task, score = scores
            scalars |= by_task(totals.episodes, task, score, table.num_tasks)
        metrics = Metrics(summed(totals), scalars, jax.tree.map(lambda x: x.sum(axis=0), tasks))
        return replace(state, key=key, iteration=state.iteration + 1), metrics

    return Agent(
        init=init,
        iterate=iterate,
        embed=embed,
        act=act,
        frames_per_iteration=config.frames_per_iteration,
        begin=begin_carry,
        remember=remember,
        restart=restart,
        compare=compare,
        value=value,
        map_params=map_params,
        num_envs=config.num_envs,
        devices_per_seed=1,  # they would meet at every gradient step, which is small: more only where asked for
        replay="buffer",
    )


register_agent("dqn", DQNConfig, make_dqn)
