"""Train a named configuration: ``python -m experiments.run --config zone_ppo``; ``--help`` lists every option."""

import sys
from collections.abc import Callable, Sequence
from typing import Any

from experiments.cli.errors import guarded
from experiments.cli.quiet import quiet_imports


def main(arguments: Sequence[str] | None = None, build: Callable[[Any], Any] | None = None) -> int:
    """Run the command and return its exit code: 0 done or stopped by the user, 2 for input that cannot be used.

    Args:
        arguments: of the command line, without the program's name; by default those of this process.
        build: from a ``Config`` to an ``t2tl_jax.runs.build.Experiment``; by default the one of that module.
    """
    return guarded(lambda: command(sys.argv[1:] if arguments is None else list(arguments), build))


def command(
    arguments: list[str],
    build: Callable[[Any], Any] | None = None,
    prefix: str = "",
    module: str = "experiments.run",
) -> int:
    """What `main` runs, also under another name: of `module`, for the configurations whose names begin with `prefix`.

    Raises:
        UserError: for input that cannot be used.
    """
    # Imported here, where Ctrl-C is caught: loading JAX and MuJoCo takes seconds.
    with quiet_imports():
        from experiments import methods
        from experiments.cli import compilation_cache
        from experiments.cli import request as command_line
        from experiments.configs import CONFIGS

    request = command_line.read_request(arguments, prefix)
    if request.show_list:
        print(command_line.list_configs(prefix))
        return 0
    words = ["python", "-m", module, *arguments]
    prog = f"python -m {module}"
    if request.resume is not None and not {"-h", "--help"} & set(request.rest):

        def amend(stored: Any) -> Any:
            config = command_line.override(stored, request.rest, prog)
            compilation_cache.use(config.run.compilation_cache)
            return config

        from t2tl_jax.runs import training_run

        return training_run.resume(request.resume, amend, build or _default_build(), words)
    name = prefix + request.config if request.config else command_line.default(prefix)
    config = CONFIGS[name][0]
    if request.method is not None:
        config, name = methods.apply(config, request.method), f"{name}_{request.method}"
    config = command_line.override(config, request.rest, prog)
    compilation_cache.use(config.run.compilation_cache)
    # Only now: plots, statistics and checkpoints take seconds to load too, which --help and mistakes need not wait for.
    from t2tl_jax.runs import training_run

    return training_run.start(config, name, build or _default_build(), words)


def _default_build() -> Callable[[Any], Any]:
    from t2tl_jax.runs.build import build

    return build


if __name__ == "__main__":
    sys.exit(main())
