"""The nearest name, as every part of the project suggests it."""

import pytest

from t2tl_jax.names import nearest


@pytest.mark.parametrize(
    ("given", "known", "cutoff", "expected"),
    [
        ("zone_pppo", ["zone_ppo", "zone_dqn"], 0.0, "zone_ppo"),
        ("WATERWORLD", ["Zones", "WaterWorld"], 0.0, "WaterWorld"),
        ("xyz", ["abc"], 0.0, "abc"),
        ("xyz", ["abc"], 0.5, ""),
        ("xyz", [], 0.0, ""),
    ],
)
def test_nearest(given, known, cutoff, expected):
    assert nearest(given, known, cutoff) == expected
