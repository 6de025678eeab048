"""Table I of the paper, which compares representations of a task in words alone; in our words."""

PROPERTIES = (
    ("size", "fixed", "flexible"),
    ("made", "by hand", "learned"),
    ("when", "in advance", "on the fly"),
    ("to be interpreted", "indirectly", "directly"),
)
"""What is compared, of the automaton or the reward machine, and of the Transformer."""
