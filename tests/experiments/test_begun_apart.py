"""Runs whose encoders come from different trainings of the same pre-training are named on the page of results."""

from types import SimpleNamespace

from experiments.reproduction.begun_apart import begun_apart, said


def run(folder=None, frames=0, returns=()):
    summary = {"folder": f"../{folder}", "frames_per_seed": frames, "discounted_return": list(returns)}
    return SimpleNamespace(status={"pretraining": summary} if folder else {})


def test_other_trainings_of_one_pretraining_are_told():
    """Also where they took as many frames, but ended otherwise; runs without pre-training are none of them."""
    runs = {
        "fresh": run(),
        "a": run("pre", 100_000, (0.5,)),
        "b": run("pre", 100_000, (0.5,)),
        "c": run("pre", 100_000, (0.6,)),
        "d": run("pre-random", 90_000, (0.4,)),
    }
    assert begun_apart(runs) == {"pre": [(100_000, ["a", "b"]), (100_000, ["c"])]}
    words = " ".join(said(runs).split())
    assert "`pre`: 100,000 frames a seed for a, b; 100,000 frames a seed for c. What" in words
    assert "pre-random" not in words


def test_nothing_is_said_where_all_began_alike():
    assert said({"a": run("pre", 1, (0.5,)), "b": run("pre", 1, (0.5,)), "c": run("other", 2, (0.1,))}) == ""
    assert said({"fresh": run()}) == ""
