"""What came out when a run was killed at random moments, from stored results."""

import shlex
from pathlib import Path

from experiments.reproduction.page import origin, paragraph
from t2tl_jax.runs.folder import read_json

FILE = "kills.json"
"""Of `experiments.benchmarks.kills`, among the results."""


def kills(results: Path) -> str:
    """How often which run was killed, and whether it came to the same end."""
    if not (results / FILE).is_file():
        return "Not measured yet."
    stored = read_json(results / FILE)
    moments, ends, differing = stored["killed_after"], stored["ends"], stored["differing"]
    outcome = "all equal bit for bit to one that was let alone" if not differing else f"{differing} of them **differ**"
    text = f"""
        Stored: {len(moments)} kills of `{shlex.join(stored["flags"])}`, which takes {stored["seconds"]:.0f} s let
        alone, {min(moments):.1f} to {max(moments):.1f} s after each start; {ends} runs came to their end, {outcome}.
        {origin([stored["where"]])}"""
    return paragraph(text)
