"""What has a name: environments, task encoders, learners and configurations; families of tasks are in `t2tl_jax.ltl`.

Names are for command lines and for stored configurations. What the project ships is registered by the same functions
as what a user brings along. A package that declares an entry point in the group ``t2tl_jax.plugins`` is found by
itself; other modules are imported by the program that uses them, which on the command line has a flag for that.
"""

import importlib.util
import sys
import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, is_dataclass
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Generic, TypeVar

from t2tl_jax.errors import NotRegistered, UserError, unknown
from t2tl_jax.quiet import quiet_imports

T = TypeVar("T")

PLUGINS = "t2tl_jax.plugins"
"""Group of entry points, each a module that registers something when it is imported."""

OWN = ("t2tl_jax.agents", "t2tl_jax.single_state", "t2tl_jax.runs.given_env")
"""Modules of the library itself that register something: learners with their task encoders, and environments."""


@dataclass(frozen=True)
class Kind(Generic[T]):
    """One registered kind of thing."""

    config: type
    """The dataclass that describes it."""
    make: Callable[..., T]
    """From an instance of that dataclass (and what else the registry's things are made of) to the thing."""


class Registry(Generic[T]):
    """Kinds of one thing by name."""

    def __init__(self, thing: str, function: str) -> None:
        """`thing` and `function` say in messages what is registered, and by which function."""
        self.thing, self._function = thing, function
        self._kinds: dict[str, Kind[T]] = {}

    def register(self, name: str, config: type, make: Callable[..., T]) -> None:
        """Add a kind.

        Raises:
            ValueError: for a name or a class that is taken by another kind, or a class that is no frozen dataclass.
        """
        if not is_dataclass(config) or not config.__dataclass_params__.frozen:  # type: ignore[attr-defined]
            raise ValueError(f"{self.thing} {name!r} needs a frozen dataclass for its configuration, got {config!r}")
        for other, kind in self._kinds.items():
            if (other == name) != (kind.config is config):
                raise ValueError(
                    f"cannot register the {self.thing} {name!r} with {config.__qualname__}: {other!r} is registered "
                    f"with {kind.config.__qualname__}; choose another name, and one class for each"
                )
        self._kinds[name] = Kind(config, make)

    def names(self) -> tuple[str, ...]:
        """All names, in the order of registration."""
        load_plugins()
        return tuple(self._kinds)

    def classes(self) -> tuple[type, ...]:
        """All classes of configurations."""
        load_plugins()
        return tuple(kind.config for kind in self._kinds.values())

    def config_class(self, name: str) -> type:
        """The class of configurations with this name.

        Raises:
            NotRegistered: for an unknown name, with the nearest.
        """
        if name not in self._kinds:
            load_own()
        if name not in self._kinds:
            load_plugins()
        if name not in self._kinds:
            raise _not_registered(self.thing, name, self._kinds)
        return self._kinds[name].config

    def name_of(self, config: Any) -> str:
        """The name under which the class of `config` is registered.

        Raises:
            UserError: if it is not.
        """
        return self._find(config)[0]

    def maker(self, config: Any) -> Callable[..., T]:
        """The function that makes what `config` describes; UserError if its class is not registered."""
        return self._find(config)[1].make

    def makers(self) -> dict[type, Callable[..., T]]:
        """By the class of their configuration, of what is registered by now."""
        return {kind.config: kind.make for kind in self._kinds.values()}

    def _find(self, config: Any) -> tuple[str, Kind[T]]:
        for name, kind in self._kinds.items():
            if kind.config is type(config):
                return name, kind
        raise UserError(
            f"{type(config).__qualname__} is not the configuration of a registered {self.thing}; "
            f"register it with {self._function}(name, {type(config).__name__}, make)"
        )


ENVS: Registry = Registry("environment", "register_env")
TASK_ENCODERS: Registry = Registry("task encoder", "register_task_encoder")
TASK_FAMILIES: Registry = Registry("task sampler", "register_task_family")
STATE_ENCODERS: Registry = Registry("state encoder", "register_state_encoder")
CONTEXT_READERS: Registry = Registry("context reader", "register_context_reader")
AGENTS: Registry = Registry("learner", "register_agent")

_CONFIGS: dict[str, tuple[Any, str]] = {}
_NAMED_ENVS: dict[str, Any] = {}


def register_env(name: str, config: type, make: Callable[..., Any], named: Mapping[str, Any] | None = None) -> None:
    """Register an environment: ``make(config)`` gives a `LabelledEnv`.

    Args:
        name: what stored configurations and the command line call it.
        config: a frozen dataclass derived from `EnvConfig`, whose fields are stored and become options.
        make: from an instance of it to the environment.
        named: instances of the configuration with names of their own, such as published ones.

    Raises:
        ValueError: if the name or the class is taken.
    """
    ENVS.register(name, config, make)
    for key, value in (named or {}).items():
        if key in _NAMED_ENVS and _NAMED_ENVS[key] != value:
            raise ValueError(f"another environment is registered as {key!r}; choose another name")
        _NAMED_ENVS[key] = value


def register_task_encoder(name: str, config: type, make: Callable[..., Any]) -> None:
    """Register a task encoder: ``make(config)`` gives a Flax module from `TaskTable` to float32[rows, code_size].

    Args:
        name: what stored configurations and the command line call it.
        config: a frozen dataclass derived from `TaskEncoderConfig`.
        make: from an instance of it to the module.

    Raises:
        ValueError: if the name or the class is taken.
    """
    TASK_ENCODERS.register(name, config, make)


def register_task_family(name: str, config: type) -> None:
    """Register a kind of families of tasks that are data.

    Args:
        name: what stored configurations and ``--task NAME`` call it.
        config: a frozen dataclass derived from `t2tl_jax.ltl.TaskFamily`, which draws tasks by itself.

    Raises:
        ValueError: if the name or the class is taken.
    """
    TASK_FAMILIES.register(name, config, lambda family: family)


def register_state_encoder(name: str, config: type, make: Callable[..., Any]) -> None:
    """Register a state encoder: ``make(config, objects, reader, squash)`` gives a Flax module.

    Its call takes observations [..., O] and codes of tasks [..., dim], and gives features [..., D]. `objects` is what
    the environment says about its observation or None, `reader` the task encoder's configuration, and `squash` what the
    network does to the numbers of observations, one by one.

    Args:
        name: what stored configurations and ``--learner.network.state NAME`` call it.
        config: a frozen dataclass derived from `StateEncoderConfig`.
        make: from an instance of it and these to the module.

    Raises:
        ValueError: if the name or the class is taken.
    """
    STATE_ENCODERS.register(name, config, make)


def register_context_reader(name: str, config: type, make: Callable[..., Any]) -> None:
    """Register a reader of context windows: ``make(config)`` gives a Flax module.

    Its call takes tokens [B, K, width], oldest first, and which of them are steps of the episode, bool[B, K]; it gives
    [B, output].

    Args:
        name: what stored configurations and ``--learner.network.context.reader NAME`` call it.
        config: a frozen dataclass derived from `SequenceEncoderConfig`.
        make: from an instance of it to the module.

    Raises:
        ValueError: if the name or the class is taken.
    """
    CONTEXT_READERS.register(name, config, make)


def register_agent(name: str, config: type, make: Callable[..., Any]) -> None:
    """Register a learner: ``make(task_env, config, episode_length, iterations)`` gives an `Agent`.

    Args:
        name: what stored configurations and the command line call it.
        config: a frozen dataclass derived from `LearnerConfig`, which owns the network's configuration.
        make: from the environment, an instance of it, the time limit in steps and the length of the run in iterations.

    Raises:
        ValueError: if the name or the class is taken.
    """
    AGENTS.register(name, config, make)


def register_config(name: str, config: Any, summary: str = "") -> None:
    """Register a named configuration, a `Config`, with one line about it for lists.

    Raises:
        ValueError: if the name belongs to another configuration.
    """
    if name in _CONFIGS and _CONFIGS[name] != (config, summary):
        raise ValueError(f"another configuration is registered as {name!r}; choose another name")
    _CONFIGS[name] = (config, summary)


def configs() -> dict[str, tuple[Any, str]]:
    """Every named configuration and the line about it."""
    load_plugins()
    return dict(_CONFIGS)


def named_config(name: str) -> Any:
    """The configuration with this name.

    Raises:
        NotRegistered: for an unknown name, with the nearest.
    """
    if name not in _CONFIGS:
        load_plugins()
    if name not in _CONFIGS:
        raise _not_registered("config", name, _CONFIGS)
    return _CONFIGS[name][0]


def make_env(name_or_config: Any) -> Any:
    """Build an environment from its configuration, from the name of one, or from the name of its kind.

    Raises:
        NotRegistered: for an unknown name, with the nearest.
        UserError: for a configuration of a class that is not registered.
    """
    if not isinstance(name_or_config, str):
        return ENVS.maker(name_or_config)(name_or_config)
    named = {name: ENVS.config_class(name)() for name in ENVS.names()} | _NAMED_ENVS
    if name_or_config not in named:
        raise _not_registered("environment", name_or_config, named)
    return make_env(named[name_or_config])


def env_names() -> tuple[str, ...]:
    """The names of single environments, such as ``Zones-25-v1``."""
    load_plugins()
    return tuple(_NAMED_ENVS)


PROJECT = ("t2tl_jax", "envs", "experiments")
"""The packages of this project."""

_loaded: set[str] = set()
_missing: dict[str, str] = {}
"""Plugins that cannot be imported, and why."""


def load_own() -> None:
    """Import what the library itself registers."""
    for module in OWN:
        import_module(module)


def load_plugins() -> None:
    """Import what the library registers and, once, what packages declare as plugins; warn of one that is not there."""
    load_own()
    for plugin in _plugins(tuple(sys.path)):
        if plugin.value in _loaded:
            continue
        _loaded.add(plugin.value)
        try:
            with quiet_imports():
                plugin.load()
        except Exception as error:  # whatever a foreign module raises; the rest goes on without it
            _missing[plugin.value] = _why_missing(plugin, error)
            warnings.warn(_missing[plugin.value], stacklevel=2)


def plugins_of_others() -> bool:
    """Whether plugins of other packages than this project's have been loaded."""
    return not all(value.partition(".")[0] in PROJECT for value in _loaded)


def others_declare_plugins() -> bool:
    """Whether packages other than this project's declare plugins, which will be loaded sooner or later."""
    return not all(plugin.value.partition(".")[0] in PROJECT for plugin in _plugins(tuple(sys.path)))


@cache
def _plugins(path: tuple[str, ...]) -> tuple[EntryPoint, ...]:
    """What packages on this path declare, read once: there may be hundreds of packages."""
    del path  # `sys.path`, where `entry_points` looks
    return tuple(entry_points(group=PLUGINS))


def _why_missing(plugin: EntryPoint, error: Exception) -> str:
    """What is wrong with a plugin, and the way out."""
    text = f"the plugin {plugin.name} = {plugin.value} cannot be imported, so its names are missing: {error}"
    package = plugin.value.partition(".")[0]
    if not isinstance(error, ModuleNotFoundError) or error.name not in (package, plugin.value):
        return text
    spec = importlib.util.find_spec(package)
    if spec is None:
        return f"{text}; install the package that declares it again"
    places = [spec.origin] if spec.origin else list(spec.submodule_search_locations or [])
    return (
        f"{text}; here {package} is {', '.join(places)}: start Python in a folder without one of that name, or put the "
        "plugin's own place first on the path (PYTHONPATH)"
    )


def _not_registered(thing: str, name: str, known: Iterable[str]) -> NotRegistered:
    """The error for an unknown name, with what may be the reason."""
    reasons = list(_missing.values())
    if not _plugins(tuple(sys.path)):
        reasons = [
            "no plugin is installed, and named environments and configurations come from plugins: install this project "
            "with pip, or import experiments.configs"
        ]
    hint = f"One of your own {thing}s is known once its module is imported."
    return NotRegistered("\n".join([str(unknown(thing, name, known)), *reasons, hint]))
