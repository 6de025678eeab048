"""LetterWorld: letters on a grid whose edges are joined, after LTL2Action and DeepLTL."""

from envs.letterworld.config import EPISODE_LENGTH, LetterWorldConfig
from envs.letterworld.letter_env import NUM_ACTIONS, LetterState, LetterWorld, LetterWorldParams
from t2tl_jax.registry import register_env

__all__ = ["EPISODE_LENGTH", "NUM_ACTIONS", "LetterState", "LetterWorld", "LetterWorldConfig", "LetterWorldParams"]

register_env(
    "letterworld",
    LetterWorldConfig,
    LetterWorld,
    {
        # Under their published names: DeepLTL's, and LTL2Action's, which has one map a run.
        "LetterEnv-v0": LetterWorldConfig(),
        "Letter-7x7-v3": LetterWorldConfig(layout="by_seed"),
    },
)
