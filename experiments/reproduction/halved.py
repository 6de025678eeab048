"""What half as many environments save, part by part: why one seed is not twice as fast on two GPUs."""

from pathlib import Path

from experiments.benchmarks.measured import three_digits
from experiments.reproduction.page import origin, paragraph, table
from experiments.reproduction.profiles import SEEN, milliseconds
from experiments.reproduction.scaling import in_time
from t2tl_jax.runs.folder import read_json

FILE = "profile_h200_large.json"
"""Of `experiments.benchmarks.profiles`: one seed with as many environments as two GPUs share, and with half of them."""


def halved(results: Path) -> str:
    """The parts of both iterations beside each other, and what two GPUs make of that; a sentence where none is
    stored."""
    if not (results / FILE).is_file():
        return "Not measured yet."
    stored = read_json(results / FILE)
    (many, all_of_them), (few, half) = stored["profiles"].items()
    rows = []
    for name, part in all_of_them["parts"].items():
        took, less = part["share"] * all_of_them["seconds"], half["parts"][name]["share"] * half["seconds"]
        if part["share"] >= SEEN:
            rows.append((name, milliseconds(took), milliseconds(less), f"{took / less:.2f}"))
    whole, rest = all_of_them["seconds"], half["seconds"]
    rows.append(("an iteration", milliseconds(whole), milliseconds(rest), f"{whole / rest:.2f}"))
    one, two = (_rate(results, many, stored["where"]["git_revision"], count) for count in (1, 2))
    shared = ""
    if one is not None and two is not None:
        shared = f"""Two GPUs with half of the environments each make {two / one:.2f} times the frames/s of one
            ({three_digits(two)} and {three_digits(one)}); if they had nothing to tell each other and did nothing twice,
            they would make {whole / rest:.2f} times as many, by this table."""
    said = f"""One seed on one GPU, `{many}` and `{few}`, with minibatches smaller by the same factor. Shares are those
        under the profiler, where kernels are launched one by one, of the time of an iteration as a run has it. A ratio
        below 2 is time that is not shared out by sharing out environments. {shared} {stored["note"]}"""
    heading = ("part", "all environments", "half of them", "ratio")
    return "\n\n".join([paragraph(said), table(heading, rows), origin([stored["where"]])])


def _rate(results: Path, what: str, commit: str, devices: int) -> float | None:
    """Frames/s of a training by so many devices, by the same commit."""
    for where, rows in in_time(results):
        if where.get("git_revision") == commit and len(where["devices"]) == devices:
            for row in rows:
                if row.what == what and row.part == "training":
                    return row.rate
    return None
