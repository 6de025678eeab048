"""Type formulas and watch an agent carry them out: ``python -m experiments.play RUN``, one formula a line."""

import gc
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import tyro

from experiments.cli.errors import INVALID, guarded
from experiments.cli.plugins import import_modules
from t2tl_jax.errors import UserError
from t2tl_jax.flags import parse
from t2tl_jax.quiet import quiet_imports

if TYPE_CHECKING:
    from t2tl_jax.runs.prompt import Played, Prompt
    from t2tl_jax.runs.result import Result


@dataclass(frozen=True)
class Arguments:
    """Play one episode of every formula that is typed, or read line by line from a file or a pipe, with the
    deterministic policy, and print what is left to do after each step that changes it."""

    run: tyro.conf.Positional[Path]
    """Folder of the run."""
    gif: Path | None = None
    """Draw each episode in this file, in place of the previous one, with what is left to do below the picture."""
    seed: int | None = None
    """Which of the run's seeds plays; the first one by default."""
    which: Literal["final", "best"] = "final"
    """The parameters at the end of training, or those that did best in the episodes played for selection."""
    episode_length: int | None = None
    """Time limit of an episode in steps; that of the run by default."""
    plan: Literal["none", "critic"] | None = None
    """Whether the critic's value chooses among the ways that a formula leaves open; as in the run by default."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0 done, 2 if something could not be used, 130 after Ctrl-C.

    Args:
        arguments: of the command line, without the program's name; by default those of this process.
    """
    return guarded(lambda: _main(sys.argv[1:] if arguments is None else list(arguments)))


def _main(texts: list[str]) -> int:
    arguments = parse(
        Arguments, import_modules(texts), prog="python -m experiments.play", description=Arguments.__doc__
    )
    if arguments.episode_length is not None and arguments.episode_length < 1:
        raise UserError(f"--episode-length must be at least 1, got {arguments.episode_length}")
    _check_gif(arguments.gif)
    with quiet_imports():
        import experiments.configs  # noqa: F401, registers what runs are made of
        from experiments import fuller_maps
        from experiments.cli import compilation_cache
        from t2tl_jax.runs import train
        from t2tl_jax.runs.folder import open_existing
        from t2tl_jax.runs.prompt import Prompt

    _, stored = open_existing(arguments.run)
    compilation_cache.use(stored.run.compilation_cache)
    changes: dict[str, Any] = {} if arguments.plan is None else {"plan": arguments.plan}
    own = result = train.load(arguments.run, **changes)
    view = result.experiment.env.view()
    if arguments.gif is not None and view is None:
        raise UserError("--gif: the environment of this run has no view from above to draw")
    given = (arguments.seed, arguments.which, arguments.episode_length)
    prompt = _warmed_up(Prompt(result, *given), result)
    failed = False
    for text in _lines():
        try:
            if fuller_maps.lack(result, [text]):  # the formulas that follow are played on these maps, too
                maps = fuller_maps.ready(own, [text])
                print(f"note: {maps.note}", file=sys.stderr, flush=True)
                result, view = maps.result, maps.result.experiment.env.view()
                prompt = _warmed_up(Prompt(result, *given), result, " for these maps")
            played = prompt.play(text)
        except UserError as error:
            print(f"error: {error}", file=sys.stderr, flush=True)
            failed = True
            continue
        print(_story(played), flush=True)
        if arguments.gif is not None:
            _draw(played, view, arguments.gif)
    return INVALID if failed and not sys.stdin.isatty() else 0


def _check_gif(file: Path | None) -> None:
    """Refuse a picture that could not be written, before anything is compiled or played."""
    if file is None:
        return
    if file.suffix.lower() != ".gif":
        raise UserError(f"--gif is written as GIF: give a name that ends in .gif, got {file}")
    if not file.parent.is_dir():
        raise UserError(f"--gif {file}: there is no folder {file.parent}; make it, or name one that exists")


def _warmed_up(prompt: "Prompt", result: "Result", what: str = "") -> "Prompt":
    """Compile for formulas of the usual size, before one is timed, and say for what else than the run's own maps."""
    names = result.experiment.env.propositions
    print(f"compiling the programs{what} ...", end="", file=sys.stderr, flush=True)
    for _ in range(2):  # the second time nothing compiles
        prompt.play(f"F {names[0]}")
    gc.unfreeze()  # programs for other maps are not needed any more
    gc.collect()
    gc.freeze()  # what is there by now stays: looking through all of it takes longer than a formula does
    print(f" ready; formulas over {', '.join(names)}", file=sys.stderr, flush=True)
    return prompt


def _lines() -> Iterator[str]:
    """Formulas from a terminal or a pipe; empty lines and those that begin with `#` are left out."""
    if sys.stdin.isatty():
        import readline  # noqa: F401, gives the prompt its history

        given: Iterator[str] = _typed()
    else:
        given = iter(sys.stdin)
    for line in given:
        text = line.strip()
        if text and not text.startswith("#"):
            yield text


def _typed() -> Iterator[str]:
    while True:
        try:
            yield input("formula> ")
        except EOFError:
            print()
            return


def _story(played: "Played") -> str:
    """What was left to do at which step, and how it ended."""
    *steps, (last, _) = [*played.progress(), (len(played.recording.rows) - 1, "")]
    if played.recording.verdict:
        steps = steps[:-1]  # true or false, which the last line says
    note = ", programs compiled for its size first" if played.is_new_shape else ""
    return "\n".join(
        [
            *(f"{step:6}  {text}" for step, text in steps),
            f"{last:6}  {played.recording.outcome}",
            f"        (table in {played.compile_ms:.1f} ms, first action in {played.action_ms:.1f} ms{note})",
        ]
    )


def _draw(played: "Played", view: Any, target: Path) -> None:
    from t2tl_jax.evaluation.animation import captions, save_gif

    texts = [played.table.text(row) for row in range(int(played.recording.rows.max()) + 1)]
    try:
        save_gif(played.recording, view, target, captions(texts))
    except (OSError, ValueError) as error:
        raise UserError(f"cannot write {target}: {error}") from error
    print(f"        drawn: {target}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
