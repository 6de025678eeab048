"""What a command line of ``python -m experiments.sweep`` asks for."""

import argparse
import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from experiments.sweeps.cluster import ENGINES, Cluster
from t2tl_jax.errors import UserError
from t2tl_jax.quiet import quiet_imports

PROG = "python -m experiments.sweep"

MOST_DIGITS = 18
"""Of a number that can be meant."""


@dataclass(frozen=True)
class Plan:
    """What a command line asks for."""

    name: str
    """Of the configuration."""
    config: Any
    """The configuration that all points start from; its seeds are those of all points."""
    asked: Any
    """The flags that chose it (`request.Request`)."""
    rest: Sequence[str]
    """The words of the command but for those of the sweep itself."""
    base: Path
    """Where the runs lie."""
    axes: Sequence[Any]
    """Of the grid (`grid.Axis`)."""
    points: Sequence[Any]
    """Those of the grid (`grid.Point`), in order."""
    trials: int
    """Of a search; 0 for a grid."""
    space: Sequence[Any]
    """What a search varies (`space.Dimension`)."""
    batch: int
    """Trials that are proposed at a time."""
    search_seed: int
    """Of the proposals."""
    words: Sequence[str]
    """The command line, but for what hands it to other processes."""
    only: Sequence[int] | None
    """The numbers of the points to train; None for all of them, with the table."""
    cluster: Cluster | None
    """Who trains them instead of this process."""


SEVERAL = ("--grid", "--space", "--cluster-option")
"""Flags after which several values may stand."""


def one_each(texts: Sequence[str]) -> list[str]:
    """The same words with one value for each of `SEVERAL`: ``--grid A B`` becomes ``--grid=A --grid=B``.

    By hand, since `argparse` would take words such as ``--task=!Red U Black``, which have spaces, for more values.
    """
    words: list[str] = []
    flag, bare = "", False  # whose values may follow, and whether none did so far
    for text in texts:
        name, equals, value = text.partition("=")
        if not text.startswith("--") and flag:
            words.append(f"{flag}={text}")
            bare = False
            continue
        if bare:
            words.append(flag)
        flag, bare = (name, not equals) if name in SEVERAL else ("", False)
        if not bare:
            words.append(f"{name}={value}" if flag else text)
    return [*words, flag] if bare else words


@dataclass(frozen=True)
class CommandLine:
    """A command line, taken apart."""

    own: argparse.Namespace
    """The flags of a grid or a search."""
    handed: argparse.Namespace
    """Those that hand it to other processes."""
    words: Sequence[str]
    """All but the latter."""
    rest: Sequence[str]
    """All but both."""


def split(texts: Sequence[str]) -> CommandLine:
    """Take a command line apart, for which nothing has to be loaded.

    Raises:
        UserError: for what these flags do not take.
    """
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False, exit_on_error=False)
    parser.add_argument("--grid", action="append", default=[])
    parser.add_argument("--space", action="append", default=[])
    parser.add_argument("--search", nargs="+")
    parser.add_argument("--batch", type=int, default=8)
    parser.add_argument("--search-seed", type=int, default=0)
    parser.add_argument("--folder", type=Path)
    jobs = argparse.ArgumentParser(add_help=False, allow_abbrev=False, exit_on_error=False)
    jobs.add_argument("--workers", type=int)
    jobs.add_argument("--cluster", choices=ENGINES)
    jobs.add_argument("--cluster-option", action="append", default=[])
    jobs.add_argument("--only")
    try:
        handed, words = jobs.parse_known_args(one_each(texts))
        own, rest = parser.parse_known_args(words)
    except argparse.ArgumentError as error:
        raise UserError(f"{error}; see --help") from error
    return CommandLine(own, handed, words, rest)


def read(given: CommandLine) -> Plan:
    """What the command line asks for.

    Raises:
        UserError: for anything that cannot be used.
    """
    own, handed, words, rest = given.own, given.handed, given.words, given.rest
    with quiet_imports():
        from experiments import tuning
        from experiments.cli import grid, request
        from experiments.sweeps import space

    searches = own.search is not None
    trials = _trials(own.search) if searches else 0
    if own.grid if searches else own.space:
        raise UserError("give --grid alone for a grid, or both --search TRIALS and --space FIELD=RANGE for a search")
    for flag, number, least in (
        ("batch", own.batch, 1),
        ("search-seed", own.search_seed, 0),
        ("workers", handed.workers, 1),
    ):
        if number is not None and number < least:
            raise UserError(f"--{flag} takes a whole number from {least} on, got {number}")
    asked = request.read(rest)
    if asked.show_list:
        raise UserError("a sweep has no --list: python -m experiments.run --list shows all names")
    if asked.resume is not None:
        raise UserError("a sweep has no --resume: give the same command again to continue after an interruption")
    if not (own.space if searches else own.grid):
        wanted = "--space FIELD=RANGE" if searches else "--grid FIELD=VALUE,VALUE"
        raise UserError(f"a sweep takes --config NAME and at least one {wanted}; see {PROG} --help")
    config, name = request.configuration(asked, "", PROG)
    if searches:
        config = dataclasses.replace(config, seeds=tuning.for_search(config.seeds))
    base = own.folder or Path(config.run.folder) / f"{name}_{'search' if searches else 'sweep'}"
    axes = grid.read_axes(own.grid)
    dimensions = space.check(space.read(own.space), config.seeds, asked, PROG) if searches else ()
    points = () if searches else grid.points(axes, asked, PROG)
    return Plan(
        *(name, config, asked, rest, base.expanduser(), axes, points, trials, dimensions),
        batch=own.batch,
        search_seed=own.search_seed,
        words=words,
        only=None if handed.only is None else _numbers(handed.only, trials or len(points)),
        cluster=_cluster(handed),
    )


def _trials(words: Sequence[str]) -> int:
    """What ``--search`` says: 64, or ``64 trials``; UserError for anything else."""
    number, *unit = " ".join(words).split() or [""]
    if not _is_number(number) or int(number) < 1 or unit not in ([], ["trial"], ["trials"]):
        raise UserError(f"--search takes how many trials, a whole number from 1 on, got {' '.join(words)[:80]!r}")
    return int(number)


def _numbers(text: str, count: int) -> list[int]:
    """What ``--only`` says; UserError for what is no list of points."""
    parts = [part.strip() for part in text.split(",")]
    if not all(_is_number(part) and int(part) < count for part in parts):
        raise UserError(f"--only takes numbers of points from 0 to {count - 1}, such as 0,2, got {text[:80]!r}")
    return sorted({int(part) for part in parts})


def _is_number(text: str) -> bool:
    """Whether a text is a whole number in the digits 0 to 9, of so few that it can be meant."""
    return text.isascii() and text.isdecimal() and len(text) <= MOST_DIGITS


def _cluster(handed: argparse.Namespace) -> Cluster | None:
    """What ``--workers`` and ``--cluster`` say; UserError for what does not go together."""
    if handed.workers is None:
        if handed.cluster or handed.cluster_option:
            raise UserError("--cluster and --cluster-option belong to --workers NUMBER: how many jobs at a time")
        return None
    if handed.only is not None:
        raise UserError("--only trains in this process, as a job does; leave --workers out")
    options: dict[str, int | str] = {}
    for text in handed.cluster_option:
        name, equals, value = text.partition("=")
        if not (name and equals and value):
            raise UserError(f"--cluster-option takes NAME=VALUE, such as timeout-min=600, got {text!r}")
        options[name.replace("-", "_")] = int(value) if _is_number(value) else value
    if not isinstance(gpus := options.get("gpus_per_node", 0), int):
        raise UserError(f"--cluster-option gpus-per-node takes a whole number, such as gpus-per-node=1, got {gpus!r}")
    engine = handed.cluster or "local"
    if engine == "slurm" and "timeout_min" not in options:
        raise UserError("a SLURM job has a time limit; give it with --cluster-option timeout-min=600 (minutes)")
    return Cluster(handed.workers, engine, options)
