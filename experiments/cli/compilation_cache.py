"""Keep compiled programs on disk between runs. Only entry points do this, never the library."""

import os
from pathlib import Path

import jax

from t2tl_jax.errors import UserError


def use(folder: str) -> None:
    """Store compiled programs in a folder; nothing happens for ``''``, or where the user chose one in JAX's own way.

    Raises:
        UserError: if the folder cannot be made.
    """
    if not folder or os.environ.get("JAX_COMPILATION_CACHE_DIR"):
        return
    path = Path(folder).expanduser()
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(
            f"cannot create {path} ({error.strerror}) for compiled programs; JAX_COMPILATION_CACHE_DIR names another "
            "folder, and --run.compilation-cache '' trains without one"
        ) from error
    jax.config.update("jax_compilation_cache_dir", str(path))
