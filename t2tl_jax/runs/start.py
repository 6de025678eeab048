"""What a training began with: not stored with it, but a function of its seeds and of the pre-training that is."""

import warnings
from dataclasses import dataclass

import jax

from t2tl_jax.errors import Note, UserError, explained
from t2tl_jax.runs import pretraining
from t2tl_jax.runs.result import Result
from t2tl_jax.runs.train import load
from t2tl_jax.training import transfer
from t2tl_jax.training.program import OVER_SEEDS
from t2tl_jax.training.seeds import TRAINING, stream_keys
from t2tl_jax.training.types import Params


@dataclass(frozen=True)
class Start:
    """The parameters before the first iteration."""

    params: Params
    """Of all seeds, NumPy arrays with leading axis [seeds]."""
    origin: str
    """Where they come from, in words."""
    problem: str = ""
    """Why the pre-trained encoder is not among them although the run had one; empty if all is well."""


def start_params(result: Result) -> Start:
    """The parameters that a run began with: drawn again from its seeds, with the pre-trained encoder put in.

    A pre-training that cannot be read (moved, or never kept) leaves the encoder as it was drawn; `problem` says so.
    One that lies elsewhere, in the folder that the run's configuration names, is read there, and a `Note` says so.
    """
    experiment, config = result.experiment, result.config
    init = jax.vmap(lambda key, env_params: experiment.agent.init(key, env_params).params, (0, OVER_SEEDS))
    fresh = jax.device_get(jax.jit(init)(stream_keys(result.seeds, TRAINING), experiment.env_params("evaluation")))
    if not config.pretrained:
        return Start(fresh, "new network")
    try:
        with explained():
            encoder = jax.device_get(_encoder(result))
    except UserError as error:
        return Start(fresh, "new network, before the pre-trained encoder", str(error))
    return Start({**fresh, "params": {**fresh["params"], transfer.PART: encoder}}, "pre-trained encoder")


def _encoder(result: Result) -> Params:
    """The pre-trained encoder of every seed."""
    place = result.config.pretrained
    if pretraining.is_auto(result.config):
        if result.folder is None:
            raise UserError("the run is not kept on disk, nor is its pre-training")
        place = str(result.folder / pretraining.FOLDER)
    else:
        warnings.warn(f"the encoder of the start is read from {place}, which the run names", Note, stacklevel=2)
    return pretraining.encoder(result.experiment, load(place))
