"""The ZoneEnv figure of the paper's repository, read off the picture to about 0.01.

Frames and average discounted return on phi_zone. How many seeds it shows is not published.
"""

_FRAMES = tuple(1e7 * x for x in (0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0))

ZONE_CURVES: dict[str, tuple[tuple[float, ...], tuple[float, ...]]] = {
    "T2TL_pre (published)": (
        _FRAMES,
        (0.02, 0.12, 0.22, 0.36, 0.42, 0.50, 0.52, 0.58, 0.59, 0.62, 0.64, 0.66, 0.68, 0.68),
    ),
    "T1TL_pre (published)": (
        _FRAMES,
        (0.00, 0.04, 0.10, 0.30, 0.38, 0.44, 0.45, 0.50, 0.53, 0.54, 0.55, 0.60, 0.61, 0.62),
    ),
    "GNN_pre (published)": (
        _FRAMES,
        (0.02, 0.14, 0.31, 0.34, 0.39, 0.42, 0.43, 0.44, 0.44, 0.45, 0.48, 0.50, 0.525, 0.53),
    ),
    "DFA (published)": (
        _FRAMES,
        (0.00, 0.00, 0.00, 0.00, 0.01, 0.03, 0.05, 0.11, 0.24, 0.26, 0.28, 0.28, 0.28, 0.28),
    ),
    "DFA_cont (published)": (
        _FRAMES,
        (0.01, 0.00, 0.01, 0.03, 0.07, 0.09, 0.15, 0.17, 0.18, 0.185, 0.20, 0.27, 0.28, 0.275),
    ),
}
"""``(frames, discounted return)`` by method."""
