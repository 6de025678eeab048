"""How well the agents do whose parameters are kept: one seed of a run, which need not be a good one."""

from collections.abc import Mapping

from experiments.reproduction.page import paragraph
from experiments.reproduction.stored import Stored
from t2tl_jax.evaluation.statistics import SOLVED
from t2tl_jax.runs import params_file
from t2tl_jax.runs.folder import RunFolder

WORDS = """The seed that is kept is the first one, whatever it came to. With its final parameters, sampled, it succeeds
in this share of the stored evaluation's episodes: {each}. {solved} of these {count} agents solve their task, which
takes more than {bar:g}. Those that are kept in half precision were played before that, and not again."""


def kept_agents(runs: Mapping[str, Stored]) -> str:
    """Success of every agent of the paper's items whose parameters are kept, in words."""
    found = {}
    for name, run in runs.items():
        if RunFolder(run.path).params.is_file():
            (seed,) = params_file.seeds(RunFolder(run.path).params)
            found[f"{name} (seed {seed})"] = run.by_seed("success_rate")[seed]
    each = ", ".join(f"{name} {share:.3f}" for name, share in found.items())
    return paragraph(
        WORDS.format(each=each, solved=sum(x > SOLVED for x in found.values()), count=len(found), bar=SOLVED)
    )
