"""The paper's comparison of widths of codes, read off the picture: WaterWorld to about 0.02, ZoneEnv to about 0.01.

The one-hot codes are the reward machine's state in WaterWorld, the automaton's in ZoneEnv, where one number stands for
the state itself. The Transformer is pre-trained in WaterWorld and not in ZoneEnv.
"""

EPISODES = (1000, 2000, 3000, 4000, 5000, 6000, 7000, 7460)
"""Episodes at which the picture of WaterWorld was read."""

WATER = {
    "RM 6": (-0.72, -0.42, -0.24, -0.21, -0.15, -0.15, -0.12, -0.07),
    "RM 16": (-0.84, -0.53, -0.32, -0.25, -0.13, -0.07, -0.02, 0.01),
    "RM 32": (-0.75, -0.47, -0.30, -0.22, -0.18, -0.16, -0.14, -0.12),
    "T1TL_pre 8": (-0.70, -0.44, -0.22, -0.15, -0.17, -0.08, -0.11, -0.13),
    "T1TL_pre 16": (-0.67, -0.36, -0.18, -0.12, -0.03, -0.10, -0.13, -0.14),
    "T1TL_pre 32": (-0.64, -0.29, -0.13, -0.08, -0.02, -0.03, 0.04, 0.02),
}
""""Performance" on phi_water after ``EPISODES`` episodes."""

FRAMES = tuple(1e6 * x for x in range(1, 11))
"""Frames at which the picture of ZoneEnv was read."""

ZONE = {
    "DFA 1": (0.00, 0.00, 0.03, 0.11, 0.24, 0.26, 0.275, 0.28, 0.28, 0.28),
    "DFA 16": (0.05, 0.10, 0.25, 0.29, 0.41, 0.42, 0.43, 0.40, 0.42, 0.44),
    "DFA 32": (0.00, 0.06, 0.18, 0.29, 0.33, 0.34, 0.35, 0.35, 0.355, 0.39),
    "T1TL 8": (0.06, 0.21, 0.26, 0.34, 0.36, 0.36, 0.36, 0.36, 0.36, 0.36),
    "T1TL 16": (0.05, 0.29, 0.48, 0.53, 0.59, 0.60, 0.60, 0.60, 0.60, 0.605),
    "T1TL 32": (0.04, 0.13, 0.15, 0.16, 0.16, 0.16, 0.25, 0.25, 0.25, 0.255),
}
"""Average discounted return on phi_zone after ``FRAMES`` frames."""
