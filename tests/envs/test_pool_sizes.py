"""Pools of maps that would fill the memory are refused with the configuration, before a map is drawn."""

import pytest

from envs.flatworld.config import FlatWorldConfig
from envs.letterworld.config import LetterWorldConfig
from envs.waterworld.config import WaterWorldConfig
from envs.zones.config import ZoneConfig

HUGE = 2_000_000_000


@pytest.mark.parametrize(
    "make",
    [
        lambda: ZoneConfig(layout="random", pool_size=HUGE),
        lambda: WaterWorldConfig(layout="random", pool_size=HUGE),
        lambda: LetterWorldConfig(pool_size=HUGE),
        lambda: FlatWorldConfig(pool_size=HUGE),
    ],
)
def test_a_pool_that_fills_the_memory_is_refused(make):
    with pytest.raises(ValueError, match=r"pool_size=2,000,000,000 maps of .* MiB for each seed; at most [\d,]+ of"):
        make()


def test_one_map_may_be_too_large_as_well():
    with pytest.raises(ValueError, match="one map takes 15,259 MiB; the limit is 64"):
        WaterWorldConfig(balls_per_colour=10**9, colours=("Red",))
    with pytest.raises(ValueError, match="one map takes 9,537 MiB"):
        LetterWorldConfig(size=10**5, layout="by_seed")


def test_a_number_of_maps_that_are_not_made_may_be_any():
    assert ZoneConfig(pool_size=HUGE).pool_size == WaterWorldConfig(layout="by_seed", pool_size=HUGE).pool_size
