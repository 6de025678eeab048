"""``--import MODULE``: a user's own modules, which register what configurations and stored runs are made of."""

import importlib
from collections.abc import Sequence

from t2tl_jax.errors import UserError

FLAG = "--import"

imported: list[str] = []
"""What was imported by that flag."""


def import_modules(arguments: Sequence[str]) -> list[str]:
    """Import every module that the arguments name, and return the other arguments.

    Raises:
        UserError: for a module that is not there.
    """
    rest, words = [], iter(arguments)
    for word in words:
        name, equals, module = word.partition("=")
        if name != FLAG:
            rest.append(word)
            continue
        module = module if equals else next(words, "")
        try:
            importlib.import_module(module)
            imported.append(module)
        except (ImportError, ValueError) as error:
            inside = isinstance(error, ImportError) and error.name not in (module, module.partition(".")[0])
            if inside:
                raise UserError(f"{FLAG} {module}: it cannot be imported: {error}") from error
            raise UserError(
                f"{FLAG} {module}: {error or 'name a module'}; it is looked for in this folder and where packages are"
            ) from error
    return rest
