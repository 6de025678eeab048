"""What stands where a level was not tested: that the agent cannot read such tasks, or that nothing was measured.

Parameters of most agents fit the number of colours of their own world alone: `flat` reads the whole observation by one
layer, `gated` has weights for each colour, readers of texts have a word for each, and `automaton` a letter. Merged
observations have one size, however many colours there are.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from experiments.controls import NamesConfig
from experiments.reproduction.anytask import suites
from experiments.reproduction.sections.anyfigures import figures, state_of
from experiments.reproduction.stored import Stored
from t2tl_jax.networks.merged import MergedConfig

CANNOT = "cannot read"

COLOURS = {suite.name: len(set(getattr(suite.env, "colours", ""))) for suite in suites.MORE_COLOURS}
"""How many colours there are, by level."""

PARAMETERS = "params.npz"
"""In the folder of a run whose parameters are kept."""


def cell(run: Stored, level: str) -> str:
    """For a level that a run was not tested at."""
    return CANNOT if COLOURS.get(level, 0) > _room(run) else "-"


def _room(run: Stored) -> int:
    """Of how many colours an agent can read tasks; 0 where its parameters fit its own world alone."""
    learner: Any = run.config.learner
    network = learner.network
    told: int | None = network.task_encoder.propositions_told
    return (told or 0) if isinstance(network.state, MergedConfig) else 0


def say(runs: Mapping[str, Stored], levels: Mapping[str, Sequence[str]]) -> str:
    """Why cells have no figures; '' where all have.

    Args:
        runs: agents, by what the tables call them.
        levels: tasks of every level.
    """
    played = {name: figures(run).keys() for name, run in runs.items()}
    empty = {level: [name for name, of in played.items() if not set(tasks) <= of] for level, tasks in levels.items()}
    said = []
    if any(cell(runs[name], level) == CANNOT for level, names in empty.items() for name in names):
        said.append(
            f"{CANNOT}: the agent has no way to take a task of more than four colours. Its first layer (flat), its "
            "gates (gated), and the vocabulary of a code that reads texts (or the letters of the automaton's) are made "
            "for four. Only merged observations take more, with the code `lookahead` or `roles`."
        )
    if any(cell(runs[name], level) == "-" for level, names in empty.items() for name in names):
        said.append("Where `-` stands, nothing was measured.")
    exchanged = [name for name in empty.get(suites.EXCHANGED.name, []) if _reads_texts(runs[name])]
    if exchanged:
        unkept = not any((runs[name].path / PARAMETERS).is_file() for name in exchanged)
        why = ": parameters of these agents are not stored, and it would take training them again" if unkept else ""
        whom = ", ".join(f"{name} ({state_of(runs[name])})" for name in exchanged)
        said.append(
            f"Of codes that depend on the text, the control with exchanged texts was not played for {whom}{why}. The "
            "other codes read no text, so that it would change nothing for them."
        )
    return " ".join(said)


def _reads_texts(run: Stored) -> bool:
    """Whether the code of a row depends on its text."""
    learner: Any = run.config.learner
    encoder = learner.network.task_encoder
    return bool(encoder.reads_tokens) or isinstance(encoder, NamesConfig)
