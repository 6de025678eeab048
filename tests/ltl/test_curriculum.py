"""The rule of a curriculum: when the next stage begins, and which tasks are drawn more often."""

import math

import pytest

from t2tl_jax.ltl import DEEPLTL_ZONES, Chains, Curriculum, LTLError, Stage

TWO = Curriculum((Stage(advance=0.8, over="least"), Stage(advance=0.9), Stage()))


@pytest.mark.parametrize(
    ("stage", "success", "after"),
    [
        (0, {"F a": 0.79, "F b": 1.0}, 0),  # the worst counts
        (0, {"F a": 0.8, "F b": 0.8}, 1),
        (1, {"F a": 0.8, "F b": 1.0}, 2),  # the mean counts, each task once
        (1, {"F a": 0.8, "F b": 0.99}, 1),
        (0, {}, 0),  # nothing ended yet
        (2, {"F a": 1.0}, 2),  # the last one stays
    ],
)
def test_the_next_stage_begins_when_the_rule_is_met(stage, success, after):
    assert TWO.next_stage(stage, success) == after


def test_tasks_that_fail_are_drawn_more_often():
    stage = Stage(temperature=0.5)
    weights = stage.weights(["F a", "F b", "F c"], {"F a": 1.0, "F b": 0.0})
    assert sum(weights) == pytest.approx(1) and weights[1] == weights[2]  # what never ended counts as failed
    assert weights[1] / weights[0] == pytest.approx(math.exp(2))
    assert stage.weights(["F a", "F b"], {}) == [0.5, 0.5]
    assert Stage().weights(["F a", "F b"], {"F a": 1.0}) == [0.5, 0.5]


def test_a_task_that_never_ended_is_not_mastered():
    success, tasks = {"F a": 1.0, "F b": 0.9}, ["F a", "F b", "F c"]
    assert TWO.next_stage(0, success, tasks) == 0 and TWO.next_stage(0, success | {"F c": 0.8}, tasks) == 1
    assert TWO.next_stage(1, success, tasks) == 2, "the mean is over those that ended"
    assert TWO.next_stage(0, success, tasks[:2]) == 1


@pytest.mark.parametrize("temperature", [1e-300, 1e-4])
def test_a_small_temperature_draws_the_worst_alone(temperature):
    weights = Stage(temperature=temperature).weights(["F a", "F b", "F c"], {"F a": 0.9, "F b": 0.5, "F c": 0.5})
    assert weights == [0.0, 0.5, 0.5]
    assert Stage(temperature=temperature).weights([], {}) == []


def test_deepltl_has_seven_stages_and_lists_the_first_four():
    names = ("Blue", "Green", "Magenta", "Yellow")
    counts = [len(list(stage.family.every(names))) for stage in DEEPLTL_ZONES.stages[:4]]
    assert counts == [4, 12, 12, 72] and len(DEEPLTL_ZONES.stages) == 7
    assert [stage.over for stage in DEEPLTL_ZONES.stages].count("least") == 1


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Curriculum(()), "at least one stage"),
        (lambda: TWO.next_stage(3, {}), "no stage 3: the curriculum has stages 0 to 2"),
        (lambda: Stage(Chains(), 1.5), "advance is a success rate from 0 to 1, got 1.5"),
        (lambda: Stage(over="most"), "over is .* got 'most'"),
    ],
)
def test_what_cannot_be_is_refused(make, said):
    with pytest.raises(LTLError, match=said):
        make()
