"""Everything that is stored in results/ says where it comes from: a commit of this history, as it stands."""

import json
import subprocess
from pathlib import Path

import pytest

from experiments.reproduction.sections.anycertified import certificates
from experiments.reproduction.stored import Stored, unclean
from t2tl_jax.runs.folder import RunFolder

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "results"
RUNS = sorted({path.parent for path in RESULTS.rglob("*") if path.is_file() and path.parent != RESULTS})
BENCHMARKS = sorted(RESULTS.glob("*.json"))


def sessions():
    """Of every session of a stored run, of certificates made of it afterwards, and of every benchmark: its folder or
    file, and its versions."""
    for path in RUNS:
        versions = json.loads((path / "versions.json").read_text(encoding="utf-8"))
        for session in (versions["started"], *versions.get("resumed", [])):
            yield path, session
        for made in certificates(Stored(path)):
            yield RunFolder(path).certificates, made["where"]
    for file in BENCHMARKS:
        yield file, json.loads(file.read_text(encoding="utf-8"))["where"]


def git(*words):
    return subprocess.run(["git", "-C", str(ROOT), *words], capture_output=True, text=True, check=False)


def test_there_are_results():
    assert len(RUNS) > 20 and RESULTS / "walls.json" in BENCHMARKS


def test_every_run_has_its_versions():
    assert [path for path in RUNS if not (path / "versions.json").is_file()] == []
    loose = {path for path in RESULTS.iterdir() if path.is_file()} - set(BENCHMARKS)
    assert not loose  # what belongs to no run says in itself where it comes from


def test_everything_was_made_from_a_tree_without_changes():
    assert {str(path): unclean(made) for path, made in sessions() if unclean(made)} == {}


@pytest.mark.slow
def test_the_commits_are_of_this_history():
    if git("rev-parse", "--is-inside-work-tree").returncode:
        pytest.skip("not a git checkout, so there is no history to look into")
    shallow = git("rev-parse", "--is-shallow-repository").stdout.strip() == "true"
    foreign, missing = set(), set()
    for path, made in sessions():
        revision = made["git_revision"]
        if git("cat-file", "-e", f"{revision}^{{commit}}").returncode and shallow:
            missing.add(revision)
        elif git("merge-base", "--is-ancestor", revision, "HEAD").returncode:
            foreign.add((str(path), revision))
    assert foreign == set()
    if missing:
        pytest.skip(f"a shallow clone without {len(missing)} of the commits that results were made from")


@pytest.mark.parametrize("file", BENCHMARKS, ids=lambda file: file.name)
def test_commands_of_measurements_name_no_place_on_a_machine(file):
    """They stand in the documentation as they were typed."""
    command = json.loads(file.read_text(encoding="utf-8"))["where"].get("command", [])
    assert [word for word in command if "/" in word and Path(word).is_absolute()] == []
