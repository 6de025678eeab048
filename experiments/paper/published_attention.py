"""The paper's attention figure: what each token of phi_zone_prime receives, summed over 8 heads, in one agent.

Read off the picture, to about 0.03 at the start of training and 0.05 at its end. All tokens together receive 8. Which
layers and whose attention these are is not published.
"""

TOKENS = ("until", "not", "Red", "and", "Black", "until", "not", "Yellow", "White")
"""The formula, operators first."""

START = (0.96, 0.77, 0.72, 1.02, 0.96, 0.96, 0.77, 0.85, 1.00)
"""Attention that each of ``TOKENS`` receives at the start of training."""

END = (1.00, 0.84, 1.17, 0.33, 1.67, 1.00, 0.84, 0.41, 0.76)
"""The same at its end."""
