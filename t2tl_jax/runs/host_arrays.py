"""Trees of arrays as they lie on disk: NumPy arrays, keys as their data, nothing empty, with a checksum of each."""

import json
import math
import zlib
from collections.abc import Mapping
from typing import Any

import jax
import numpy as np

from t2tl_jax.training.devices import fetched, is_key


def copied(tree: Any, count: int | None = None) -> Any:
    """A tree of arrays on the host, which nothing else writes to; the first `count` entries of leading axes, or all.

    On a CPU a plain transfer is a view of memory that the next iteration may overwrite; elsewhere it is a copy already.
    """

    def own(x: Any) -> np.ndarray:
        got = fetched(x)  # one at a time: of several processes each has all of it for a moment
        shared = not isinstance(x, jax.Array) or any(device.platform == "cpu" for device in x.devices())
        some = np.asarray(got) if count is None else np.asarray(got)[:count]
        return _storable(np.array(some, copy=True) if shared else some)

    plain = _unwrap_keys(tree)
    return jax.tree.map(own, plain)


def shapes(like: Any) -> Any:
    """The shapes and dtypes that `like` has on disk."""
    kinds = jax.eval_shape(_unwrap_keys, like)
    return jax.tree.map(lambda x: jax.ShapeDtypeStruct(x.shape if x.size else (1,), x.dtype), kinds)


def blank(shapes: Any) -> Any:
    """Zeros of these shapes and dtypes."""
    return jax.tree.map(lambda x: np.zeros(x.shape, x.dtype), shapes)


def size(shapes: Any) -> int:
    """Bytes of arrays of these shapes and dtypes."""
    return sum(math.prod(x.shape) * x.dtype.itemsize for x in jax.tree.leaves(shapes))


def as_in(like: Any, value: np.ndarray) -> Any:
    """One array from the disk as the one of `like` that it was: with its type of key, or its empty shape."""
    if is_key(like):
        return jax.random.wrap_key_data(jax.numpy.asarray(value))
    return value if like.size else np.zeros(like.shape, like.dtype)


def unpaired(wanted: Any, got: Any) -> list[str]:
    """Which arrays are there and not wanted, or the other way round."""
    want, there = _by_place(wanted), _by_place(got)
    return [f"{place} is missing" for place in want.keys() - there.keys()] + [
        f"{place} was not expected" for place in there.keys() - want.keys()
    ]


def differences(wanted: Any, got: Any) -> list[str]:
    """Which arrays have other shapes or dtypes than those wanted, in words; the same arrays must be there.

    Also says which are stored in pieces that are larger than the array itself: a small file can hold a huge piece.
    """
    there = _by_place(got)
    wrong = []
    for place, want in _by_place(wanted).items():
        kind = there[place]
        if tuple(kind.shape) != want.shape or kind.dtype != want.dtype:
            said = (f"{one.dtype}[{', '.join(map(str, one.shape))}]" for one in (kind, want))
            wrong.append("{}: {} on disk, {} expected".format(place, *said))
            continue
        pieces = getattr(getattr(kind, "storage", None), "chunk_shape", None) or ()
        if any(piece > length for piece, length in zip(pieces, want.shape, strict=False)):
            wrong.append(f"{place}: stored in pieces of {list(pieces)}, which are larger than the array")
    return wrong


def checksums(tree: Any) -> list[int]:
    """CRC-32 of every array, in the order of the tree's leaves."""
    return [zlib.crc32(np.ascontiguousarray(x).reshape(-1).view(np.uint8)) for x in jax.tree.leaves(tree)]


def checksum(info: Mapping[str, Any]) -> int:
    """CRC-32 of what a JSON object says, but for its own checksum."""
    content = {name: value for name, value in info.items() if name != "checksum"}
    return zlib.crc32(json.dumps(content, sort_keys=True).encode())


def _by_place(tree: Any) -> dict[str, Any]:
    """What has a shape in a tree by its place, which is the same whether a part is a class, a dictionary or a list."""
    leaves = jax.tree_util.tree_leaves_with_path(tree)
    return {
        jax.tree_util.keystr(path, simple=True, separator="/"): leaf for path, leaf in leaves if hasattr(leaf, "shape")
    }


def _unwrap_keys(tree: Any) -> Any:
    """Typed keys as their ``uint32`` data, which every version of Orbax can store."""
    return jax.tree.map(lambda x: jax.random.key_data(x) if is_key(x) else x, tree)


def _storable(x: np.ndarray) -> np.ndarray:
    """Orbax refuses arrays without entries, such as the observations of an environment that shows nothing."""
    return x if x.size else np.zeros(1, x.dtype)
