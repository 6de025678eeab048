"""Speed of the parts: ``python -m experiments.benchmarks.env`` and so on."""
