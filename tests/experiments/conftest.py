"""The fixtures of `tests/fake_runs.py`."""

from tests.fake_runs import evaluate_run, finished, finished_run, read_json, resume, train

__all__ = ["evaluate_run", "finished", "finished_run", "read_json", "resume", "train"]
