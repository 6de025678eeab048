"""The named configurations of agents for any task, see `experiments.configs`."""

from dataclasses import replace

from envs import flatworld, letterworld, waterworld, zones
from envs.flatworld import FlatWorldConfig
from envs.letterworld import LetterWorldConfig
from envs.waterworld import WaterWorldConfig
from experiments.reproduction.anytask import suites
from t2tl_jax.agents.dqn_config import DQNConfig
from t2tl_jax.agents.ppo_config import PPOConfig
from t2tl_jax.ltl import Chains, Conjunction, Mixture
from t2tl_jax.ltl.tasks import NAMED_TASKS
from t2tl_jax.networks.actor_critic import NetworkConfig
from t2tl_jax.networks.lookahead import LookaheadConfig
from t2tl_jax.networks.merged import MergedConfig
from t2tl_jax.networks.objects import ObjectsConfig
from t2tl_jax.networks.q_network import QNetworkConfig
from t2tl_jax.registry import named_config, register_config
from t2tl_jax.runs.config import Config, PoolConfig

# By configuration, what is kept out of its pools as a whole: what agents of its world are tested on, so that whoever
# trains one and then tests it tests what it was not trained on. Of WaterWorld also the paper's tasks of other widths.
KEPT_OUT = {
    "zones_any": ",".join(suites.ZONES.tasks),
    "letters_any": ",".join((*suites.LETTERS.tasks, *suites.LETTERS_LONG.tasks)),
    "flat_any": ",".join(suites.FLAT.tasks),
    "water_any": ",".join(name for name in NAMED_TASKS if name.startswith("phi_water")),
}

# Two pools take turns, so that new tasks cut no episode short. A random start may be any sub-task of a pool. Balls
# overlap now and then, which is not to be waited for, so the code counts one ball at a time.
register_config(
    "water_any",
    Config(
        env=WaterWorldConfig(layout="random"),
        task=Chains(depth=(2, 5), avoid=(1, 4)),
        pool=PoolConfig(size=256, rows=1024, period=64, finish=True, unseen=KEPT_OUT["water_any"]),
        random_starts=0.5,
        learner=PPOConfig(
            network=NetworkConfig(
                task_encoder=LookaheadConfig(one_at_a_time=True),
                state=ObjectsConfig(identity="role"),
                env_layers=(),
                observation="raw",
            ),
            num_envs=2048,
            unroll_length=64,
            minibatch_size=4096,
            discount=0.995,
            gae_lambda=0.95,
            entropy_coefficient=0.0003,
            learning_rate=1e-3,
            anneal_learning_rate=True,
        ),
        frames=100_000_000,
        map_period=32,
        episode_length=waterworld.EPISODE_LENGTH,
    ),
    "random chains on random maps of WaterWorld by PPO: a network over balls that is told their roles",
)

# One agent for every task of an environment. The code of a task is read off its table, so that nothing but moving is to
# be learned; objects are merged by what they are to the task, so that names make no difference. Tasks are
# chains, and two chains that are to be carried out together, half of each but in ZoneEnv.
SMALL = PPOConfig(
    network=NetworkConfig(task_encoder=LookaheadConfig(farther=True), state=MergedConfig(), env_layers=(256, 128)),
    num_envs=2048,
    unroll_length=64,
    minibatch_size=8192,
)


def any_tasks(chains: Chains) -> Mixture:
    """Chains, and pairs of shorter ones."""
    short = replace(chains, depth=(1, 2))
    return Mixture((chains, Conjunction(short, (2, 2))), (0.5, 0.5))


# With much to avoid the robot has to learn to pass between discs; three tenths of the tasks have two or three to avoid.
MUCH_TO_AVOID = Mixture(
    (
        Chains(depth=(1, 3), avoid=(0, 3)),
        Conjunction(Chains(depth=(1, 2), avoid=(0, 3)), (2, 2)),
        Chains(depth=(1, 3), reach=(1, 1), avoid=(2, 3)),
    ),
    (0.35, 0.35, 0.3),
)

# The code has room for ten colours. Step size, widths and family were chosen on formulas that are no tests, after an
# earlier agent had been seen on the tests.
register_config(
    "zones_any",
    Config(
        env=replace(zones.OPEN, physics="closed_form"),
        task=MUCH_TO_AVOID,
        pool=PoolConfig(size=512, rows=1024, period=64, finish=True, unseen=KEPT_OUT["zones_any"]),
        random_starts=0.3,
        learner=replace(
            SMALL,
            network=replace(
                SMALL.network,
                task_encoder=LookaheadConfig(propositions=10, farther=True),
                env_layers=(512, 256),
                actor_layers=(128, 128, 64),
                critic_layers=(128, 64),
            ),
            learning_rate=1e-3,
            anneal_learning_rate=True,
        ),
        frames=100_000_000,
        map_period=32,
        episode_length=zones.EPISODE_LENGTH,
    ),
    "any task on any map of the open ZoneEnv (PointLtl2-v0) by PPO: lidars merged by what colours are to the task",
)
register_config(
    "letters_any",
    Config(
        env=LetterWorldConfig(),
        task=any_tasks(Chains(depth=(1, 3), avoid=(0, 3))),
        pool=PoolConfig(size=512, rows=2048, period=64, finish=True, unseen=KEPT_OUT["letters_any"]),
        random_starts=0.3,
        learner=replace(
            SMALL,
            network=replace(SMALL.network, task_encoder=LookaheadConfig(propositions=12, farther=True)),
            unroll_length=32,
            discount=0.94,
            gae_lambda=0.95,
            entropy_coefficient=0.01,
            anneal_learning_rate=True,
        ),
        frames=10_000_000,
        map_period=32,
        episode_length=letterworld.EPISODE_LENGTH,
    ),
    "any task on any map of LetterWorld by PPO: cells merged by what their letters are to the task",
)
# A transition teaches eight of the thousands of rows of two pools: the one that was played, and others.
register_config(
    "letters_any_dqn",
    replace(
        named_config("letters_any"),
        learner=DQNConfig(
            network=QNetworkConfig(
                task_encoder=LookaheadConfig(propositions=12, farther=True),
                state=MergedConfig(),
                state_layers=(256,),
                task_layer=128,
                head="film",
            ),
            num_envs=64,
            unroll_length=64,
            batch_size=256,
            rows_per_transition=8,
            buffer_size=100_000,
            learning_starts=2_000,
            target_period=100,
            discount=0.94,
            learning_rate=5e-4,
            epsilon_end=0.05,
            epsilon_fraction=0.2,
        ),
        frames=500_000,
    ),
    "letters_any by double DQN: of every transition some rows learn, drawn anew each time",
)
register_config(
    "flat_any",
    Config(
        env=FlatWorldConfig(),
        task=any_tasks(Chains(depth=(1, 3), goals=flatworld.LETTERS)),
        pool=PoolConfig(size=256, rows=1024, period=64, finish=True, unseen=KEPT_OUT["flat_any"]),
        random_starts=0.5,
        learner=replace(
            SMALL,
            network=NetworkConfig(
                task_encoder=LookaheadConfig(letters=flatworld.LETTERS, farther=True, avoid_farther=True),
                env_layers=(256, 128),
                actor_layers=(256, 256),
                critic_layers=(256, 256),
            ),
            discount=0.98,
            gae_lambda=0.95,
            entropy_coefficient=0.001,
            learning_rate=1e-3,
            anneal_learning_rate=True,
        ),
        frames=50_000_000,
        map_period=32,
        episode_length=flatworld.EPISODE_LENGTH,
    ),
    "any task on the map of FlatWorld by PPO: the look-ahead tells of the letters that occur",
)
