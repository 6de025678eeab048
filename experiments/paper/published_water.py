"""Published figures in WaterWorld: the ten tasks of the reward-machine paper (JAIR 2022), and T2TL's `phi_water`.

Those of the ten tasks were recomputed from the published episode logs: mean and standard deviation over maps 1 to
10 and two repeats. Those of T2TL were read off a picture to about 0.02.
"""

BEST_STEPS = {
    1: (29, 26, 14, 40, 29, 29, 41, 58, 33, 44),
    2: (28, 33, 15, 36, 47, 41, 48, 55, 34, 36),
    3: (25, 17, 27, 31, 37, 40, 44, 65, 30, 26),
    4: (31, 19, 14, 43, 33, 31, 53, 45, 42, 16),
    5: (16, 26, 24, 28, 32, 32, 35, 60, 22, 33),
    6: (23, 32, 28, 54, 53, 37, 66, 63, 28, 25),
    7: (42, 34, 16, 55, 40, 42, 55, 47, 52, 11),
    8: (49, 20, 26, 55, 35, 57, 64, 78, 54, 30),
    9: (17, 14, 19, 30, 30, 32, 38, 51, 21, 25),
    10: (15, 17, 28, 31, 37, 47, 50, 54, 19, 40),
}
"""Fewest steps in which any of the authors' methods carried out task t1 to t10, by map. The best score is 1/steps."""

STEPS = tuple(1000 * k for k in (50, 100, 200, 400, 600, 800, 1000, 1200, 1400, 1600, 1800, 2000))
"""Environment steps at which the published curves were sampled."""

SCORES = {
    "ql": (
        (0.097, 0.110, 0.154, 0.330, 0.444, 0.502, 0.559, 0.582, 0.602, 0.624, 0.650, 0.655),
        (0.013, 0.017, 0.027, 0.089, 0.106, 0.120, 0.121, 0.125, 0.130, 0.142, 0.146, 0.147),
    ),
    "crm": (
        (0.117, 0.169, 0.385, 0.593, 0.644, 0.691, 0.712, 0.725, 0.735, 0.743, 0.745, 0.736),
        (0.014, 0.020, 0.077, 0.092, 0.082, 0.082, 0.074, 0.080, 0.080, 0.082, 0.083, 0.079),
    ),
    # The same with potential-based reward shaping.
    "ql-rs": (
        (0.094, 0.106, 0.135, 0.277, 0.384, 0.462, 0.526, 0.569, 0.605, 0.629, 0.632, 0.643),
        (0.011, 0.016, 0.023, 0.083, 0.109, 0.109, 0.112, 0.112, 0.119, 0.121, 0.131, 0.138),
    ),
    "crm-rs": (
        (0.109, 0.152, 0.311, 0.551, 0.608, 0.643, 0.675, 0.694, 0.708, 0.724, 0.734, 0.725),
        (0.013, 0.014, 0.059, 0.078, 0.087, 0.092, 0.086, 0.082, 0.087, 0.087, 0.083, 0.088),
    ),
}
"""Normalised score (mean, standard deviation) after ``STEPS`` environment steps."""

SINGLE_STEPS = (100_000, 200_000, 400_000, 1_000_000, 2_000_000)
"""Environment steps at which shares of the single task are known."""

SINGLE_REWARDED = {
    "ql": (0.378, 0.877, 0.975, 0.986, 0.984),
    "crm": (0.226, 0.788, 0.963, 0.988, 0.968),
    "ql-rs": (0.242, 0.698, 0.950, 0.988, 0.981),
    "crm-rs": (0.197, 0.710, 0.946, 0.986, 0.988),
}
"""Share of the last 100 episodes of the single task, t10, that ended with reward 1, after ``SINGLE_STEPS`` steps."""

EPISODES = (500, 1000, 1500, 2000, 2500, 3000, 4000, 5000, 6000, 6500, 7000, 7500)
"""Episodes at which the picture of `phi_water` was read."""

PHI_WATER = {
    "DFA": (-0.96, -0.82, -0.66, -0.60, -0.50, -0.39, -0.27, -0.27, -0.19, -0.20, -0.14, -0.09),
    "DFA_cont": (-0.97, -0.86, -0.79, -0.73, -0.64, -0.54, -0.38, -0.23, -0.12, -0.18, -0.11, -0.04),
    "RM": (-0.96, -0.72, -0.57, -0.43, -0.37, -0.24, -0.21, -0.15, -0.15, -0.12, -0.13, -0.07),
    "GNN_pre": (-0.89, -0.69, -0.50, -0.41, -0.29, -0.24, -0.18, -0.09, -0.09, -0.11, -0.12, -0.17),
    "T1TL_pre": (-0.91, -0.64, -0.43, -0.29, -0.22, -0.12, -0.08, -0.02, -0.03, 0.07, 0.04, 0.03),
    "T2TL_pre": (-0.91, -0.65, -0.44, -0.33, -0.24, -0.17, -0.10, -0.04, 0.03, 0.03, 0.08, 0.09),
}
""""Performance" after ``EPISODES`` episodes, 12 seeds; what exactly was averaged is not published."""
