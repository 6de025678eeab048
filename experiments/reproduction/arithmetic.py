"""What a substep of MJX and a gradient step of PPO compute, beside the least that they could take on an H200; and what
the rows of a table cost."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from experiments.benchmarks import measured
from experiments.benchmarks.trainings import training
from experiments.reproduction.page import origin, paragraph, table
from experiments.reproduction.scaling import in_time
from t2tl_jax.runs.folder import read_json

FILE = "arithmetic.json"
"""Of `experiments.benchmarks.arithmetic`, among the results."""

TABLES = "tables*.json"
"""Of `experiments.benchmarks.tables`, one for each kind of hardware."""

PEAK_TFLOP, PEAK_TBYTE = 67.0, 4.8
"""Of an H200 a second, as NVIDIA has it: single precision without tensor cores, and memory."""

PASSES = 11
"""Passes of MuJoCo in an environment step: ten substeps, and one for the accelerometer."""

MOTION = 32
"""Bytes of a robot's position, velocity and command."""

PROFILE = "profile_h200.json"
"""Of `experiments.benchmarks.profiles`: how fast large products are there, with JAX's default precision."""

MJX, STRAIGHT, BEFORE = "MJX as it is", "in a straight line", "the same, rows before the batch"

T1TL, T2TL = "T1TL", "T2TL, segments of 8 steps (the default)"

LEARNERS = {"zone_ppo_long:t1tl": T1TL, "zone_ppo_long:t2tl": T2TL, "zone_ppo_long:t1tl:closed_form": T1TL}
"""Trainings whose gradient step is counted."""


def substep(results: Path) -> str:
    """Both forms of the substep, what the compiler counts, and what that would take; '' where it is not stored."""
    if not (results / FILE).is_file():
        return "Not measured yet."
    stored = read_json(results / FILE)
    of: Mapping[str, Mapping[str, float]] = stored["substep"]
    forms = plain, straight, before = of[MJX], of[STRAIGHT], of[BEFORE]
    rows = [
        *(
            (said, *(f"{one[name]:,}" for one in forms))
            for said, name in (
                ("traced operations", "traced"),
                ("gathers and slices at places that are computed", "gathers"),
                ("scatters", "scatters"),
                ("matrix products", "products"),
                ("factorisations and triangular solves", "factorisations"),
                ("fused loops, compiled for a CPU", "fused_loops"),
            )
        ),
        ("read and written by a robot", *(f"{one['kilobytes']:.0f} kB" for one in forms)),
        ("processor time of a substep and robot", *(f"{one['microseconds']:.2f} us" for one in forms)),
        ("processor time to compile it", *(f"{one['compile_s']:.1f} s" for one in forms)),
    ]
    settings = stored["settings"]
    said = paragraph(f"""
        Counts are the compiler's, of the form that is compiled for a CPU; times are medians of {settings["repeats"]}
        calls of {settings["substeps"]} substeps of {settings["num_envs"]:,} robots on the processor below, summed over
        its cores.""")
    times = {name: plain["microseconds"] / one["microseconds"] for name, one in of.items()}
    gain = paragraph(f"""
        By the traced operations the gain would be {plain["traced"] / straight["traced"]:.1f} times, by the bytes
        {plain["kilobytes"] / straight["kilobytes"]:.2f}; it is {times[STRAIGHT]:.2f} times on this processor, and
        {times[BEFORE]:.2f} times with [rows before the batch](#rows-before-the-batch-or-behind-it), which was the form
        up to commit b2f10ac. The compiler fuses them into {plain["fused_loops"]}, {straight["fused_loops"]} and
        {before["fused_loops"]} loops, so fewer operations need not be fewer passes over memory.""")
    parts = [table(("one substep", *of), rows), said, gain, origin([stored["where"]])]
    return "\n\n".join([*parts, *_on_a_gpu(results, straight)])


def _on_a_gpu(results: Path, straight: Mapping[str, float]) -> list[str]:
    measured_rows = [(where, row) for where, row in _rows(results, "environments") if row.what == "zones, mjx"]
    steps = {row.size: row for _, row in measured_rows}
    if len(steps) < 2:
        return []
    sizes = sorted((int(size.split()[0].replace(",", "")), row) for size, row in steps.items())
    (few, some), (many, more) = sizes[0], sizes[-1]
    passes = [1e3 * count / row.rate / PASSES for count, row in ((few, some), (many, more))]
    each = (passes[1] - passes[0]) / (many - few)
    moved, least = (1e3 * few * size / (PEAK_TBYTE * 1e12) for size in (1e3 * straight["kilobytes"], MOTION))
    arithmetic = 1e3 * few * 1e3 * straight["kiloflop"] / (PEAK_TFLOP * 1e12)
    text = f"""
        On one H200 a pass, taken as an eleventh of a step with its observations, labels and resets, of {few:,}
        environments takes {passes[0]:.2f} ms, of {many:,} {passes[1]:.2f} ms. Moving the
        bytes above at {PEAK_TBYTE} TB/s would take {moved:.2f} ms for {few:,}, so a GPU moves fewer than the compiler
        counts for a CPU. The floor, one pass over {MOTION} bytes and {straight["kiloflop"]:.0f} kFLOP a robot, is the
        greater of {least:.4f} ms and, at {PEAK_TFLOP:.0f} TFLOP/s, {arithmetic:.3f} ms. By a straight line through the
        two sizes, which is an extrapolation, {passes[0] - few * each:.2f} ms of a pass are there whatever the batch,
        probably the time of many small kernels; in the 24,576 environments of 12 seeds that is
        {(passes[0] - few * each) / (passes[0] - (few - 24_576) * each):.0%} of it. Short batches
        [take less](#rows-before-the-batch-or-behind-it)."""
    return [paragraph(text), origin([where for where, _ in measured_rows])]


def gradient(results: Path) -> str:
    """kFLOP of a gradient step by sample, and how far measured learning is from the floor that they give."""
    if not (results / FILE).is_file():
        return "Not measured yet."
    stored = read_json(results / FILE)
    kiloflop = {name: one["kiloflop"] for name, one in stored["gradient_step"].items()}
    least = min(value for name, value in kiloflop.items() if name != T1TL)
    counted = [
        (name, f"{value:,.0f}", "-" if name == T1TL else f"{value / least:.2f}") for name, value in kiloflop.items()
    ]
    parts = [table(("a sample", "kFLOP", "of the least for T2TL"), counted), origin([stored["where"]])]
    peak, products = PEAK_TFLOP, "single precision without tensor cores, which products may use"
    if (results / PROFILE).is_file():
        peak, products = read_json(results / PROFILE)["peaks"]["gigaflops"] / 1e3, "what large products reach there"
    rows, shown = [], []
    for where, row in _rows(results, "training"):
        if row.what in LEARNERS and row.acting_share is not None and row.size == "12 seeds":
            rows.append(_learning(row, kiloflop[LEARNERS[row.what]], peak))
            shown.append(where)
    if rows:
        if (results / PROFILE).is_file():
            shown.append(read_json(results / PROFILE)["where"])
        said = f"""
            Learning on one H200: each frame is a sample of as many gradient steps as there are epochs. Predicted is
            what their arithmetic takes at {peak:.0f} TFLOP/s ({products}), measured is the time of an iteration that is
            not acting."""
        heading = ("training, 12 seeds", "epochs", "kFLOP a frame", "predicted", "measured", "of the floor")
        parts += [paragraph(said), table(heading, rows), origin(shown)]
    return "\n\n".join(parts)


def _learning(row: measured.Row, kiloflop: float, peak: float) -> tuple[str, ...]:
    learner: Any = training(row.what).learner
    assert row.acting_share is not None
    work = learner.epochs * kiloflop
    least, took = 1e3 * work / (peak * 1e12) * 1e6, (1 - row.acting_share) / row.rate * 1e6
    return (
        f"`{row.what}`",
        str(learner.epochs),
        f"{work:,.0f}",
        f"{least:.3f} us a frame",
        f"{took:.3f} us a frame",
        f"{took / least:.1f} times",
    )


def tables(results: Path) -> str:
    """What an iteration takes on tables of more and more rows, on every kind of hardware that it was timed on."""
    every = [read_json(file) for file in sorted(results.glob(TABLES))]
    if not every:
        return "Not measured yet."
    on_gpu = any("cpu" not in stored["where"]["devices"] for stored in every)
    parts = [_table_of_rows(stored) for stored in every]
    return "\n\n".join([*parts, *([] if on_gpu else ["On a GPU it was not measured."])])


def _table_of_rows(stored: Mapping[str, Any]) -> str:
    settings, found = stored["settings"], stored["results"]
    rows = [
        (
            f"{one['rows']:,}",
            one["minibatches_of"],
            f"{_time(one['seconds'])} ({_time(one['fastest'])}, {_time(one['slowest'])})",
            "-" if one["memory_mib"] is None else f"{one['memory_mib']:,.0f} MiB",
        )
        for one in found
    ]
    said = f"""
        One iteration of PPO in the world of a single state: {settings["num_envs"]} environments of
        {settings["unroll_length"]} steps, four epochs of minibatches of {settings["minibatch_size"]} samples, a small
        Transformer; median of {settings["repeats"]}, and the fastest and the slowest."""
    heading = ("rows of the table", "minibatches of", "an iteration", "memory")
    compared = paragraph(_as_fast(found, settings["minibatch_size"]))
    return "\n\n".join((paragraph(said), table(heading, rows), compared, origin([stored["where"]])))


def _time(seconds: float) -> str:
    return f"{seconds:.2f} s" if seconds >= 0.1 else f"{seconds * 1000:.1f} ms"


AS_FAST = 1.1
"""So many times as long is still the same speed."""


def _as_fast(found: Sequence[Mapping[str, Any]], samples: int) -> str:
    """How much longer the largest table takes than the smallest, which it was to be as fast as, and than one of as many
    rows as a minibatch has samples."""
    small, large = (pick(one["rows"] for one in found) for pick in (min, max))
    rest = [one for one in found if one["rows"] < large]
    fastest = min(rest, key=lambda one: one["seconds"])["rows"] if rest else small
    seconds = {(one["rows"], one["minibatches_of"]): one["seconds"] for one in found}

    def ratios(rows: int) -> dict[str, float]:
        return {
            kind: seconds[large, kind] / of
            for (count, kind), of in seconds.items()
            if count == rows and (large, kind) in seconds
        }

    def times(rows: int) -> str:
        return " and ".join(f"{ratio:.2f} times as long ({kind})" for kind, ratio in ratios(rows).items())

    if max(ratios(fastest).values()) <= AS_FAST:
        reached = f"""reached here: {large:,} rows take {times(fastest)} as {fastest:,}. So little is computed at once
            that the rows of a minibatch make no difference; with larger minibatches or codes they might."""
    elif max(ratios(small).values()) <= AS_FAST:
        reached = f"""nearly reached here: {large:,} rows take {times(small)} as {small:,}, but {times(fastest)} as
            {fastest:,}, which are faster than {small:,}; why was not looked into. So little is computed at once that
            the rows of a minibatch make little difference; with larger minibatches or codes they might."""
    else:
        reached = f"""**not reached** here: {large:,} rows take {times(small)} as {small:,}, since a minibatch holds
            that many more rows to encode."""
    text = f"""
        The aim was that tables of 10,000 rows train at the speed of small ones. With a code that is learned this is
        {reached} Codes that are looked up have nothing to encode."""
    if times(samples) and samples != fastest:
        text += f"""
            A minibatch has {samples} samples, so there are never more rows to encode than that: compared with a table
            of {samples} rows, {large:,} take {times(samples)}."""
    return text


def _rows(results: Path, part: str) -> Sequence[tuple[Mapping[str, Any], measured.Row]]:
    """What was measured on one GPU, the newest of each last."""
    found: dict[tuple[str, str], tuple[Mapping[str, Any], measured.Row]] = {}
    for where, rows in in_time(results):
        if len(where["devices"]) == 1 and "H200" in str(where["devices"][0]):
            found |= {(row.what, row.size): (where, row) for row in rows if row.part == part}
    return list(found.values())
