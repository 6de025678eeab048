"""How the rows of MJX's contacts could be summed up where the batch lies last: a trial, and not how a run has it."""

from pathlib import Path

from experiments.reproduction.page import commit, origin, paragraph, table
from t2tl_jax.runs.folder import read_json

FILE = "trial_sums_of_rows.json"
"""Random play in ZoneEnv with MJX in both forms, by turns; and what is compiled for more forms."""


def sums_of_rows(results: Path) -> str:
    """A step in both forms, and kernels and compiling of every form; a sentence where none is stored."""
    if not (results / FILE).is_file():
        return "Not measured yet."
    stored, rows = read_json(results / FILE), []
    for row in stored["rows"]:
        by_one, by_slices = row["reduction"], row["slices"]
        spent = f"{row['compile_reduction']:.1f} s", f"{row['compile_slices']:.1f} s"
        took = f"{by_one:.2f} ms", f"{by_slices:.2f} ms", f"{by_one / by_slices:.2f}"
        rows.append((f"{row['num_envs']:,}", *took, *spent))
    heading = ("environments", "a reduction", "slices", "ratio", "compiling, a reduction", "compiling, slices")
    made = stored["compiled"]
    forms = [(of["form"], str(of["kernels"]), f"{of['seconds']:.0f} s") for of in made["forms"]]
    said = f"""Random play, nothing learned, with the sums over rows (and their largest and least entries) as
        reductions, and with {stored["slices"]} slices added up, and then their entries one by one. {stored["note"]}"""
    asked = f"""*Kernels* are the fused operations of what the compiler of JAX {made["jax"]} makes of {made["what"]},
        for an {made["device"]}, asked on a machine without one at commit {commit(made)}; its seconds are of
        {made["on"]}. Where no reduction is named, entries are added one by one in the end."""
    parts = (
        paragraph(said),
        table(heading, rows),
        origin([stored["where"]]),
        paragraph(asked),
        table(("form", "kernels", "compiling"), forms),
    )
    return "\n\n".join(parts)
