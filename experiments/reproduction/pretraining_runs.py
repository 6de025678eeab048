"""The runs that pre-train the encoders of others."""

from dataclasses import replace

from experiments.reproduction.plan import Run
from t2tl_jax.networks.rgcn import RGCNConfig
from t2tl_jax.networks.transformer import TransformerConfig
from t2tl_jax.registry import ENVS
from t2tl_jax.runs import pretraining
from t2tl_jax.runs.config import Config


def pretraining_run(
    runs: dict[str, Run], world: str, config: Config, kind: str = "own", new: dict[str, Run] | None = None
) -> str | None:
    """The name of the run that pre-trains the configuration's encoder, which is added to `new` unless it is known."""
    encoder, new = config.learner.task_encoder, runs if new is None else new
    if encoder is None or not encoder.learned:
        return None
    reader = {TransformerConfig: "transformer", RGCNConfig: "gnn"}[type(encoder)]
    name = f"{world}-pretraining-{reader}" + ("" if kind == "own" else f"-{kind}")
    if name not in runs and name not in new:
        wanted = replace(config, pretrained="auto:own" if kind == "own" else "auto")
        before = pretraining.matching(wanted, ENVS.maker(config.env)(config.env))
        new[name] = Run(before, evaluated=False)
    return name
