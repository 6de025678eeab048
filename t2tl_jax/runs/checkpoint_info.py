"""The JSON object of a checkpoint: whether it is what was written, before anything in it is used."""

from collections.abc import Mapping
from typing import Any, TypedDict

import cattrs

from t2tl_jax.runs.config_files import strict
from t2tl_jax.runs.host_arrays import checksum

STORED = "stored"
"""The field that holds what there is to know of the arrays (`About`)."""


class Scores(TypedDict):
    """What selected parameters scored, by seed, and behind which iteration they come from."""

    iteration: list[int]
    discounted_return: list[float]
    success_rate: list[float]


class RowsSoFar(TypedDict, total=False):
    """What `Thinning` goes on with."""

    last: int
    stride: int
    count: int
    sums: dict[str, Any]


class Broken(TypedDict):
    """In which iteration a seed broke."""

    iteration: int


class Watch(TypedDict):
    """What is watched at every iteration, where rows are fewer."""

    success: dict[str, Any]
    convergence: dict[str, Any]


class About(TypedDict, total=False):
    """Checksums by item, what became of the replay, and the number of the checkpoint."""

    checksums: dict[str, list[int]]
    replay: str
    iteration: int


class Info(TypedDict, total=False):
    """The fields whose form is checked; those that are null or not there have none."""

    seeds: list[int]
    frames: int
    width: int
    best: Scores | None
    selection: Scores | None
    rows: RowsSoFar
    lessons: dict[str, Any]
    watch: Watch
    faults: dict[str, Broken]
    stored: About


_CONVERTER = strict(cattrs.Converter())


def problem(info: Any, iteration: int) -> str:
    """Why this cannot be the object of a checkpoint of that iteration; '' if it can.

    Early versions wrote no checksum, nor anything of their arrays.
    """
    if not isinstance(info, dict):
        return "it is no object"
    if "checksum" in info:
        if info["checksum"] != checksum(info):
            return "it is not what was written"
    elif STORED in info or "seeds" not in info:
        return "its checksum is missing"
    try:
        _CONVERTER.structure(info, Info)
    except cattrs.ClassValidationError as error:
        return cattrs.transform_error(error, path="info")[0]
    return _contradiction(info, iteration)


def _contradiction(info: Mapping[str, Any], iteration: int) -> str:
    rows = {"stride": 1, "count": 0, "sums": {}} | info.get("rows", {})
    if not 0 <= rows["count"] < rows["stride"] or bool(rows["count"]) != bool(rows["sums"]):
        return "its field 'rows' contradicts itself"
    if (written := info.get(STORED, {}).get("iteration", iteration)) != iteration:
        return f"it was written as that of iteration {written}"
    return ""
