"""Where compiled programs are kept."""

import jax
import pytest

from experiments.cli import compilation_cache
from t2tl_jax.errors import UserError


@pytest.fixture
def chosen(monkeypatch):
    """The folder that JAX will use, read anew at each call; put back afterwards."""
    before = jax.config.jax_compilation_cache_dir
    monkeypatch.delenv("JAX_COMPILATION_CACHE_DIR")
    yield lambda: jax.config.jax_compilation_cache_dir
    jax.config.update("jax_compilation_cache_dir", before)


def test_the_folder_is_made_and_used(tmp_path, chosen):
    compilation_cache.use(str(tmp_path / "a" / "b"))
    assert chosen() == str(tmp_path / "a" / "b") and (tmp_path / "a" / "b").is_dir()


def test_the_way_of_jax_comes_first(tmp_path, chosen, monkeypatch):
    before = chosen()
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", "elsewhere")
    for folder in ("", str(tmp_path / "a")):
        compilation_cache.use(folder)
    assert chosen() == before and not list(tmp_path.iterdir())


def test_a_folder_that_cannot_be_made_is_explained(tmp_path, chosen):
    (tmp_path / "file").touch()
    with pytest.raises(UserError, match=r"cannot create .*file/a \(Not a directory\)"):
        compilation_cache.use(str(tmp_path / "file" / "a"))
