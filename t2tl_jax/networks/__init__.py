"""Flax modules: Transformer, task encoders, actor and critic. They know no algorithm."""
