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
    found = []
    for name, run in stored.items():
        config = now[name].config if name in now else None
        if config is None:
            continue
        fields = dict.fromkeys(text.partition("=")[0] for text in differences(run.config, config))
        if different := [field for field in fields if field not in OF_THE_FOLDER]:
            found.append(f"{name} ({', '.join(f'`{field}`' for field in different)})")
    if not found:
        return ""
    return paragraph(
        "Settings that have changed since these runs were made, so that the command makes something else, which is not "
        f"measured yet: {', '.join(found)}."
    )
