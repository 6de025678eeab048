"""The tables of speed: seconds until success stayed above 95 %, and steps of environments, from stored output."""

import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from experiments.benchmarks import measured
from experiments.reproduction.page import made_by, origin, paragraph, table
from experiments.reproduction.scaling import in_time
from experiments.reproduction.stored import Stored
from t2tl_jax.runs.folder import read_json
from t2tl_jax.training.seeds import FIRST_TUNING_SEED

SINCE = re.compile(r"after ([\d,]+) frames and (\d+) s since the start of the program")
COMPILED = re.compile(r"^compiled in ([\d.]+) s", re.M)
WHOLE = re.compile(r"^whole process: (\d+) s", re.M)


@dataclass(frozen=True)
class Kind:
    """A row of the table: runs of one configuration on one machine."""

    title: str
    folder: str
    """Below the folder of all results; `SEED` stands for the seed of a run, if there are several."""
    hardware: str
    aim: int
    """Seconds that were aimed at, for every run."""
    command: str


ALL_SEEDS = "36,37,38,39,40,41,42,43,44,45,46,47"
SOLVE = "python -m experiments.run --config zone_ppo --until-solved True"
KINDS = (
    Kind("T2TL, MJX", "zone_cpu/t2tl_SEED", "2 CPU cores", 360, f"{SOLVE} --seeds 36,"),
    Kind(
        *("T1TL, MJX", "zone_cpu/t1tl_SEED", "2 CPU cores", 150),
        f"{SOLVE} --seeds 36, --method t1tl --pretrained ''",
    ),
    Kind(
        *("T1TL, closed form", "zone_cpu/t1tl_closed_form_SEED", "2 CPU cores", 60),
        f"{SOLVE} --seeds 36, --method t1tl --pretrained '' --env.physics closed_form",
    ),
    Kind("T2TL, MJX, 12 seeds", "zone_short_h200/t2tl_until_solved", "H200", 150, f"{SOLVE} --seeds {ALL_SEEDS}"),
    Kind(
        *("T1TL, MJX, 12 seeds", "zone_short_h200/t1tl_until_solved", "H200", 60),
        f"{SOLVE} --seeds {ALL_SEEDS} --method t1tl",
    ),
)


@dataclass(frozen=True)
class Timed:
    """What a run printed of its time."""

    run: Stored
    frames: int
    """Environment steps of a seed until success in training rose above 95 % and stayed, in every seed."""
    seconds: int
    """The same in seconds since the start of the program."""
    compiling: float
    """Seconds for the program of the run itself."""
    whole: int | None
    """Seconds of the whole process; None if it was cut."""


def timed(folder: Path) -> Timed:
    """Read a run; the last lines of their kind count, since a pre-training has some too."""
    output = (folder / "output.txt").read_text(encoding="utf-8")
    frames, seconds = SINCE.findall(output)[-1]
    cut = "SIGTERM" in output
    whole = None if cut or not WHOLE.search(output) else int(WHOLE.findall(output)[-1])
    return Timed(Stored(folder), int(frames.replace(",", "")), int(seconds), float(COMPILED.findall(output)[-1]), whole)


def is_stored(kind: Kind, results: Path) -> bool:
    """Whether there is a run of a row, with what it printed."""
    return any(results.glob(f"{kind.folder.replace('SEED', '*')}/output.txt"))


def runs_of(kind: Kind, results: Path) -> list[Timed]:
    """All runs of a row that are stored, in the order of their seeds."""
    start, several, _ = kind.folder.partition("SEED")
    if not several:
        return [timed(results / start)]
    parent = (results / start).parent
    found = [path for path in parent.iterdir() if re.fullmatch(re.escape(Path(start).name) + r"\d+", path.name)]
    return sorted((timed(path) for path in found), key=lambda one: one.run.seeds[0])


def until_solved(results: Path) -> str:
    """Seconds and frames by run, and how many were within the aim."""
    rows, shown = [], []
    for kind in KINDS:
        runs = runs_of(kind, results)
        shown += [one.run for one in runs]
        frames = [f"{edge(one.frames for one in runs) / 1e6:.2f}" for edge in (min, max)]
        rows.append(
            (
                kind.title,
                kind.hardware,
                ", ".join(f"{_seeds(one.run)}: {one.seconds}" for one in runs),
                f"{' to '.join(dict.fromkeys(frames))} M",
                _within(kind, runs),
                _span([one.compiling for one in runs]),
                _span([one.whole for one in runs if one.whole is not None]),
                f"`{kind.command}`",
            )
        )
    heading = (
        "what",
        "hardware",
        "seconds, by seed",
        "frames",
        "aim: runs within",
        "compile",
        "whole process",
        "command",
    )
    return f"{table(heading, rows)}\n\n{made_by(shown)}"


def _within(kind: Kind, runs: Sequence[Timed]) -> str:
    """How many runs were within the aim, of those on seeds that nothing was tuned on."""
    seconds = [one.seconds for one in runs if one.run.seeds[0] < FIRST_TUNING_SEED]
    return f"{kind.aim} s: {sum(one <= kind.aim for one in seconds)} of {len(seconds)}"


def _seeds(run: Stored) -> str:
    first, last = run.seeds[0], run.seeds[-1]
    return str(first) if first == last else f"{first} to {last}"


def _span(seconds: list[float] | list[int]) -> str:
    if not seconds:
        return "-"
    return f"{' to '.join(dict.fromkeys(f'{edge(seconds):.0f}' for edge in (min, max)))} s"


def second_core(results: Path) -> str:
    """Frames/s of the same seed on one device and on two."""
    kinds = ("t1tl", "t2tl", "t1tl_closed_form")
    rows = []
    for title, suffix in (
        ("one device", "_one_device"),
        ("every core a device: the environments of the seed are shared out", ""),
    ):
        runs = [Stored(results / "zone_cpu" / f"{kind}_{FIRST_TUNING_SEED}{suffix}") for kind in kinds]
        rows.append((title, *(f"{run.status['last_session']['frames_per_second_all_seeds']:,.0f}" for run in runs)))
    return table(("devices", "T1TL, MJX", "T2TL, MJX", "T1TL, closed form"), rows)


LONGEST_PAUSE = 0.05
"""The largest share of a training's time that its checkpoints were to take."""


def pauses(results: Path) -> str:
    """For how long trainings stood still for their checkpoints, over all runs that are stored with that time."""
    folders = sorted(path.parent for path in results.rglob("status.json"))
    stored = {path.relative_to(results).as_posix(): Stored(path) for path in folders}
    times = {name: run.status.get("all_sessions", {}) for name, run in stored.items()}
    trained = {name: of for name, of in times.items() if of.get("training_seconds")}
    shares = {
        name: (of["checkpoint_seconds"], of["training_seconds"])
        for name, of in trained.items()
        if of.get("checkpoint_seconds") is not None
    }
    over = {name: (stood, whole) for name, (stood, whole) in shares.items() if stood > LONGEST_PAUSE * whole}
    words = [
        f"`{name}` {100 * stood / whole:.1f} % ({stood:.2f} of {whole:.1f} s)" for name, (stood, whole) in over.items()
    ]
    return paragraph(
        f"Of {len(shares)} stored runs with such a time ({len(trained) - len(shares)} older ones have none), "
        f"{len(shares) - len(over)} stood still for checkpoints during "
        f"at most {100 * LONGEST_PAUSE:.0f} % of their training, which was the aim"
        + (f"; the others: {', '.join(words)}." if over else ".")
    )


def environments(results: Path) -> str:
    """Steps/s of environments, of every stored benchmark; a line that says so if there is none."""
    parts = []
    for where, measurements in in_time(results):
        found = [row for row in measurements if row.part == "environments"]
        if found and len(where["devices"]) == 1:
            parts += [table(STEPS, [_steps(row) for row in found]), origin([where])]
    for stored in benchmarks(results):
        settings = stored["config"]
        rows = [
            (
                row["physics"],
                f"{row['num_envs']:,}",
                f"{row['steps_per_s']:,.0f} ({row['slowest']:,.0f}, {row['fastest']:,.0f})",
                f"{row['compile_s']:.1f} s",
            )
            for row in stored["results"]
        ]
        what = f"{settings['env']}, {settings['layout']} map, `{settings['task']}`"
        calls = f"median of {settings['repeats']} calls of {settings['steps']} steps, random actions"
        parts += [
            f"{what}: {calls}.",
            table(("physics", "environments", "steps/s (minimum, maximum)", "compile"), rows),
            origin([stored["where"]]),
        ]
    parts.append(_by_layout(benchmarks(results)))
    return "\n\n".join(part for part in parts if part) or "Not measured yet from a commit of this history."


def _by_layout(stored: Sequence[Mapping[str, Any]]) -> str:
    """How much slower random maps are than a fixed one, by the same commit on the same hardware; '' where unknown."""
    rates: dict[tuple[Any, ...], dict[str, float]] = {}
    for of in stored:
        settings, where = of["config"], of["where"]
        for row in of["results"]:
            key: tuple[Any, ...] = (where["git_revision"], where.get("cpu"), tuple(where["devices"]))
            key += settings["env"], row["physics"], row["num_envs"]
            rates.setdefault(key, {})[settings["layout"]] = row["steps_per_s"]
    said = [
        f"{key[-3]}, {key[-2]}, {key[-1]:,} at once {of['fixed'] / of['random']:.2f}"
        for key, of in rates.items()
        if {"fixed", "random"} <= of.keys()
    ]
    if not said:
        return ""
    return paragraph(
        "Where a table does not say otherwise, its map is fixed. Where a reset draws a map, computed for every "
        f"environment at every step, a step takes so many times as long: {'; '.join(said)}."
    )


STEPS = ("environment, physics", "environments", "steps/s (minimum, maximum)", "compile")


def _steps(row: measured.Row) -> tuple[str, ...]:
    rate, slowest, fastest = map(measured.three_digits, (row.rate, row.slowest, row.fastest))
    return row.what, row.size, f"{rate} ({slowest}, {fastest})", f"{row.compile_s or 0:.1f} s"


def benchmarks(results: Path) -> list[dict[str, Any]]:
    """What `experiments.benchmarks.env --json` wrote."""
    return [read_json(file) for file in sorted(results.glob("env_*.json"))]


def everything(results: Path) -> str:
    """What `experiments.benchmark --json` wrote, of every stored file: the tables that it prints, but for that of
    environments, which has a place of its own."""
    parts = []
    for file in sorted(results.glob("benchmark_*.json")):
        where, rows = measured.read(file)
        parts += [f"`results/{file.name}`:", f"    {_command(where)}"]
        for name, shown in (
            ("progression", measured.table),
            ("training", measured.table),
            ("solve", measured.solved_table),
        ):
            if of_part := [row for row in rows if row.part == name]:
                parts.append(shown(of_part))
        note = read_json(file).get("note", "")
        parts.append(paragraph(f"{note} {origin([where])}"))
    return "\n\n".join(parts) or "Not measured yet from a commit of this history."


def _command(where: Mapping[str, Any]) -> str:
    """What made a benchmark's file, as it was typed but for the folder of the file."""
    words = where.get("command", [""])
    words = words[3:] if words[:2] == ["python", "-m"] else words[1:]  # older files have the path of the module
    cores = len(where["devices"]) if set(where["devices"]) == {"cpu"} else 1
    devices = f"JAX_NUM_CPU_DEVICES={cores} " if cores > 1 else ""
    return devices + shlex.join(["python", "-m", "experiments.benchmark", *words])


New = Sequence[tuple[Mapping[str, Any], Sequence[measured.Row]]]
"""Benchmarks that are not stored yet, as `in_time` gives those that are."""


def short_table(results: Path, new: New = ()) -> str:
    """The same for the README: the spread over seeds that nothing was tuned on, and the largest batches."""
    spans = {}
    for kind in KINDS:
        runs = [one for one in runs_of(kind, results) if one.run.seeds[0] < FIRST_TUNING_SEED]
        seconds = sorted(one.seconds for one in runs)
        count = f" ({len(runs)} runs)" if len(runs) > 1 else ""
        spans[kind.title] = f"{_span(seconds)}{count}"
    rows = [
        ("T2TL, MJX, 1 seed: `zone_ppo`", "2 CPU cores", spans["T2TL, MJX"]),
        (
            "T1TL, MJX / closed form, 1 seed: `--method t1tl --pretrained ''`",
            "2 CPU cores",
            f"{spans['T1TL, MJX']} / {spans['T1TL, closed form']}",
        ),
        (
            "T2TL / T1TL, MJX, 12 seeds, pre-training included",
            "H200",
            f"{spans['T2TL, MJX, 12 seeds']} / {spans['T1TL, MJX, 12 seeds']}",
        ),
        *trainings(results, new),
        *largest(results, new),
    ]
    return table(("what", "hardware", "figure"), rows)


SHORT_TRAININGS = (
    (
        "Training, 12 seeds, `zone_ppo_long`: T1TL / T2TL / T1TL in closed form",
        ("zone_ppo_long:t1tl", "zone_ppo_long:t2tl", "zone_ppo_long:t1tl:closed_form"),
        "12 seeds",
    ),
    (
        "Training, 12 seeds, `waterworld_dqn`: T1TL / T2TL",
        ("waterworld_dqn:t1tl", "waterworld_dqn:t2tl"),
        "12 seeds",
    ),
)
"""Rows of the README from what `experiments.benchmark` stored: title, trainings, how many seeds."""


def trainings(results: Path, new: New = ()) -> list[tuple[str, str, str]]:
    """Frames/s of whole iterations on one device; a row of which something is not stored is left out.

    A row is of one device and JAX; of each training the newest counts, as for the aims, and of several devices the row
    whose oldest figure is the newest. A file of several devices never does: its rows are those of `scaling`.
    """
    found: dict[tuple[str, ...], dict[tuple[str, str], tuple[int, str]]] = {}
    for age, (where, rows) in enumerate((*in_time(results), *new)):
        if len(where["devices"]) == 1 and not where.get("git_modified"):
            setting = (where["devices"][0].replace("NVIDIA ", ""), where["packages"]["jax"])
            of_trainings = [row for row in rows if row.part == "training"]
            rates = {(row.what, row.size): (age, measured.three_digits(row.rate)) for row in of_trainings}
            found[setting] = found.get(setting, {}) | rates
    shown = []
    for title, names, size in SHORT_TRAININGS:
        whole = [
            (min(rates[name, size] for name in names)[0], hardware, [rates[name, size][1] for name in names])
            for (hardware, *_), rates in found.items()
            if all((name, size) in rates for name in names)
        ]
        if whole:
            _, hardware, values = max(whole)
            shown.append((title, hardware, f"{' / '.join(values)} frames/s"))
    return shown


WORLDS = {
    "zones, mjx": "ZoneEnv by MJX",
    "zones, closed_form": "in closed form",
    "waterworld, straight_flight": "WaterWorld",
    "letterworld, grid": "LetterWorld",
    "flatworld, steps": "FlatWorld",
}
"""As the README calls what `experiments.benchmark` times."""


def largest(results: Path, new: New = ()) -> list[tuple[str, str, str]]:
    """The row of the README for environments: steps/s on one device, at the largest size of batch that some file has of
    every world, by the newest such file."""
    shown: list[tuple[str, str, str]] = []
    most = 0
    for where, rows in (*in_time(results), *new):
        if len(where["devices"]) > 1 or where.get("git_modified"):
            continue
        rates = {(row.size, row.what): row.rate for row in rows if row.part == "environments"}
        complete = [size for size in {size for size, _ in rates} if all((size, of) in rates for of in WORLDS)]
        counts = {int(size.split()[0].replace(",", "")): size for size in complete}
        if counts and max(counts) >= most:
            most = max(counts)
            speeds = " / ".join(measured.three_digits(rates[counts[most], of]) for of in WORLDS)
            count = f"{most:,}"
            title = f"Random play on one map, {count} environments: {' / '.join(WORLDS.values())}"
            shown = [(title, where["devices"][0].replace("NVIDIA ", ""), f"{speeds} steps/s")]
    return shown
