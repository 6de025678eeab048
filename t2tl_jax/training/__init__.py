"""What all learners share: episodes, rollouts, seeds, checkpoints, metrics, progress."""
