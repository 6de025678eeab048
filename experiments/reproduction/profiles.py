"""Where an iteration's time goes beside the least that its parts could take, and what steps towards speed gained."""

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from experiments.reproduction.page import origin, paragraph, table
from t2tl_jax.evaluation.statistics import brackets
from t2tl_jax.runs.folder import read_json

FILES = "profile_*.json"
"""Of `experiments.benchmarks.profiles`, among the results; one for each kind of hardware."""

GAINS = "gains_*.json"
"""Of `experiments.benchmarks.gains`."""

SEEN = 0.005
"""Parts with a smaller share of the time and no floor to speak of are left out of the tables."""

STEPS = {
    "segments": "T2TL: windows in segments of eight steps instead of one by one (an iteration, closed form)",
    "next_values": "T1TL: V(s') from the next step's V(s), not computed for every step (an iteration, closed form)",
    "next_state": "DQN: no gradient through s' (a gradient step of T1TL; predicted by the compiler's count)",
    "shared_tokens": "tokens of the windows at s' that those at s hold too, made once (an iteration of T2TL by DQN)",
    "shared_tokens_12": "tokens that windows at s and s' share made once, twelve seeds (an iteration of T2TL by DQN)",
    "token_parts": "parts of tokens not put side by side before their layer (an iteration of T2TL by DQN)",
    "token_parts_12": "parts of tokens not put side by side, twelve seeds (an iteration of T2TL by DQN)",
    "guard": "the price of freezing seeds that are not finite, T1TL, one seed (an iteration, closed form)",
    "guard_12": "the price of freezing, T1TL, twelve seeds (an iteration, closed form)",
    "guard_mjx": "the price of freezing, T1TL by the long schedule, twelve seeds (an iteration, MJX)",
    "guard_t2tl": "the price of freezing, T2TL by the long schedule, twelve seeds (an iteration, MJX)",
    "guard_dqn": "the price of freezing, T1TL by DQN in WaterWorld, twelve seeds (an iteration)",
    "rows_t1tl": "rows of MJX's contacts behind the batch, T1TL, one seed (an iteration)",
    "rows_t2tl": "rows of MJX's contacts behind the batch, T2TL, one seed (an iteration)",
    "rows_12": "rows of MJX's contacts behind the batch, T1TL, twelve seeds (an iteration)",
    "rows_long": "rows of MJX's contacts behind the batch, T1TL by the long schedule, one seed (an iteration)",
    "kernels_t1tl": "few kernels of a network's many arrays, T1TL, one seed (an iteration)",
    "kernels_closed_form": "few kernels of many arrays, T1TL, one seed (an iteration, closed form)",
    "kernels_t2tl": "few kernels of many arrays, T2TL, one seed (an iteration)",
    "kernels_dqn": "few kernels of many arrays, T1TL by DQN in WaterWorld, one seed (an iteration)",
    "kernels_12": "few kernels of many arrays, T1TL by the long schedule, twelve seeds (an iteration)",
    "graphs_t1tl": "loops as CUDA graphs: T1TL, twelve seeds (an iteration, MJX)",
    "graphs_t2tl": "the same of T2TL",
    "graphs_closed_form": "the same of T1TL in closed form",
    "graphs_dqn": "the same of DQN, T1TL in WaterWorld",
    "cut_t1tl": "rows of MJX's contacts cut into parts, T1TL by the long schedule, twelve seeds (an iteration)",
    "cut_t2tl": "the same of T2TL with twelve seeds",
    "cut_large": "the same of T1TL with one seed of 65,536 environments",
}
"""What the steps of `experiments.benchmarks.gains` are."""


LIKE = {
    "zone_ppo_closed_form": "zone_ppo",
    "rm_water_crm_shaped": "rm_water_crm",
    "rm_water_crm_published": "rm_water_crm",
    "rm_water_ql_published": "rm_water_ql",
    "rm_water_ql_shaped": "rm_water_ql",
    "rm_water_ql_shaped_published": "rm_water_ql",
    "rm_water_parallel": "rm_water_crm",
    "pretrain_zone_published": "pretrain_zone",
    "pretrain_water": "pretrain_zone",
}
"""Configurations that are not profiled by their name, by the one whose program has the same parts."""


def profiles(results: Path) -> str:
    """For every training that was profiled a table of its parts."""
    files = sorted(results.glob(FILES))
    if not files:
        return "Not measured yet."
    like = "; ".join(f"`{one}` like `{other}`" for one, other in LIKE.items())
    said = f"""
        Not profiled by their names are these configurations, whose programs have the same parts as another, in other
        sizes or numbers: {like}."""
    return "\n\n".join([*(_profiled(read_json(file), file) for file in files), paragraph(said)])


def profiled(results: Path) -> set[str]:
    """The configurations that were profiled."""
    return {training.partition(":")[0] for file in results.glob(FILES) for training in read_json(file)["profiles"]}


def _profiled(stored: Mapping[str, Any], file: Path) -> str:
    peaks, settings = stored["peaks"], stored["settings"]
    said = f"""
        `{_command(stored, file)}`: median shares of {settings["repeats"]} iterations under the
        profiler, times of as many without it. The floor of a part is the greater of its arithmetic at
        {peaks["gigaflops"]:,.0f} GFLOP/s and of the bytes that go in and out at {peaks["gigabytes"]:,.0f} GB/s, which
        large products and copies reach on the same device."""
    if settings.get("unroll_length"):
        said += f"""
        Iterations are of {settings["unroll_length"]} steps instead of the configuration's own number, and what learns
        by minibatches has proportionally fewer of the same size: what is done once an iteration counts for more than in
        a training."""
    parts = [paragraph(f"{said} {stored.get('note', '')}")]
    for name, of in stored["profiles"].items():
        rate = of["frames"] / of["seconds"]
        seeds = f"{of['seeds']} seed{'s' * (of['seeds'] > 1)}"
        parts += [
            paragraph(
                f"`{name}`, {seeds}: {of['frames']:,} frames in {milliseconds(of['seconds'])} "
                f"({milliseconds(of['fastest'])} to {milliseconds(of['slowest'])}), {rate:,.0f} frames/s.{_kernels(of)}"
            ),
            _table(of, peaks),
        ]
    return "\n\n".join([*parts, origin([stored["where"]])])


def _kernels(of: Mapping[str, Any]) -> str:
    """How long a GPU was at work, and how much of that is in the table; '' for a CPU."""
    if of.get("kernels") is None:
        return ""
    without = "" if of["without_a_part"] < SEEN else f", of which {of['without_a_part']:.1%} are of no known operation"
    return (
        f" Kernels that are launched one by one, as they are under the profiler, are at work for "
        f"{milliseconds(of['kernels'])}{without}."
    )


def _table(of: Mapping[str, Any], peaks: Mapping[str, float]) -> str:
    rows = []
    for name, part in of["parts"].items():
        took = part["share"] * of["seconds"]
        floor = max(part["gigaflop"] / peaks["gigaflops"], part["gigabytes"] / peaks["gigabytes"])
        if part["share"] < SEEN and floor < SEEN * of["seconds"]:
            continue
        rows.append(
            (
                name,
                f"{part['share']:.1%}",
                milliseconds(took),
                f"{part['gigaflop']:.2f}",
                f"{part['gigabytes']:.2f}",
                milliseconds(floor),
                f"{max(0.0, took - floor) / of['seconds']:.1%}",
            )
        )
    heading = ("part", "share", "time", "GFLOP", "GB", "floor", "above it, of an iteration")
    return table(heading, rows)


def gains(results: Path) -> str:
    """What each step was to gain by its arithmetic, and gained by the clock."""
    files = sorted(results.glob(GAINS))
    if not files:
        return "Not measured yet."
    parts = []
    for file in files:
        stored = read_json(file)
        rows = [
            (
                STEPS[name],
                f"{of['predicted']:.2f}",
                f"{of['measured']:.2f} ({of['least']:.2f}, {of['most']:.2f})",
                "-" if of.get("low") is None else brackets(of["low"], of["high"], 3),
            )
            for name, of in stored["steps"].items()
        ]
        said = f"""
            How many times as long the slower form takes, by its arithmetic and by the clock: medians of
            {stored["settings"]["repeats"]} pairs of {_calls(stored["settings"])} within one process, the least and the
            most (`{_command(stored, file)}`). {stored.get("beside", "")}"""
        heading = ("step", "predicted", "measured", "95 % interval of the median")
        parts += [paragraph(said), table(heading, rows), origin([stored["where"]])]
    return "\n\n".join(parts)


def _calls(settings: Mapping[str, Any]) -> str:
    count = settings.get("in_a_row", 1)
    return "calls" if count == 1 else f"{count} calls in a row"


def _command(stored: Mapping[str, Any], file: Path) -> str:
    """As it was typed, with the file that it wrote where that is now."""
    words = stored["where"]["command"]
    return shlex.join(f"results/{file.name}" if word.endswith(".json") else word for word in words)


def milliseconds(seconds: float) -> str:
    """As it is written in tables."""
    return f"{1e3 * seconds:,.0f} ms" if seconds >= 0.02 else f"{1e3 * seconds:.1f} ms"
