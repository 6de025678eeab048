"""A thousand seeds of one method in one program, on one GPU."""

from pathlib import Path

import numpy as np

from experiments.reproduction.cells import solved, text
from experiments.reproduction.page import made_by, paragraph, table
from experiments.reproduction.stored import Stored
from t2tl_jax.evaluation.statistics import SOLVED, rate
from t2tl_jax.training.seeds import FIRST_TUNING_SEED


def thousand(results: Path) -> str:
    """What they came to and how long they took."""
    run = Stored(results / "thousand_h200" / "t1tl")
    time, many = run.status["last_session"], len(run.seeds)
    since = [frames for frames in run.status["success_since_frames"] if frames is not None]
    below = [share > SOLVED for seed, share in run.by_seed("success_rate").items() if seed < FIRST_TUNING_SEED]
    row = (
        *(solved(run), solved(run, "deterministic")),
        *(text(run.by_seed("discounted_return")), text(run.end("discounted_return"))),
        *(f"{len(since)}/{many}", f"{np.median(since) / 1e6:.2f} M / {max(since) / 1e6:.2f} M"),
    )
    heading = (
        *("solved", "deterministic: its episodes succeed", "return, final", "return, training"),
        *("stay over 95 %", "since frames, median / last of these"),
    )
    said = f"""
        {run.frames:,} frames of each of {many:,} seeds, all side by side in one program and on one GPU: training
        {time["training_seconds"]:.0f} s, {time["frames_per_second_all_seeds"]:,.0f} frames/s; compiling
        {time["compile_seconds"]:.0f} s, beside the pre-training; pre-training {time["pretraining_seconds"]:.0f} s.
        Settings are chosen on seeds from {FIRST_TUNING_SEED} on; of the {len(below)} below {sum(below)} are solved
        ({rate(sum(below), len(below)).text()}). Every eighth iteration of the metrics is kept, and the last ones.
        No size of groups was asked for (`--run.seeds-at-once`), and the run told of none: all seeds fitted into the
        memory of the GPU. Groups on a GPU are [elsewhere](usage.md#very-many-seeds-very-many-frames)."""
    return "\n\n".join((table(heading, [row]), paragraph(said), made_by([run])))
