"""The named configurations, registered as a user's would be; with them come the environments of this project."""

from dataclasses import replace
from typing import Any

from envs import waterworld, zones
from envs.waterworld import WaterWorldConfig
from envs.zones import ZoneConfig
from experiments import any_configs, controls  # noqa: F401, registers configurations and encoders
from t2tl_jax.agents.dqn_config import DQNConfig
from t2tl_jax.agents.ppo_config import PPOConfig
from t2tl_jax.networks.actor_critic import NetworkConfig
from t2tl_jax.networks.context_config import ContextConfig
from t2tl_jax.networks.q_network import QNetworkConfig
from t2tl_jax.networks.task_encoders import OneHotConfig
from t2tl_jax.networks.transformer import TransformerConfig
from t2tl_jax.registry import register_config
from t2tl_jax.runs.config import Config
from t2tl_jax.runs.pretraining_published import as_published
from t2tl_jax.runs.pretraining_schedule import SCHEDULE
from t2tl_jax.single_state import SingleStateConfig

# The short schedule: small iterations and few environments. Chosen on seeds from 100 on.
_SHORT = PPOConfig(
    network=NetworkConfig(context=ContextConfig()),
    num_envs=256,
    unroll_length=128,
    minibatch_size=2048,
)

ZONE = Config(
    env=ZoneConfig(),
    task="phi_zone",
    learner=_SHORT,
    pretrained="auto:own",
    frames=3_000_000,
    episode_length=zones.EPISODE_LENGTH,
)

ZONE_LONG = replace(ZONE, learner=PPOConfig(network=_SHORT.network), pretrained="auto", frames=10_000_000)

# Two regions to avoid teach a robot to stand still before it finds the goal. Episodes that start at a later sub-task
# show it what can be gained, and a falling rate keeps what is found.
ZONE_SAFE = replace(
    ZONE,
    task="phi_safe",
    random_starts=0.5,
    learner=replace(_SHORT, anneal_learning_rate=True),
)

# Every departure of the published code from the paper's text, and its schedule. Its token padding counts as input.
_PUBLISHED_READER = TransformerConfig(
    norm="post", positions="none", masked=False, norm_after_pooling=True, t_fixup=True
)
ZONE_PUBLISHED = Config(
    env=ZoneConfig(),
    task="phi_zone",
    task_length=25,
    pretrained="auto:own",
    pretraining_schedule="published",
    learner=PPOConfig(
        network=NetworkConfig(
            task_encoder=_PUBLISHED_READER,
            observation="raw",
            mean_scale=1.0,
            value_scale=1.0,
            context=ContextConfig(
                reader=replace(_PUBLISHED_READER, layers=2),
                reset=False,
                first_token="made_up",
                aligned=False,
                halved=True,
                recompute=False,
                segment_length=1,
            ),
        ),
        num_envs=16,
        unroll_length=4096,
        epochs=10,
        minibatch_size=1024,
        discount=0.998,
        gae_lambda=0.95,
        learning_rate=3e-4,
        anneal_learning_rate=False,
        adam_epsilon=1e-8,
        clip_eps=0.2,
        clip_value=True,
        value_coefficient=0.5,
        entropy_coefficient=0.003,
        noise_time=0.0,
        max_gradient_norm=0.5,
        normalise_advantage=False,
        timeout_is_terminal=True,
        staggered_start=False,
    ),
    episode_length=zones.EPISODE_LENGTH,
)

ZONE_PUBLISHED_LEAVES_OUT = (
    "the sample of every environment that is dropped in every second epoch, 16 of 65,536",
    "until-texts that grow as the task is carried out: a row shows its shortest formula (`phi_zone` has no until)",
    "token numbers by first use, which differ between tasks",
    "the parameters of the pre-training's last update but one: here its best ones go on",
)
"""What of the published code that configuration has not; docs/methods.md lists the same."""

# Few gradient steps, and large ones. With eight times as many, of 512 transitions after every 16 steps, more maps are
# solved in several times the time: docs/results.md has both.
_FEW_UPDATES = DQNConfig(
    num_envs=128,
    unroll_length=64,
    batch_size=1024,
    target_period=25,
    learning_rate=4e-4,
    epsilon_fraction=0.05,
)

# Fixed codes, learned before on the task itself, as in the authors' DQN: there is a gradient step after every step of
# the environments, and with each the codes of all sub-tasks would move under the values.
WATERWORLD = Config(
    env=WaterWorldConfig(layout="by_seed"),
    task="phi_water",
    pretrained="auto:own",
    learner=replace(_FEW_UPDATES, network=QNetworkConfig(head="bilinear", task_layer=512, freeze_task_encoder=True)),
    frames=2_500_000,
    episode_length=waterworld.EPISODE_LENGTH,
)

# The paper's own form: code and state side by side, and the pre-trained encoder trained on by the loss of DQN.
WATERWORLD_PAPER = replace(
    WATERWORLD, learner=replace(_FEW_UPDATES, network=QNetworkConfig(head="concat", task_layer=512))
)

# The reward-machine experiments of JAIR 2022 in their own world: one environment, one update after every step. Their
# learning rate was 1e-5, and three layers of 1,024 read the state. Seed i runs on map i; their maps are 1 to 10.
_RM_DQN = DQNConfig(
    network=QNetworkConfig(
        task_encoder=OneHotConfig(size=77), head="bilinear", state_layers=(512, 512), task_layer=512
    ),
    num_envs=1,
    unroll_length=2000,
    batch_size=32,
    buffer_size=50_000,
    learning_starts=1000,
    target_period=100,
    discount=0.9,
    learning_rate=1e-4,
    epsilon_end=0.01,
    epsilon_fraction=0.1,
)

_RM_WATER = Config(
    env=WaterWorldConfig(colours=waterworld.LETTERS, layout="by_seed", delay=1),
    task="rm_water_published",
    learner=_RM_DQN,
    frames=2_000_000,
    seeds="1,2,3,4,5,6,7,8,9,10",
    episode_length=waterworld.EPISODE_LENGTH,
)

# The same learner as published, as far as there are switches. Its replay draws 32 steps with all states of the machine,
# where theirs drew as many pairs of both one by one. The first layer is two arrays, one for the observation and one for
# the machine's state, which begin and are clipped apart; theirs is one.
_RM_PUBLISHED_DQN = replace(
    _RM_DQN,
    network=replace(_RM_DQN.network, head="concat", state_layers=(1024, 1024), task_layer=1024, head_layers=(256,)),
    learning_rate=1e-5,
    anneal_learning_rate=False,
    gradient_clipping="each",
)

# With targets of 32 samples instead of 32 x 77, the learning rate of crm is too large.
_QL: dict[str, Any] = {"counterfactual": False, "timeout_is_terminal": True}
_RM_QL_DQN = replace(_RM_DQN, **_QL, learning_rate=3e-5)

register_config("zone_ppo", ZONE, "T2TL by PPO on phi_zone: three million frames after pre-training on the same task")
register_config(
    "zone_ppo_closed_form",
    replace(ZONE, env=ZoneConfig(physics="closed_form")),
    "zone_ppo with the motion in closed form instead of MuJoCo: many times faster on a CPU",
)
register_config(
    "zone_ppo_long",
    ZONE_LONG,
    "zone_ppo with the long schedule: ten million frames in 2,048 environments, after random formulas",
)
register_config(
    "zone_ppo_safe",
    ZONE_SAFE,
    "zone_ppo on phi_safe, the paper's running example: Black, then White, and neither Red nor Yellow before",
)
register_config(
    "zone_ppo_published",
    ZONE_PUBLISHED,
    "the same with the schedule and every choice of the published code: 16 environments x 4,096 steps",
)
register_config(
    "zone_ppo_random",
    replace(ZONE_LONG, env=ZoneConfig(layout="random")),
    "zone_ppo_long on random maps: every episode takes one of its seed's 1,024",
)
register_config(
    "waterworld_dqn",
    WATERWORLD,
    "T1TL by double DQN on phi_water in WaterWorld, every sub-task learned from every step; 2.5 million frames after "
    "pre-training on the same task",
)
register_config(
    "waterworld_dqn_paper",
    WATERWORLD_PAPER,
    "the same in the paper's form: code concatenated with the state, pre-trained encoder trained on by the DQN loss",
)
register_config(
    "rm_water_crm",
    _RM_WATER,
    "reward-machine benchmark: ten tasks, one update per step for every state (crm); seeds 1 to 10 are its maps",
)
register_config(
    "rm_water_crm_published",
    replace(_RM_WATER, learner=_RM_PUBLISHED_DQN),
    "rm_water_crm in the published form: three layers of 1,024, a layer of 256 in each head, learning rate 1e-5, each "
    "array's gradient clipped by itself",
)
register_config(
    "rm_water_ql",
    replace(_RM_WATER, learner=_RM_QL_DQN),
    "the same, but every step teaches only the machine's own state (ql)",
)
register_config(
    "rm_water_ql_published",
    replace(_RM_WATER, learner=replace(_RM_PUBLISHED_DQN, **_QL)),
    "rm_water_ql in the same published form, its learning rate included",
)
register_config(
    "rm_water_ql_shaped_published",
    replace(_RM_WATER, learner=replace(_RM_PUBLISHED_DQN, **_QL, shaping=True)),
    "rm_water_ql_shaped in the same published form",
)
register_config(
    "rm_water_crm_shaped",
    replace(_RM_WATER, learner=replace(_RM_DQN, shaping=True)),
    "rm_water_crm, learning from rewards shaped by a potential of the machines' states; what is reported is not",
)
register_config(
    "rm_water_ql_shaped",
    replace(_RM_WATER, learner=replace(_RM_QL_DQN, shaping=True)),
    "rm_water_ql with the same shaping",
)
register_config(
    "rm_water_parallel",
    replace(
        _RM_WATER,
        learner=replace(
            _RM_DQN,
            num_envs=32,
            unroll_length=500,
            batch_size=512,
            buffer_size=100_000,
            learning_rate=3e-4,
        ),
    ),
    "the same tasks as rm_water_crm in 32 environments at once, with larger batches: sooner done, not as published",
)
register_config(
    "pretrain_zone",
    SCHEDULE,
    "pre-training of the task encoder on random formulas over ZoneEnv's colours; --task phi_zone as published",
)
register_config(
    "pretrain_zone_published",
    replace(
        as_published(SCHEDULE),
        task=ZONE_PUBLISHED.task,
        task_length=ZONE_PUBLISHED.task_length,
        learner=replace(
            as_published(SCHEDULE).learner,
            network=replace(as_published(SCHEDULE).learner.network, task_encoder=_PUBLISHED_READER),
        ),
    ),
    "the pre-training of zone_ppo_published: phi_zone itself, two million frames, encoder and constants as published",
)
register_config(
    "pretrain_water",
    replace(
        SCHEDULE,
        env=SingleStateConfig(waterworld.COLOURS),
        learner=replace(
            SCHEDULE.learner,
            network=replace(SCHEDULE.learner.network, task_encoder=QNetworkConfig().task_encoder),
        ),
    ),
    "the same over WaterWorld's colours, with its size of the encoded task",
)
