"""Parameters of an earlier run, for whoever goes on with them."""

from typing import Any

import jax

from t2tl_jax.runs.build import Experiment
from experiments.configs import Config
from t2tl_jax.errors import UserError
from t2tl_jax.runs.folder import RunFolder
from t2tl_jax.runs.checkpoints import CheckpointError, Checkpoints, Which
from t2tl_jax.training.seeds import TRAINING, parse_seeds, stream_keys


def restore(folder: RunFolder, config: Config, experiment: Experiment, which: Which) -> tuple[int, Any]:
    """Iteration of the newest checkpoint and parameters of every seed, as NumPy arrays with leading axis [seeds].

    Raises:
        UserError: if there are none, or they do not fit the configuration, such as a task that the network cannot read.
    """
    keys = stream_keys(parse_seeds(config.seeds), TRAINING)
    try:
        shapes = jax.eval_shape(jax.vmap(experiment.agent.init), keys).params
    except ValueError as error:
        raise UserError(
            f"the network of {folder.path} cannot read {config.task}: {error}\n"
            "A trained network keeps the kind and the sizes that it was made with: choose a task within them, or train "
            "another run for this one."
        ) from error
    try:
        with Checkpoints(folder.checkpoints) as checkpoints:
            return checkpoints.restore_params(which, shapes)
    except CheckpointError as error:
        raise UserError(str(error)) from error
