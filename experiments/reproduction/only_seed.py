"""What an axis for the only seed cost MJX's substep on a GPU, before it was left out."""

from pathlib import Path

from experiments.reproduction.page import origin, paragraph, table
from t2tl_jax.runs.folder import read_json

FILE = "trial_only_seed.json"
"""Random play in ZoneEnv with MJX, by how a batch is shaped."""


def only_seed(results: Path) -> str:
    """A step of each shape; a sentence where none is stored."""
    if not (results / FILE).is_file():
        return "Not measured yet."
    stored = read_json(results / FILE)
    rows = []
    for one in stored["rows"]:
        seeds, num_envs, took = one["seeds"], one["num_envs"], one["milliseconds"]
        together = (seeds or 1) * num_envs
        shape = f"{seeds} x {num_envs:,}" if seeds else f"{num_envs:,}"
        rows.append((shape, f"{together:,}", f"{took:.2f} ms", f"{1e6 * took / together:.0f} ns", str(one["kernels"])))
    heading = ("seeds x environments", "environments", "a step", "a step and environment", "kernels")
    said = paragraph(f"Random play, nothing learned. {stored['note']}")
    made = stored["compiled"]
    compiled = table(
        ("shape", "kernels", "arrays with the rows last"),
        [(form["shape"], str(form["kernels"]), str(form["rows_last"])) for form in made["forms"]],
    )
    what = paragraph(f"""What JAX {made["jax"]}'s compiler makes of {made["what"]}, for {made["environments"]:,}
        environments a seed and an {made["device"]}, on a machine without one:""")
    return "\n\n".join([said, table(heading, rows), origin([stored["where"]]), what, compiled])
