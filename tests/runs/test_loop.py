import jax
import pytest

from t2tl_jax.runs import loop


@pytest.mark.parametrize("backend", ["cpu", "gpu"])
@pytest.mark.parametrize(("period", "stop_after"), [(1e9, None), (0.0, None), (1e9, 3), (0.0, 3), (1e9, 0)])
def test_every_iteration_is_recorded_once_and_before_it_is_saved(monkeypatch, backend, period, stop_after):
    monkeypatch.setattr(jax, "default_backend", lambda: backend)
    events: list[tuple[str, int]] = []
    dispatched = 0

    def prepare(done, state):
        assert done == state == 2 + dispatched
        return state, f"parameters of iteration {done + 1}"

    def iterate(state, env_params):
        nonlocal dispatched
        dispatched += 1
        assert env_params == f"parameters of iteration {state + 1}"
        return state + 1, {"iteration": state + 1}

    def after(iteration, state):
        assert state == iteration
        events.append(("after", iteration))

    def record(iteration, metrics):
        assert ("after", iteration) in events
        assert metrics["iteration"] == iteration
        events.append(("record", iteration))

    def save(iteration, state):
        assert state == iteration
        assert ("record", iteration) in events
        events.append(("save", iteration))

    hooks = loop.Hooks(after, record, save, lambda: stop_after is not None and dispatched >= stop_after, prepare)
    reached, state = loop.run_loop(iterate, 2, 2, 7, period, hooks)
    expected = 7 if stop_after is None else 2 + stop_after
    assert reached == state == expected
    for expected_once in ("after", "record"):
        assert [n for kind, n in events if kind == expected_once] == list(range(3, expected + 1))
    saved = [n for kind, n in events if kind == "save"]
    assert saved == ([] if expected == 2 else list(range(3, expected + 1)) if period == 0 else [expected])


def test_checkpoints_take_one_part_in_twenty_of_the_time(monkeypatch):
    """An iteration takes 1 s and a checkpoint 4 s, on a clock of our own; one every 10 s is asked for."""
    clock, saved = 0.0, []
    monkeypatch.setattr(loop.time, "monotonic", lambda: clock)

    def iterate(state, _):
        nonlocal clock
        clock += 1
        return state, {}

    def save(iteration, _):
        nonlocal clock
        saved.append(iteration)
        clock += 4

    hooks = loop.Hooks(lambda *_: None, lambda *_: None, save, lambda: False, lambda done, state: (state, None))
    loop.run_loop(iterate, 0, 0, 300, 10, hooks)
    assert saved == [10, 90, 170, 250, 300]
