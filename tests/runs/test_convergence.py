"""The end of training by convergence: of flat curves, of all seeds, and never of a curve at zero."""

import math

import numpy as np
import pytest

from t2tl_jax.ltl import compile_tasks
from t2tl_jax.runs.convergence import Convergence, ConvergenceConfig, optimal_return

CONFIG = ConvergenceConfig(window=3, delta=0.01)


def iterations_until_stop(*curves, config=CONFIG):
    test = Convergence(config, len(curves))
    for iteration, column in enumerate(zip(*curves, strict=True), start=1):
        test.add([{"discounted_return": value} for value in column])
        if test.reached:
            return iteration
    return None


RISING = [0.1 * i for i in range(1, 9)]


def test_it_stops_when_the_mean_of_a_window_gains_no_more_than_delta():
    # Rises by 0.1 up to 0.8, then stays: the windows [0.7, 0.8, 0.8] and [0.8, 0.8, 0.8] are the first that differ by
    # more than 0.01, and one iteration later both are flat.
    assert iterations_until_stop([*RISING, *[0.8] * 10]) == 8 + 5
    assert iterations_until_stop([*RISING, *[0.8] * 10], config=ConvergenceConfig(window=3, delta=0.04)) == 8 + 4
    assert iterations_until_stop([0.1 * i for i in range(30)]) is None


def test_every_seed_has_to_be_there_but_not_at_the_same_time():
    early, late = [0.5] * 20, [*RISING, *[0.8] * 12]
    assert iterations_until_stop(early, late) == 13
    leaves_again = [*[0.5] * 6, *[0.1 * i for i in range(5, 19)]]
    assert iterations_until_stop(leaves_again, late) == 13


def test_no_reward_yet_is_no_convergence():
    assert iterations_until_stop([0.0] * 20) is None
    assert iterations_until_stop([None] * 20) is None
    assert iterations_until_stop([0.5] * 20, config=ConvergenceConfig(window=0)) is None


def test_taking_up_again_equals_going_on():
    rng = np.random.default_rng(0)
    curve = np.clip(np.linspace(0.0, 2.0, 60), 0, 1) + 0.02 * rng.normal(size=60)
    end = iterations_until_stop(curve)
    assert end is not None
    for cut in (1, 5, end - 1):
        test = Convergence(CONFIG, 1, curve[None, :cut])
        count = cut
        while not test.reached:
            test.add([{"discounted_return": curve[count]}])
            count += 1
        assert count == end
    assert Convergence(CONFIG, 1, curve[None, :end]).reached


@pytest.mark.parametrize(
    ("formulas", "expected"),
    [
        (["F a"], 1.0),
        (["F(a & F b)"], 0.9),
        (["!b U a", "F(a & F(b & F c))"], (1 + 0.9**2) / 2),
        (["F(a & X X b)", "false"], 0.9**2 / 2),  # nothing can be had from what is false
    ],
)
def test_the_optimum_is_the_shortest_way_to_true(formulas, expected):
    assert optimal_return(compile_tasks(formulas, ("a", "b", "c"), "at_most_one"), 0.9) == pytest.approx(expected)


def test_random_tasks_have_converged_when_the_regret_stays_not_when_the_pools_get_harder():
    """A policy that learns while its pools get harder, and one that learns nothing while they get easier."""
    optimal = np.linspace(0.9, 0.5, 30)
    learning = optimal - np.linspace(0.4, 0.0, 30)  # the return stands at 0.5
    standing = optimal[::-1] - 0.3

    def iterations(returns, optima):
        test = Convergence(CONFIG, 1)
        for number, (value, best) in enumerate(zip(returns, optima, strict=True), start=1):
            test.add([{"discounted_return": value, "optimal_return": best}])
            if test.reached:
                return number
        return None

    assert iterations(learning, optimal) is None and iterations_until_stop(learning) == 6
    assert iterations(standing, optimal[::-1]) == 6 and iterations_until_stop(standing) is None
    taken_up = Convergence(CONFIG, 1, standing[None, :6], optimal[None, ::-1][:, :6])
    assert taken_up.reached and not Convergence(CONFIG, 1, learning[None, :20], optimal[None, :20]).reached


@pytest.mark.parametrize("settings", [{"window": -1}, {"delta": -0.1}, {"delta": math.nan}])
def test_impossible_settings_are_refused(settings):
    with pytest.raises(ValueError, match=r"0 or more|at least 0"):
        ConvergenceConfig(**settings)
