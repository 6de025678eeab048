"""Learners: one readable file each, its constants in another, all behind the interface of `t2tl_jax/training/types.py`.

Importing this package registers them, and the task encoders with them.
"""

from t2tl_jax.agents import dp, dqn, ppo

__all__ = ["dp", "dqn", "ppo"]
