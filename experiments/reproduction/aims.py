"""What this project aims at for trainings on one H200 and on two cores of a processor, beside what was measured."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from experiments.benchmarks import measured
from experiments.reproduction import start_trials
from experiments.reproduction.page import origin, paragraph, table
from experiments.reproduction.scaling import in_time
from t2tl_jax.runs.folder import read_json

T1TL, T2TL = "zone_ppo_long:t1tl", "zone_ppo_long:t2tl"
SHORT_T1TL, SHORT_T2TL = "zone_ppo:t1tl", "zone_ppo:t2tl"
ONE, TWELVE = "1 seed", "12 seeds"
H200, H100, TWO_CORES = ("NVIDIA H200",), ("NVIDIA H100 80GB HBM3",), ("cpu", "cpu")
HARDWARE = {H200: "H200", H100: "H100", TWO_CORES: "2 CPU cores", ("cpu",): "CPU, one device"}
"""By the names of the devices that JAX sees."""


@dataclass(frozen=True)
class Aim:
    """Of one training with so many seeds."""

    what: str
    size: str
    least: float | None = None
    """Frames/s of whole iterations that it should make at least."""
    within: float | None = None
    """Seconds that compiling should take at most."""
    again: float | None = None
    """Seconds that a second start should take at most, with the programs of the first on disk."""
    devices: tuple[str, ...] = H200
    """On which hardware, of `HARDWARE`."""


@dataclass(frozen=True)
class Steps:
    """How often a configuration of DQN makes a gradient step."""

    frames: int
    """For every so many."""
    transitions: int
    """Of so many."""
    rate: int = 0
    """Frames/s of 12 seeds, where the aim was set by them."""


THEN, NOW = Steps(frames=16, transitions=512, rate=173_000), Steps(frames=128, transitions=1024)
"""Of `waterworld_dqn` when its aim was set, and now; a test compares it with the configuration."""

DQN_AIM = 300_000

AIMS = (
    *(
        Aim(what, TWELVE, least=rate, devices=on)
        for on in (H200, H100)
        for what, rate in ((T2TL, 1_500_000), (T1TL, 2_500_000), (f"{T1TL}:closed_form", 12_000_000))
    ),
    Aim(T2TL, ONE, least=500_000),
    Aim(T1TL, ONE, least=800_000),
    *(Aim(f"waterworld_dqn:{method}", TWELVE, least=DQN_AIM) for method in ("t1tl", "t2tl")),
    *(Aim(what, TWELVE, within=s, devices=on) for on in (H200, H100) for what, s in ((T1TL, 20), (T2TL, 30))),
    *(Aim(what, TWELVE, again=10, devices=on) for on in (H200, H100) for what in (T1TL, T2TL)),
    Aim(SHORT_T2TL, ONE, least=6_000, devices=TWO_CORES),
    Aim(SHORT_T1TL, ONE, least=30_000, devices=TWO_CORES),
)


KEPT = "kept traces"
"""Whether a start found, or left, traced programs on disk beside the compiled ones."""
HOST = "processor"
"""The kind of CPU of the machine of a start."""
STARTS, TRIAL = "starts_*.json", "trial_no_triton_{}.json"
"""Of `experiments.benchmarks.starts`, among the results; and of the same and a benchmark under
``XLA_FLAGS=--xla_gpu_enable_triton_gemm=false``."""

NOTE = """The aims were set for an H200. Frames/s are those of the newest benchmark. On two cores it ran on a
slower machine than the one before it, as the rows in closed form show, whose program is the same. An aim for
compiling or starting is reached where every benchmark and every start that is stored is within it, since they
vary with the processor of the host and what else it does. Compiling does not count tracing, which the tables
above show beside it. Trainings that began beside others on a GPU compiled for longer; their seconds are on
the page of [results](results.md). A start is a whole process that trains for one iteration, without
pre-training (`python -m experiments.benchmarks.starts`). A second one finds compiled programs on disk, which
JAX keeps, and those that were traced, which this project keeps beside them
([how](../t2tl_jax/runs/kept_traces.py)). What is left of it is loading Python's modules, making the GPU
ready, which now goes on meanwhile, and reading programs; but `starts_h200`, `starts_h200_other_host`,
`starts_h200_two_gpu_host`, `starts_h100` and `starts_h100_shared` were measured when only the iteration was
kept, and how a run begins was traced anew. The aim was set when JAX's compiled programs were all that was
there. Starts with kept traces decide where there are some; all that are stored are in the second table. On
GPUs, those with and without are of different hosts and commits. Of those on GPUs only `starts_h200_ends`,
`starts_h200_squeezed`, `starts_h200_few`, `starts_h200_cut` and those that are newer have commands that end
without Python's last search for garbage, which among what JAX holds takes a part of a second. Newer ones are
`starts_h200_early`, by the commit that makes the GPU ready while modules load,
`starts_h200_early_uncollected`, which also looks for no garbage meanwhile and while a training is traced, and
`starts_h200_ready`, by one that also lists packages by their folders. They are of three hosts."""

LAYERS = """Where T1TL's compiling goes is in the next table; no step is most of it. Of the matrix products most are of
the task's Transformer, whose four layers are written out. What T2TL compiles beyond that was not taken apart; it has a
second Transformer, and its programs are larger by that."""


def aims(results: Path) -> str:
    """Every aim that something stored decides, from files of clean commits; see `NOTE`."""
    stored = [(where, rows) for where, rows in in_time(results) if not where.get("git_modified")]
    found: dict[Key, list[measured.Row]] = {}
    for where, rows in stored:
        for row in rows:
            if row.part == "training":
                found.setdefault((tuple(where["devices"]), row.what, row.size), []).append(row)
    begun = _started(results)
    lines = [line for aim in AIMS for line in _lines(aim, found.get(_key(aim), []), begun.get(_key(aim), []))]
    if not lines:
        return "Not measured yet."
    shown = table(("what", "size", "hardware", "aim", "measured", ""), lines)
    notes = [NOTE, *_dqn(found)]
    files = {file.name: read_json(file) for file in sorted(results.glob(STARTS))}
    told = [f"{name}: {of[word]}" for name, of in files.items() for word in ("beside", "note") if word in of]
    starts = [*told, *([origin([of["where"] for of in files.values()])] if files else [])]
    parts = (
        shown,
        _both_starts(begun),
        *map(paragraph, (*notes, *starts)),
        *start_trials.trials(results),
        paragraph(" ".join((LAYERS, _without_triton(results, begun)))),
    )
    return "\n\n".join(parts)


def _both_starts(begun: Mapping["Key", Sequence["Starts"]]) -> str:
    """Every pair of starts that is stored, with kept traces or without; a row for each kind of processor on CPUs."""
    rows = []
    for (devices, what, size), pairs in begun.items():
        hardware = HARDWARE.get(devices, ", ".join(devices))
        groups: dict[tuple[str, str], list[Starts]] = {}
        for pair in pairs:
            if "second" in pair:
                where = f"{hardware}, {pair['first'][HOST]}" if hardware.startswith("CPU") else hardware
                groups.setdefault((where, "kept" if pair["first"][KEPT] else "not kept"), []).append(pair)
        for (where, kept), some in sorted(groups.items()):
            seconds = [", ".join(f"{pair[which]['process']:.1f}" for pair in some) for which in ("first", "second")]
            rows.append((f"`{what}`", size, where, kept, *(f"{s} s" for s in seconds)))
    return table(("what", "size", "hardware", "traces", "first start", "second start"), rows) if rows else ""


Key = tuple[tuple[str, ...], str, str]
"""Devices, training and number of seeds."""

Starts = Mapping[str, Mapping[str, Any]]
"""The first and the second start of a training, as `experiments.benchmarks.starts` stores them."""


def _key(aim: Aim) -> Key:
    return aim.devices, aim.what, aim.size


def _started(results: Path, pattern: str = STARTS) -> dict[Key, list[Starts]]:
    found: dict[Key, list[Starts]] = {}
    for file in sorted(results.glob(pattern)):
        stored = read_json(file)
        if not stored["where"].get("git_modified"):
            about = {KEPT: stored["settings"].get("traces", False), HOST: stored["where"]["cpu"]}
            for what, starts in stored["starts"].items():
                count = stored["settings"]["seeds"]
                key = tuple(stored["where"]["devices"]), what, ONE if count == 1 else f"{count} seeds"
                found.setdefault(key, []).append({which: {**one, **about} for which, one in starts.items()})
    return found


def _lines(aim: Aim, rows: list[measured.Row], begun: list[Starts]) -> Iterator[tuple[str, ...]]:
    """The row of an aim; none where nothing decides it."""

    def line(wanted: str, got: str, reached: bool, by: str = "") -> tuple[str, ...]:
        outcome = f"reached{by}" if reached else "**not reached**"
        return f"`{aim.what}`", aim.size, HARDWARE[aim.devices], wanted, got, outcome

    if aim.least is not None and rows:
        newest = rows[-1]
        median, slowest, fastest = map(measured.three_digits, (newest.rate, newest.slowest, newest.fastest))
        got = f"{median} ({slowest}, {fastest}) frames/s"
        by = "" if newest.slowest >= aim.least else " by the median, not by every call"
        yield line(f"{aim.least:,.0f} frames/s", got, newest.rate >= aim.least, by)
    elif aim.within is not None:
        seconds = [row.compile_s for row in rows if row.compile_s is not None]
        seconds += [starts["first"]["compiling"] for starts in begun]
        if seconds:
            got = f"{', '.join(f'{one:.1f}' for one in seconds)} s"
            yield line(f"compiled within {aim.within:g} s", got, max(seconds) <= aim.within)
    elif aim.again is not None:
        second = [starts["second"] for starts in begun if "second" in starts]
        kept = [one["process"] for one in second if one[KEPT]] or [one["process"] for one in second]
        if kept:
            got = ", ".join(f"{seconds:.1f} s" for seconds in kept)
            yield line(f"second start within {aim.again:g} s", got, max(kept) <= aim.again)


def _dqn(found: Mapping[Key, Sequence[measured.Row]]) -> list[str]:
    """What the aim of DQN compares with: it was set before the configuration made fewer gradient steps."""
    rates = {
        method: of[-1].rate
        for method in ("t1tl", "t2tl")
        if (of := found.get((H200, f"waterworld_dqn:{method}", TWELVE), []))
    }
    if not rates:
        return []
    steps = " and ".join(
        f"{measured.three_digits(rate)} frames/s of {method.upper()} are "
        f"{measured.three_digits(rate / NOW.frames)} gradient steps/s"
        for method, rate in rates.items()
    )
    return [
        f"The aim of DQN was set when `waterworld_dqn` made a gradient step of {THEN.transitions} transitions for each "
        f"{THEN.frames} frames, and {THEN.rate:,} frames/s with a one-hot code on a GPU that was shared. Now it makes "
        f"one of {NOW.transitions:,} for each {NOW.frames} frames, an eighth of the steps: {steps}, of twice as many "
        f"transitions as the {measured.three_digits(THEN.rate / THEN.frames)} of then. So it is the change of the "
        "configuration that reaches the aim; what those of then would make was not measured."
    ]


WITHIN_BOTH = """ In this trial both were within the aims for compiling and for frames/s; so was the compiling of the
starts without the flag that they are compared with. On hosts where compiling took longer it was not tried, nor with
graphs."""


def _without_triton(results: Path, begun: Mapping[Key, list[Starts]]) -> str:
    """What leaving out Triton's products saves in compiling, and costs in training; '' where it is not stored."""
    file = results / TRIAL.format("benchmark")
    if not file.is_file():
        return ""
    where, rows = measured.read(file)
    starts = _started(results, TRIAL.format("starts"))
    before = {
        (tuple(other["devices"]), row.what, row.size): row
        for other, some in in_time(results)
        if other.get("time", "") <= where.get("time", "") and not other.get("git_modified")
        for row in some
        if row.part == "training"
    }
    said, reached = [], []
    for row in rows:
        key = tuple(where["devices"]), row.what, row.size
        if key in starts and key in begun and key in before:
            without, usual = (of[key][0]["first"]["compiling"] for of in (starts, begun))
            own = [aim for aim in AIMS if _key(aim) == key]
            reached += [without <= aim.within for aim in own if aim.within is not None]
            reached += [row.rate >= aim.least for aim in own if aim.least is not None]
            rates = " instead of ".join(measured.three_digits(one.rate) for one in (row, before[key]))
            once = "" if row.compile_s is None else f" ({row.compile_s:.1f} s when it was benchmarked)"
            said.append(
                f"`{row.what}` compiles in {without:.1f} instead of {usual:.1f} s{once} and makes {rates} frames/s"
            )
    flags = where.get("xla_flags", "")
    return (
        f"Without Triton's products (`XLA_FLAGS={flags}`) {'; '.join(said)}. The rates that these are compared with "
        "are the last ones before, of other commits and days, and like these without loops as CUDA graphs."
        f"{WITHIN_BOTH if all(reached) else ''}"
        if said
        else ""
    )
