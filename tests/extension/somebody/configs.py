"""A named configuration of everything else here."""

from somebody.learner import ReinforceConfig
from somebody.world import LampsConfig
from t2tl_jax import Config, register_config

LIGHTS = Config(
    env=LampsConfig(),
    task="F(lamp1 & lamp2 & F(!lamp1 & !lamp2))",
    learner=ReinforceConfig(),
    frames=5 * 512,
    episode_length=20,
)

register_config("lights", LIGHTS, "somebody's lamps, by somebody's learner")
