"""The JSON object of a checkpoint: whether it is what was written, before anything in it is used."""

from collections.abc import Mapping
from typing import Any

from t2tl_jax.runs.host_arrays import checksum

STORED, ITERATION, MOST_BYTES = "stored", "iteration", 2**26
"""In the object, what there is to know of the arrays; in that, the number of the checkpoint. And how large its file may
be: more would fill the memory before anything is checked."""

_SCORES = {"iteration": [int], "discounted_return": [float], "success_rate": [float]}

FORMS: Mapping[str, Any] = {
    "seeds": [int],
    "frames": int,
    "width": int,
    "best": _SCORES,
    "selection": _SCORES,
    "rows": {"last": int, "stride": int, "count": int, "sums": dict},
    "lessons": {"lessons": dict, "counts": [float]},
    "watch": {"success": dict, "convergence": dict},
    "faults": dict,
    STORED: {"checksums": dict, "replay": str, ITERATION: int},
}
"""Of what each field is, if it is there: a kind, a list of one, or an object with fields of these."""

NEEDED = {"best": _SCORES, "selection": _SCORES, "watch": ("success", "convergence")}
"""What an object must not lack, if it is there."""

NONE = ("best", "selection")
"""What may be null."""


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
    for name, form in FORMS.items():
        if name in info and not (info[name] is None and name in NONE):
            value = info[name]
            if not _fits(value, form) or any(field not in value for field in NEEDED.get(name, ())):
                return f"its field {name!r} is of another form"
    faults = info.get("faults", {}).values()
    if not all(_fits(entry, {"iteration": int}) and "iteration" in entry for entry in faults):
        return "its field 'faults' is of another form"
    rows = {"stride": 1, "count": 0, "sums": {}} | info.get("rows", {})  # as `Thinning` keeps them
    if not 0 <= rows["count"] < rows["stride"] or bool(rows["count"]) != bool(rows["sums"]):
        return "its field 'rows' contradicts itself"
    if (written := info.get(STORED, {}).get(ITERATION, iteration)) != iteration:
        return f"it was written as that of iteration {written}"
    return ""


def _fits(value: Any, form: Any) -> bool:
    if isinstance(form, list):
        return isinstance(value, list) and all(_fits(one, form[0]) for one in value)
    if isinstance(form, dict):
        return isinstance(value, dict) and all(_fits(value[name], of) for name, of in form.items() if name in value)
    return type(value) is form or (form is float and type(value) is int)
