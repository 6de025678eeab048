"""Configurations that an earlier version stored, in the words of this one: runs and results of then stay readable."""

from typing import Any

from t2tl_jax.old_names import ENCODERS, FIELDS, LEARNER_FIELDS

VERSION = 3
"""Of the stored configuration. The first one had no number, a network beside the learner, and one field a learner. The
second one had no `selection`, and its training state held the best parameters. Early ones of the third have no
`map_period`."""


def migrated(data: Any) -> Any:
    """The JSON object of a configuration as this version writes it, without its version; others as they are."""
    if not isinstance(data, dict):
        return data
    data = dict(data)
    version = data.pop("version", 1)
    if version not in range(1, VERSION + 1):
        raise ValueError(f"the configuration was stored by a newer version of t2tl_jax (format {version})")
    # Before there was the field, every run kept its first maps; one that is resumed still does.
    return {"map_period": 0, **_with_reader(_from_first(data) if version == 1 else data)}


def _with_reader(data: Any, path: tuple[str, ...] = ("learner", "network", "context")) -> Any:
    """The context had a Transformer before it had a reader of some kind; `path` leads to it."""
    if not isinstance(data, dict):
        return data
    if path:
        name, *rest = path
        return {**data, name: _with_reader(data[name], tuple(rest))} if name in data else data
    reader = data.get("transformer")
    others = {name: value for name, value in data.items() if name != "transformer"}
    return {**others, "reader": {"kind": "transformer", **reader}} if isinstance(reader, dict) else data


def _from_first(data: dict[str, Any]) -> dict[str, Any]:
    data["env"] = {"kind": "zones", **data.get("env", {})}  # where no kind was named, the first one was meant
    data = {FIELDS.get(name, name): value for name, value in data.items()}
    learners = {kind: data.pop(kind, None) for kind in LEARNER_FIELDS}
    kind = "dqn" if learners["dqn"] else "ppo"
    learner = {LEARNER_FIELDS[kind].get(name, name): value for name, value in (learners[kind] or {}).items()}
    network = {name: value for name, value in data.pop("network", {}).items() if name != "kind"}
    reader = network.pop("task_encoder", "transformer")
    size = network.pop("one_hot_size", 16)
    sizes = {name: network.pop(name, None) for name in ENCODERS}
    encoder = {"size": size} if reader == "one_hot" else dict(sizes.get(reader) or {})
    network["task_encoder"] = {"kind": reader, **encoder}
    if network.get("context"):
        # Before there was the field, each sample was read with a window of its own.
        network["context"] = {"segment_length": 1, **network["context"]}
    data["learner"] = {"kind": kind, "network": network, **learner}
    return data
