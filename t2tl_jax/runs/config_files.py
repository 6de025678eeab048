"""A configuration as JSON and back. Only the fields of the dataclasses are accepted, so a file cannot run code."""

import json
from functools import partial
from pathlib import Path
from typing import Any

import cattrs

from envs.registry import EnvConfig
from envs.single_state import SingleStateConfig
from envs.waterworld import WaterWorldConfig
from envs.zones import ZoneConfig
from experiments.configs import Config
from t2tl_jax.errors import UserError
from t2tl_jax.names import nearest
from t2tl_jax.networks.actor_critic import NetworkConfig
from t2tl_jax.networks.q_network import QNetworkConfig

KIND = "kind"
"""Field of the JSON that says which of several dataclasses an object is."""

UNIONS: dict[Any, dict[str, type]] = {
    EnvConfig: {"zones": ZoneConfig, "waterworld": WaterWorldConfig, "single_state": SingleStateConfig},
    NetworkConfig | QNetworkConfig: {"actor_critic": NetworkConfig, "action_values": QNetworkConfig},
}
"""Fields of ``Config`` that may be of several dataclasses. The first one is meant where no kind is named."""


def _converter() -> cattrs.Converter:
    converter = cattrs.Converter(forbid_extra_keys=True)
    # cattrs would turn the text "false" into True and 0.5 into 0.
    for kind in (bool, int, str):
        converter.register_structure_hook(kind, _exactly)
    converter.register_structure_hook(float, _number)
    for union, kinds in UNIONS.items():
        converter.register_structure_hook(union, partial(_of_a_kind, converter, kinds))
        converter.register_unstructure_hook(union, partial(_with_its_kind, converter, kinds))
    return converter


def to_json(config: Config) -> str:
    """The configuration with every field, as indented JSON."""
    return json.dumps(_converter().unstructure(config), indent=2, ensure_ascii=False) + "\n"


def from_json(text: str, source: str) -> Config:
    """Read a configuration.

    Args:
        text: JSON, as written by ``to_json``.
        source: what to call it in messages.

    Raises:
        UserError: for text that is not JSON, unknown fields (from another version, say) and unsuitable values.
    """
    try:
        data = json.loads(text)
    except ValueError as error:
        raise UserError(f"{source} is not valid JSON: {error}") from error
    _as_it_was(data)
    try:
        return _converter().structure(data, Config)
    except Exception as error:  # cattrs groups whatever the dataclasses raise
        problems = [_readable(line) for line in cattrs.transform_error(error, path="config", format_exception=_explain)]
        raise UserError(
            f"{source} does not fit this version:\n  "
            + "\n  ".join(problems[:8])
            + "\nUse the version that is named in the run's versions.json, or edit the file."
        ) from error


def load(path: Path) -> Config:
    """Read a configuration from a file; raises ``UserError`` as ``from_json`` does, and for a missing file."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"cannot read {path}: {error}") from error
    return from_json(text, str(path))


def _as_it_was(data: Any) -> None:
    """Fill in what a run did before there was a field for it, where the default is something else now."""
    network = data.get("network") if isinstance(data, dict) else None
    context = network.get("context") if isinstance(network, dict) else None
    if isinstance(context, dict):
        context.setdefault("segment_length", 1)


def _exactly(value: Any, kind: type) -> Any:
    if type(value) is not kind:
        raise TypeError(f"expected {kind.__name__}, got {value!r}")
    return value


def _number(value: Any, kind: type) -> float:
    if type(value) not in (int, float):
        raise TypeError(f"expected a number, got {value!r}")
    return float(value)


def _of_a_kind(converter: cattrs.Converter, kinds: dict[str, type], value: Any, union: Any) -> Any:
    fields = dict(value) if isinstance(value, dict) else value
    kind = fields.pop(KIND, next(iter(kinds))) if isinstance(value, dict) else next(iter(kinds))
    if kind not in kinds:
        raise ValueError(f"unknown {KIND} {kind!r}, known: {', '.join(kinds)}")
    return converter.structure(fields, kinds[kind])


def _with_its_kind(converter: cattrs.Converter, kinds: dict[str, type], value: Any) -> dict[str, Any]:
    (kind,) = (name for name, one in kinds.items() if type(value) is one)
    return {KIND: kind, **converter.unstructure(value)}


def _explain(error: BaseException, kind: type | None) -> str:
    if isinstance(error, cattrs.ForbiddenExtraKeysError):
        known = [field.name for field in error.cl.__dataclass_fields__.values()]  # type: ignore[attr-defined]
        return "; ".join(
            f"unknown field {name!r}, nearest known {nearest(name, known)!r}" for name in sorted(error.extra_fields)
        )
    if isinstance(error, ValueError | TypeError):
        return str(error)
    return cattrs.v.format_exception(error, kind)


def _readable(problem: str) -> str:
    """cattrs ends each problem with `` @ config.ppo``; put the place first."""
    text, _, place = problem.rpartition(" @ ")
    return f"{place}: {text}"
