"""What half as many environments save, part by part: why one seed is not twice as fast on two GPUs."""

from pathlib import Path

from experiments.benchmarks.measured import three_digits
from experiments.reproduction.page import origin, paragraph, table
from experiments.reproduction.profiles import SEEN, milliseconds
from experiments.reproduction.scaling import pairs
from t2tl_jax.runs.folder import read_json

FILE = "profile_h200_large_squeezed.json"
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
    shared = ""
    for where, found in pairs(results):
        for pair in found:
            if (pair.one.what, pair.count, where["git_revision"]) == (many, 2, stored["where"]["git_revision"]):
                shared = f"""Two GPUs with half of the environments each make {pair.ratio:.2f} times the frames/s of one
                    ({three_digits(pair.several.rate)} and {three_digits(pair.one.rate)}); if they had nothing to tell
                    each other and did nothing twice, they would make {whole / rest:.2f} times as many, by this
                    table."""
    said = f"""One seed on one GPU, `{many}` and `{few}`, with minibatches smaller by the same factor. Shares are those
        under the profiler, where kernels are launched one by one, of the time of an iteration as a run has it. A ratio
        below 2 is time that is not shared out by sharing out environments. {shared} {stored["note"]}"""
    heading = ("part", "all environments", "half of them", "ratio")
    return "\n\n".join([paragraph(said), table(heading, rows), origin([stored["where"]])])
