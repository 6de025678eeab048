"""Runs: from a configuration to a trained agent, with its folder, checkpoints, metrics and callbacks."""
