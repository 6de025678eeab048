"""The paper, measured again, and agents for any task: ``python -m experiments.reproduce``; every table and figure, or
some of them (``--only paper``, ``--only any``, items, runs).

Runs that are done are kept, and runs that were cut go on, so the same command may be given again and again. Several
processes may work on the same folder: each takes runs that no other one has taken. ``--workers`` starts them.
"""

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from experiments.cli.errors import guarded
from t2tl_jax.errors import UserError, did_you_mean, explained
from t2tl_jax.flags import parse
from t2tl_jax.quiet import quiet_imports

STARTED = time.monotonic()

ROOT = Path(__file__).parents[1]
SHARED = ("only", "scale", "seeds", "folder")
"""Arguments that workers are given as they are."""
RESULTS = ROOT / "results" / "paper"
"""Where finished runs of full scale are kept, in the repository."""
ANY_RESULTS = ROOT / "results" / "any"
"""The same of agents for any task."""


@dataclass(frozen=True)
class Arguments:
    """Train what the paper's tables and figures need, and write them beside the published values. Finished runs are
    kept; give the same command again to continue with the others."""

    only: str = ""
    """Items, or single runs of them, separated by commas: 'paper' for all items of the paper, 'any' for all items on
    agents for any task. By default both; --list True shows them."""
    scale: Literal["smoke", "full"] = "full"
    """full: 12 seeds (unless a run says otherwise) and the paper's budgets where it gives one, for GPUs. smoke: every
    item with tiny networks and budgets on a CPU, to check that everything runs; its figures mean nothing, and say
    so."""
    seeds: str = "12"
    """How many seeds each run has, or which. They count from 24 in ZoneEnv, where some settings were chosen on 0 to 11,
    and from 0 in WaterWorld, where they are the maps; a list such as 0,3,7 applies to all runs."""
    workers: int = 0
    """How many processes share the runs, for each GPU or, without a GPU, in all; 0 trains one run after another in this
    process, on all GPUs. Small runs leave most of a GPU idle, so several processes get more done than one."""
    minutes: float = float("inf")
    """Stop this many minutes after the command began, and keep everything: what is trained ends its iteration and is
    written, which takes some seconds more. Give the same command again to continue."""
    folder: Path = Path("runs/reproduction")
    """Where the runs are kept, in a folder for each scale."""
    report: bool = False
    """Train nothing, and write what the documentation shows of the stored results: docs/results.md, docs/zeroshot.md,
    the tables between markers in README.md and docs, and their pictures."""
    keep: bool = False
    """Train nothing, and copy finished runs of full scale to results/paper and results/any; they must have been made
    from clean commits of this history. Of the methods' own runs, the parameters of the first seed are kept as well
    where they are small."""
    list: bool = False
    """Only show the items and their runs."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0 done or out of time, 1 if a run failed, 2 for unusable input,
    75 if this process lost its device (with --workers, that of some worker is a failure)."""
    return guarded(lambda: _main(sys.argv[1:] if arguments is None else list(arguments)))


def _main(texts: Sequence[str]) -> int:
    began = time.monotonic()
    arguments = parse(Arguments, list(texts), prog="python -m experiments.reproduce", description=Arguments.__doc__)
    with quiet_imports():
        import jax

        from experiments.cli import compilation_cache, cpu_devices
        from experiments.reproduction import begun_apart, launch, report, stored, work
        from experiments.reproduction.anytask import met
        from experiments.reproduction.items import GROUPS, ITEMS
        from experiments.reproduction.page import SMOKE, page
        from experiments.reproduction.pictures import say_above
        from experiments.reproduction.plan import Scale
        from experiments.reproduction.runs import AGENTS, MAPS, all_runs
        from t2tl_jax.runs import provenance
        from t2tl_jax.runs.config import RunConfig
        from t2tl_jax.runs.folder import write_json
        from t2tl_jax.runs.interrupts import StopRequest
        from t2tl_jax.training.seeds import FIRST_TUNING_SEED, parse_seeds

    runs = all_runs()
    words = [name.strip() for name in arguments.only.split(",") if name.strip()] or list(GROUPS)
    chosen = [name for word in words for name in GROUPS.get(word, (word,))]
    for name in chosen:
        if name not in ITEMS and name not in runs:
            close = did_you_mean(name, [*GROUPS, *ITEMS, *runs])
            raise UserError(f"unknown item or run {name!r}{close}; --list True shows them all")
    names = [run for name in chosen for run in (ITEMS[name].names(arguments.scale) if name in ITEMS else [name])]
    items = {name: item for name, item in ITEMS.items() if name in chosen or not set(names).isdisjoint(item.runs)}
    if arguments.list:
        for name, item in items.items():
            print(f"{name:22} {item.title}\n{'':22} {', '.join(item.runs)}")
        return 0
    if arguments.report:
        for written in report.write(ROOT):
            print(f"written: {written}")
        return 0
    if not arguments.minutes > 0:
        raise UserError(f"--minutes must be positive, got {arguments.minutes:g}")
    if arguments.workers < 0:
        raise UserError(f"--workers must not be negative, got {arguments.workers}")
    if arguments.keep and (arguments.workers or arguments.minutes != float("inf")):
        raise UserError("--keep trains nothing: leave out --workers and --minutes")
    if arguments.keep and arguments.scale != "full":
        raise UserError("--keep needs --scale full: results of a smoke test are not kept in the repository")
    with explained():
        seeds = parse_seeds(arguments.seeds)
    if arguments.keep and max(seeds) >= FIRST_TUNING_SEED:
        raise UserError(
            f"--seeds {arguments.seeds}: seeds from {FIRST_TUNING_SEED} on are kept for tuning, and results on them "
            "are not kept in the repository; take others, such as --seeds 12"
        )
    if arguments.scale == "smoke":
        jax.config.update("jax_disable_most_optimizations", True)  # nearly all of its time is compiling
    scale, base = Scale(arguments.scale, arguments.seeds), arguments.folder / arguments.scale
    minutes_left = arguments.minutes - (time.monotonic() - began) / 60  # a start with a GPU takes some of them
    anew = not any(base.glob("*/status.json"))
    failed: list[str] = []
    if not arguments.keep and arguments.scale == "full":
        _say_if_modified()
    if arguments.keep:
        if not base.is_dir():
            raise UserError(f"--keep: there is no folder {base}, so there are no runs to be kept")
        print("nothing is trained; finished runs are kept")
    elif arguments.workers:
        jax.config.update("jax_platforms", "cpu")  # this process only waits, and then reads what there is
        progress = work.Progress(runs, names, scale, base)
        options = [text for name in SHARED for text in (f"--{name}", str(getattr(arguments, name)))]
        with StopRequest("stopping all workers after their iteration") as stop:
            failed = launch.launch_workers(arguments.workers, options, minutes_left, base / "workers", progress, stop)
    else:
        compilation_cache.use(RunConfig().compilation_cache)
        cpu_devices.use()
        with StopRequest() as stop:
            try:
                failed = work.do_all(runs, names, scale, base, work.Deadline(minutes_left), stop)
            except work.LostDeviceError as error:
                # At once: what comes below builds environments on the device, and other clients of MPS wait.
                print(f"{error}, so that this process ends; give the same command again to continue", file=sys.stderr)
                if error.failed:
                    print(f"failed: {', '.join(error.failed)}")
                return work.LOST
    if arguments.keep:
        for name in work.needed(runs, names):
            if work.is_done(runs[name], scale, base / name):
                any_task, search = name.startswith("any-"), runs[name].search
                most = stored.MOST_OF_SEARCH if search else stored.MOST_ITERATIONS if any_task else None
                target = (ANY_RESULTS if any_task else RESULTS) / name
                stored.keep(
                    *(name, base / name, target),
                    agent=name in AGENTS,
                    most=most,
                    every_world=runs[name].seeds == MAPS,
                    search=search,
                )
                stored.keep_sizes(target)
                if any_task:
                    met.keep(target, runs[name].suites)
    finished = {
        name: run
        for name, run in stored.load(base).items()
        if name in work.needed(runs, names) and work.is_done(runs[name], scale, base / name)
    }
    smoke = arguments.scale == "smoke"
    shown, drawn = base / "results.md", report.drawings(finished, {}, finished)
    for picture in (one for name in items for one in drawn.get(name, [])):
        picture.draw(base / picture.file)
        if smoke:
            say_above(base / picture.file, SMOKE.strip("*"))
    text = page(items, finished, smoke=smoke, pictures=report.shown_by(drawn), remark=begun_apart.said)
    shown.write_text(text, encoding="utf-8")
    print(shown.read_text(encoding="utf-8"))
    print(f"written: {shown}")
    if len(finished) < len(work.needed(runs, names)):
        way_on = (
            "without --keep the command trains the others"
            if arguments.keep
            else "give the same command again to continue"
        )
        print(f"{len(finished)} of {len(work.needed(runs, names))} runs are done; {way_on}")
    elif anew and not failed:
        seconds = round(time.monotonic() - STARTED, 1)
        print(f"everything took {seconds:.0f} s, including the start of the program")
        content = {"where": provenance.describe(["python", "-m", "experiments.reproduce", *texts]), "seconds": seconds}
        write_json(base / "time.json", content | {"items": len(items), "runs": len(finished)})
    if failed:
        print(f"failed: {', '.join(failed)}")
    return 1 if failed else 0


def _say_if_modified() -> None:
    """Say before anything is trained what `--keep` says afterwards of a tree that differs from its commit."""
    from t2tl_jax.runs import source_tree

    if difference := source_tree.difference(source_tree.describe()):
        said = f"note: the source tree {difference}: --keep will refuse what is trained now"
        print(said, file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
