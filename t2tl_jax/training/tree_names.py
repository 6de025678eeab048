"""The structure of a tree of arrays in JSON: which classes it is made of, by their names, and what they hold."""

import dataclasses
import sys
from collections.abc import Callable
from typing import Any

import jax

LEAF = "*"
"""Stands for an array."""


def described(tree: Any, leaf: Callable[[Any], str] = lambda x: LEAF) -> Any:
    """What `like` makes the structure of a tree from, in JSON; None where that is not possible.

    Trees of dictionaries with texts as keys, lists, tuples, named tuples and dataclasses can be described, if all that
    they hold is trees.

    Args:
        tree: of any arrays, or of shapes and dtypes.
        leaf: what to say of each.
    """
    try:
        found = _described(tree, leaf)
        # No field that is none of the tree's can hold the same as what stands for an array here.
        again: Any = jax.tree.structure(like(found, lambda said: object()))
    except (TypeError, KeyError, ValueError, AttributeError):  # the last two of a class that checks what it is given
        return None
    return found if again == jax.tree.structure(tree) else None


def like(description: Any, leaf: Callable[[str], Any]) -> Any:
    """A tree of the structure that was described. Nothing is imported for it.

    Args:
        description: of `described`.
        leaf: gives what to put in the place of an array, from what was said of it.

    Raises:
        TypeError: for what is no such description.
        ValueError: likewise.
        AttributeError: likewise.
        KeyError: for a class that is not loaded, or that is none of named tuples and dataclasses.
    """
    if description is None or isinstance(description, str):
        return None if description is None else leaf(description)
    kind, held = description
    if kind == "dict":
        return {name: like(one, leaf) for name, one in held}
    if kind in ("tuple", "list"):
        return (tuple if kind == "tuple" else list)(like(one, leaf) for one in held)
    return _class(kind)(**{name: like(one, leaf) for name, one in held})


def _described(tree: Any, leaf: Callable[[Any], str]) -> Any:
    if tree is None:
        return None
    if jax.tree_util.all_leaves([tree]):
        return leaf(tree)
    if type(tree) is dict:
        return ["dict", [[_text(name), _described(one, leaf)] for name, one in tree.items()]]
    if type(tree) in (tuple, list):
        return [type(tree).__name__, [_described(one, leaf) for one in tree]]
    if _has_fields(type(tree)):
        return [_name(type(tree)), [[name, _described(getattr(tree, name), leaf)] for name in _fields(type(tree))]]
    raise TypeError(f"no description of {type(tree).__name__}")


def _has_fields(kind: Any) -> bool:
    return isinstance(kind, type) and (dataclasses.is_dataclass(kind) or hasattr(kind, "_fields"))


def _fields(kind: Any) -> tuple[str, ...]:
    named = getattr(kind, "_fields", None)
    return tuple(field.name for field in dataclasses.fields(kind)) if named is None else tuple(named)


def _text(name: Any) -> str:
    if not isinstance(name, str):
        raise TypeError(f"no description of a dictionary with {name!r} as a key")
    return name


def _name(kind: type) -> str:
    return f"{kind.__module__}:{kind.__qualname__}"


def _class(name: str) -> Any:
    """A class that is loaded, by its name."""
    module, _, path = name.partition(":")
    found: Any = sys.modules[module]
    for part in path.split("."):
        found = getattr(found, part, None)
    if not _has_fields(found):
        raise KeyError(name)
    return found
