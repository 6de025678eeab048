"""What freezing costs: told from none where the interval of its median does not hold it."""

import json

from experiments.reproduction.guard_price import guard_price
from experiments.reproduction.profiles import STEPS
from tests.page_cells import cells

WHERE = {
    "devices": ["cpu"], "cpu": "a processor", "packages": {"jax": "0.9"}, "git_revision": "abcdefghij",
    "command": ["python", "-m", "x"],
}  # fmt: skip


def test_the_aim_is_missed_where_the_interval_is_above_none(tmp_path):
    def store(name, time, step, low, high):
        of = {"predicted": 1.0, "measured": 1.02, "least": 0.9, "most": 1.1, "low": low, "high": high}
        content = {"where": WHERE | {"time": time}, "settings": {"repeats": 11}, "steps": {step: of}}
        (tmp_path / f"gains_{name}.json").write_text(json.dumps(content))

    assert guard_price(tmp_path) == "Not measured yet."
    store("a", "2026-02", "guard", 1.01, 1.03)
    store("b", "2026-01", "guard_mjx", 0.99, 1.03)
    store("c", "2026-03", "guard_dqn", 0.97, 0.98)
    store("d", "2026-04", "guard_12", None, None)  # too few pairs
    store("e", "2026-05", "token_parts", 1.1, 1.2)
    said = guard_price(tmp_path)
    assert f"Not measured with an interval: {STEPS['guard_12']}; {STEPS['guard_t2tl']}." in " ".join(said.split())
    rows = cells(said)
    del rows["what"]
    assert list(rows) == [STEPS["guard_mjx"], STEPS["guard"], STEPS["guard_dqn"]]
    assert [row[5] for row in rows.values()] == ["no", "**yes**", "yes, faster"]
    assert rows[STEPS["guard"]][:5] == ["cpu", "abcdefg", "11", "1", "+2.0% [+1.0%, +3.0%]"]
