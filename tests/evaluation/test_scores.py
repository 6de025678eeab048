"""The normalised score against a list of episodes."""

import numpy as np

from t2tl_jax.evaluation.scores import best_scores, normalised_scores, return_by_episode


def test_scores_equal_an_average_over_single_episodes():
    """Iterations of random episodes of two tasks; a window holds whole iterations, as few as reach its size."""
    rng = np.random.default_rng(0)
    best = np.array([0.1, 0.02])
    iterations = [
        [(int(task), float(score)) for task, score in zip(rng.integers(0, 2, n), rng.random(n) * 0.02, strict=True)]
        for n in rng.integers(0, 9, 40)
    ]
    columns = {"seed": np.full(40, 7.0), "frames": 10.0 * np.arange(1, 41)}
    for k in range(2):
        of_task = [[score for task, score in episodes if task == k] for episodes in iterations]
        columns[f"episodes_{k + 1}"] = np.array([len(scores) for scores in of_task], float)
        columns[f"score_{k + 1}"] = np.array([np.mean(scores) if scores else 0.0 for scores in of_task])
        columns[f"best_score_{k + 1}"] = np.array([max(scores, default=0.0) for scores in of_task])
    frames, curve = normalised_scores(columns, 7, best, window=30)
    np.testing.assert_array_equal(frames, columns["frames"])
    for end in range(40):
        window: list[float] = []
        for episodes in reversed(iterations[: end + 1]):
            window += [score / best[task] for task, score in episodes]
            if len(window) >= 30:
                break
        assert curve[end] == np.mean(window) if not window else abs(curve[end] - np.mean(window)) < 1e-12
    every = [[score for episodes in iterations for task, score in episodes if task == k] for k in range(2)]
    np.testing.assert_allclose(best_scores(columns, 2)[7], [max(scores) for scores in every])


def test_returns_by_episode_average_the_last_ones():
    columns = {
        "seed": np.zeros(4),
        "episodes": np.array([10.0, 0.0, 10.0, 10.0]),
        "success_rate": np.array([0.0, np.nan, 0.5, 1.0]),
        "violation_rate": np.array([1.0, np.nan, 0.5, 0.0]),
    }
    np.testing.assert_allclose(return_by_episode(columns, 0, (10, 20, 30, 40), window=20), [-1.0, -0.5, 0.5, 0.5])
    assert np.isnan(return_by_episode(columns, 0, (40,), window=35)).all()  # of so many episodes nothing is known
