"""Learners: one readable file each, all behind the interface of `t2tl_jax/training/types.py`."""
