"""What is stored in results/ says where it comes from, and the documentation names what does not."""

import json
from pathlib import Path

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "results"
TEXT = (ROOT / "docs" / "results.md").read_text(encoding="utf-8")
MODIFIED = {
    "pretrain_zone_h200",
    *(f"water_h200/{run}" for run in ("phi_rm", "phi_t1tl", "phi_t1tl_fresh", "rm_crm", "rm_ql")),
    *(f"zone_methods_h200/{run}" for run in ("dfa", "dfa_cont", "gnn", "t1tl", "t2tl")),
}
"""Of version 0.1, from trees with changes. Nothing may join them; what is measured again leaves."""
WITHOUT_VERSIONS = {"zone_ppo_h200", "zone_tuning"}


def test_runs_come_from_clean_commits():
    modified = set()
    for file in RESULTS.rglob("versions.json"):
        versions = json.loads(file.read_text(encoding="utf-8"))
        for session in (versions["started"], *versions.get("resumed", [])):
            assert session["git_revision"], file
            if session["git_modified"]:
                modified.add(str(file.parent.relative_to(RESULTS)))
    assert modified == MODIFIED


def test_runs_without_versions_are_those_that_are_named():
    without = {path.parent for path in RESULTS.rglob("config.json") if not (path.parent / "versions.json").exists()}
    assert {path.relative_to(RESULTS).parts[0] for path in without} == WITHOUT_VERSIONS


def test_the_documentation_names_them():
    paragraph = TEXT.split("**Not from clean commits**")[1].split("\n\n")[0]
    for run in MODIFIED:
        assert f"`{run.split('/')[0]}`" in paragraph, run
        assert "/" not in run or run.startswith("zone_methods") or f"`{run.split('/')[1]}`" in paragraph, run
    assert all(f"`{folder}`" in paragraph for folder in WITHOUT_VERSIONS)
