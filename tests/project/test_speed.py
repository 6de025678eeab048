"""Figures of docs/speed.md and of README's table of speed, computed anew from what runs stored and printed."""

import json
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "results"
SPEED = (ROOT / "docs" / "speed.md").read_text(encoding="utf-8")
README = (ROOT / "README.md").read_text(encoding="utf-8")
SINCE = re.compile(r"after ([\d,]+) frames and (\d+) s since the start of the program")
KINDS = {"T2TL, MJX": "t2tl", "T1TL, MJX": "t1tl", "T1TL, closed form": "t1tl_closed_form"}


def since(run: Path) -> tuple[int, int]:
    """Frames and seconds until success stayed above 95 %; the last such line, since a pre-training has one too."""
    frames, seconds = SINCE.findall((run / "output.txt").read_text(encoding="utf-8"))[-1]
    return int(frames.replace(",", "")), int(seconds)


def rows(text: str, first: str) -> list[list[str]]:
    """Cells of the rows that begin with a cell."""
    return [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith(f"| {first} |")]


def stored_runs(kind: str) -> dict[int, tuple[int, int]]:
    found = (re.fullmatch(rf"{kind}_(\d+)", path.name) for path in (RESULTS / "zone_cpu").iterdir())
    return {int(match[1]): since(RESULTS / "zone_cpu" / match[0]) for match in found if match}


@pytest.mark.parametrize("what", KINDS)
def test_seconds_on_two_cores(what):
    """Every stored run is shown, the slow ones too."""
    ((_, hardware, shown, frames, _),) = rows(SPEED, what)
    stored = stored_runs(KINDS[what])
    assert hardware == "2 CPU cores"
    assert {int(a): int(b) for a, b in re.findall(r"(\d+): (\d+)", shown)} == {k: s for k, (_, s) in stored.items()}
    least, most = (edge([f for f, _ in stored.values()]) for edge in (min, max))
    assert frames == f"{least / 1e6:.2f} to {most / 1e6:.2f} M"


@pytest.mark.parametrize("method", ["t2tl", "t1tl"])
def test_seconds_of_twelve_seeds(method):
    frames, seconds = since(RESULTS / "zone_short_h200" / f"{method}_until_solved")
    ((_, _, shown, million, _),) = rows(SPEED, f"{method.upper()}, MJX, 12 seeds")
    assert shown == f"36 to 47: {seconds}" and million == f"{frames / 1e6:.2f} M"


def test_frames_are_those_of_the_stored_curves():
    """What was printed is what the status says, which earlier versions call by another name."""
    for path in (RESULTS / "zone_cpu").iterdir():
        status = json.loads((path / "status.json").read_text(encoding="utf-8"))
        said = status.get("success_since_frames") or status["solved_after_frames"]
        assert said == [since(path)[0]], path


def test_what_a_second_core_brings():
    cells = (
        rows(SPEED, "one device, MJX with sparse matrices"),
        rows(SPEED, "every core a device: the environments of the seed are shared out"),
    )
    for ((_, *shown),), suffix in zip(cells, ("_one_device", ""), strict=True):
        for kind, figure in zip(("t1tl_100", "t2tl_100", "t1tl_closed_form_100"), shown, strict=True):
            status = json.loads((RESULTS / "zone_cpu" / f"{kind}{suffix}" / "status.json").read_text(encoding="utf-8"))
            assert figure == f"{status['last_session']['frames_per_second_all_seeds']:,.0f}"


def test_steps_of_environments():
    text = (RESULTS / "zone_env_h200" / "output.txt").read_text(encoding="utf-8")
    for name, physics in (("mjx", "MJX"), ("closed_form", "closed form")):
        for envs, compiled, steps, least, most in re.findall(
            rf"^{name} +(\S+) +(\S+) +(\S+) +(\S+) +(\S+)$", text, re.M
        ):
            assert f"| {physics} | {envs} | {steps} ({least}, {most}) | {compiled} s |" in SPEED
    fast = re.findall(r"65,536 +\S+ +(\S+)", text)
    mjx, closed = (float(x.replace(",", "")) for x in fast)
    assert f"{round(mjx, -3):,.0f} / {round(closed, -6):,.0f} steps/s" in README


def test_readme_says_the_same():
    """Of seeds that nothing was tuned on."""

    def span(kind):
        seconds = [s for seed, (_, s) in stored_runs(kind).items() if seed < 100]
        return f"{min(seconds)} to {max(seconds)} s"

    words = " ".join(README.split())
    assert (
        f"from {span('t2tl').replace(' s', '')} s on (three runs; T1TL: from {span('t1tl').replace(' s', '')} s"
        in words
    )
    ((_, _, figure),) = rows(README, "T2TL, MJX, 1 seed: `zone_ppo`")
    assert figure == span("t2tl")
    both = [since(RESULTS / "zone_short_h200" / f"{method}_until_solved")[1] for method in ("t2tl", "t1tl")]
    assert f"| H200 | {both[0]} s / {both[1]} s |" in README and f"twelve seeds did from {both[0]} s on" in words
