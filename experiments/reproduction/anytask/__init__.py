"""Agents that carry out formulas they were not trained on: their runs, and the tasks that they are tested on."""
