"""What it costs to freeze seeds whose numbers are not finite: the aim was no measurable cost."""

from pathlib import Path

from experiments.reproduction.page import origin, paragraph, table
from experiments.reproduction.profiles import GAINS, STEPS
from t2tl_jax.runs.folder import read_json

STEP = "guard"
"""What the names of the steps of `experiments.benchmarks.gains` begin with that tell of it."""

SAID = """How much longer an iteration takes with it than without. Where the 95 % interval of the median holds 0 the
price is not told from none; a wide interval says little. The measurements stand in the order of time: of two of the
same thing the later one tells of the later program. A run on a GPU starts an iteration while the one before it still
runs. Where one call in a row was timed, the host's part of starting it counts too. Pairs of calls that were too few for
an interval are only in the table of [gains](#profiles)."""


def guard_price(results: Path) -> str:
    """The price in every stored measurement with an interval, and whether it can be told from none."""
    rows, wheres = [], []
    for stored in sorted(map(read_json, results.glob(GAINS)), key=lambda stored: stored["where"]["time"]):
        where = stored["where"]
        for name, of in stored["steps"].items():
            if not name.startswith(STEP) or of.get("low") is None:
                continue
            price, low, high = (of[which] - 1 for which in ("measured", "low", "high"))
            rows.append(
                (
                    STEPS[name],
                    ", ".join(where["devices"]),
                    where["git_revision"][:7],
                    str(stored["settings"]["repeats"]),
                    str(stored["settings"].get("in_a_row", 1)),
                    f"{price:+.1%} [{low:+.1%}, {high:+.1%}]",
                    "no" if low <= 0 <= high else "**yes**" if low > 0 else "yes, faster",
                    stored.get("beside", ""),
                )
            )
            wheres.append(where)
    if not rows:
        return "Not measured yet."
    heading = (
        "what",
        "hardware",
        "commit",
        "pairs",
        "calls in a row",
        "price",
        "told from none?",
        "what ran beside it",
    )
    measured = {row[0] for row in rows}
    left = [what for name, what in STEPS.items() if name.startswith(STEP) and what not in measured]
    not_yet = [paragraph(f"Not measured with an interval: {'; '.join(left)}.")] if left else []
    return "\n\n".join([paragraph(SAID), table(heading, rows), *not_yet, paragraph(origin(wheres))])
