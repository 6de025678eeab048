"""What came out when a run was killed at random moments, from stored results."""

import shlex
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from experiments.reproduction.page import origin, paragraph
from t2tl_jax.runs.folder import read_json

FILES = "kills*.json"
"""Of `experiments.benchmarks.kills`, among the results."""


def kills(results: Path) -> str:
    """How often which runs were killed, and whether they came to the same end."""
    return "\n\n".join(_killed(read_json(file)) for file in sorted(results.glob(FILES))) or "Not measured yet."


def _killed(stored: Mapping[str, Any]) -> str:
    hits, ends, differing = stored["kills"], stored["ends"], stored["differing"]
    outcome = "all equal bit for bit to one that was let alone" if not differing else f"{differing} of them **differ**"
    text = f"""
        Stored: {len(hits)} kills of `{shlex.join(stored["flags"])}`, which takes {stored["seconds"]:.0f} s let alone,
        with programs and traces of an earlier start on disk and modules loaded, so that little is compiled;
        {ends} runs came to their end, {outcome}. What was hit is read off the folder; the checkpoint may be one of the
        pre-training, and evaluating lasts to the end of the program. {origin([stored["where"]])}"""
    return f"{paragraph(text)}\n\n{_table(stored['phases'], hits)}"


def _table(phases: Iterable[str], hits: Sequence[Mapping[str, Any]]) -> str:
    """What the kills hit, and when; of phases that were met only by kills, too."""
    lines = ["| what was killed | kills | seconds after a start |", "|---|---|---|"]
    for phase in dict.fromkeys([*phases, *(hit["phase"] for hit in hits)]):
        after = sorted(hit["after"] for hit in hits if hit["phase"] == phase)
        lines.append(f"| {phase} | {len(after)} | {', '.join(f'{moment:.1f}' for moment in after) or '-'} |")
    return "\n".join(lines)
