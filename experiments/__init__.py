"""Command lines: train, evaluate, benchmark."""
