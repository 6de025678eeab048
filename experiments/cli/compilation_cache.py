"""Keep compiled and traced programs on disk between runs. Only entry points do this, never the library."""

import os
from pathlib import Path

import jax

from experiments.cli import plugins
from t2tl_jax.errors import UserError
from t2tl_jax.runs import kept_traces


def use(folder: str) -> None:
    """Keep compiled and traced programs in a folder, or where the user chose one for compiled ones in JAX's own way;
    for ``''`` nothing is kept, but what that way asks for.

    Raises:
        UserError: if the folder cannot be made.
    """
    chosen = os.environ.get("JAX_COMPILATION_CACHE_DIR")
    _keep_traces(None)
    if not folder:
        return
    if chosen:
        _keep_traces(None if "://" in chosen else Path(chosen))
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
    _keep_traces(path)


def _keep_traces(folder: Path | None) -> None:
    """Not where modules of the user's were imported, which may change what is traced."""
    kept_traces.use(None if plugins.imported else folder)
