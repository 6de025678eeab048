"""The parts of ``python -m experiments.sweep``: training what is missing, tables, and the search for settings."""
