"""Which stored runs the command would make with other settings today."""

from collections.abc import Mapping

from experiments.reproduction.page import paragraph
from experiments.reproduction.plan import Run
from experiments.reproduction.stored import Stored
from t2tl_jax.runs.differences import differences

OF_THE_FOLDER = ("seeds", "pretrained")
"""Fields that say which folder or which seeds, not what is trained."""


def changed(stored: Mapping[str, Stored], now: Mapping[str, Run]) -> str:
    """A paragraph that names these runs and what is different; '' if nothing is.

    Args:
        stored: finished runs by name.
        now: what the command makes under the same names.
    """
    different = {name: _fields(run, now[name]) for name, run in stored.items() if name in now}
    found = []
    for name, fields in different.items():
        said = [f"`{field}`" for field in fields]
        if different.get(now[name].before or ""):
            said.append(f"those of {now[name].before}, from which it starts")
        if said:
            found.append(f"{name} ({', '.join(said)})")
    if not found:
        return ""
    return paragraph(
        "Settings that have changed since these runs were made, so that the command makes something else, which is not "
        f"measured yet: {', '.join(found)}."
    )


def _fields(run: Stored, now: Run) -> list[str]:
    """The fields of the configuration that are different, each once."""
    if now.config is None:
        return []
    fields = dict.fromkeys(text.partition("=")[0] for text in differences(run.config, now.config))
    return [field for field in fields if field not in OF_THE_FOLDER]
