"""A logger of your own: every metric of every seed goes to MLflow's local file store.

    pip install 't2tl_jax[mlflow]'
    python examples/own_logger.py 20000 mlruns && mlflow ui --backend-store-uri mlruns

A callback derives from `t2tl_jax.Callback` and overrides what it needs; it is handed to `train`.
"""

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

import t2tl_jax
from t2tl_jax import Callback, NetworkConfig, OneHotConfig, PPOConfig, Row, TrainingProgress

os.environ.setdefault("MLFLOW_ALLOW_FILE_STORE", "true")  # MLflow prefers a data base, which needs a server's packages
try:
    import mlflow
except ImportError:
    sys.exit("this example logs to MLflow: pip install 't2tl_jax[mlflow]'")


class MLflowLogger(Callback):
    """One MLflow run for each seed."""

    def __init__(self, store: str | Path) -> None:
        self._client = mlflow.MlflowClient(Path(store).absolute().as_uri())
        self._runs: list[str] = []

    def on_start(self, progress: TrainingProgress) -> None:
        """Begin the runs."""
        found = self._client.get_experiment_by_name("t2tl_jax")
        experiment = found.experiment_id if found else self._client.create_experiment("t2tl_jax")
        for seed in progress.seeds:
            run = self._client.create_run(experiment, run_name=f"{progress.config.task}, seed {seed}")
            self._client.log_param(run.info.run_id, "task", progress.config.task)
            self._runs.append(run.info.run_id)

    def on_iteration(self, progress: TrainingProgress, rows: Sequence[Row]) -> None:
        """Log what is known: an average over no episodes is None."""
        for run, row in zip(self._runs, rows, strict=True):
            for name, value in row.items():
                if value is not None and name not in ("iteration", "seed"):
                    self._client.log_metric(run, name, value, step=progress.done)

    def on_end(self, progress: TrainingProgress) -> None:
        """Close the runs."""
        for run in self._runs:
            self._client.set_terminated(run, "FAILED" if progress.stop == "failed" else "FINISHED")


def main(frames: int = 20_000, store: str = "mlruns") -> t2tl_jax.Result:
    """Train two seeds and say where their metrics are."""
    network = NetworkConfig(task_encoder=OneHotConfig(4), env_layers=(), actor_layers=(16,), critic_layers=(16,))
    learner = PPOConfig(network=network, num_envs=64, unroll_length=16, minibatch_size=256)
    env = t2tl_jax.make_env("SingleState")
    run = t2tl_jax.train(env, "F(Red & F White)", learner, seeds=2, frames=frames, callbacks=[MLflowLogger(store)])
    print(f"{run.iteration} iterations of {len(run.metrics)} metrics and {len(run.seeds)} seeds are in {store}")
    return run


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("frames", type=int, nargs="?", default=20_000)
    parser.add_argument("store", nargs="?", default="mlruns")
    main(**vars(parser.parse_args()))
