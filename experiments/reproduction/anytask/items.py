"""The items of agents for any task: what docs/zeroshot.md shows, and the runs of each."""

from functools import partial

from experiments.paper import published_any as published
from experiments.reproduction.anytask import suites
from experiments.reproduction.anytask.runs import LEARNED, MEMORIES, MERGED, TEXTS, WITHOUT_PARAMETERS
from experiments.reproduction.plan import Item
from experiments.reproduction.sections import anyaims, anyalone, anycertified, anycodes, anymemory, anystrict, anytask

GROUP = "any"
"""What ``--only`` calls all of them."""

_CODES = tuple(
    f"any-zones{name}"
    for name in (
        *("", "-lookahead-merged", "-lookahead", "-automaton", "-transformer", "-rgcn", "-gru"),
        *("-roles-merged", "-names", "-nothing", "-transformer-fresh"),
        *(f"-broad-{code}-merged" for code in MERGED),
        *(f"-broad-{code}" for code in (*WITHOUT_PARAMETERS, *LEARNED)),
        *(f"-solved-{code}" for code in TEXTS),
    )
)
_PRETRAINED = (
    *(f"any-pretraining-{broad}{code}" for broad in ("", "broad-") for code in LEARNED),
    *(f"any-pretraining-solved-{code}" for code in TEXTS),
)
_MEMORIES = tuple(f"any-memory-{name}" for name in MEMORIES)

ANY_ITEMS: dict[str, Item] = {
    "any-open": Item(
        "The open ZoneEnv (`PointLtl2-v0`): one agent, formulas that it was not trained on",
        ("any-zones",),
        anytask.tasks_of_run(
            "any-zones",
            anytask.OPEN_ZONES,
            anytask.ZONE_BARS,
            {"z1 to z6": suites.ZONE_Z, "g1 to s8": suites.ZONE_HARD},
            anytask.MOST_SECONDS,
        ),
    ),
    "any-walled": Item(
        "The paper's walled ZoneEnv with MJX, random maps",
        ("any-walls",),
        anytask.tasks_of_run("any-walls", anytask.WALLED, anytask.WALL_BARS),
    ),
    "any-letterworld": Item(
        "LetterWorld, random maps",
        ("any-letters",),
        anytask.tasks_of_run(
            "any-letters", published.LETTERS, anytask.LETTER_BARS, {"letters_1 to 5": suites.LETTERS.tasks[:5]}
        ),
    ),
    "any-dqn": Item(
        "LetterWorld by double DQN, which learns eight rows of every transition",
        ("any-letters-dqn",),
        anytask.tasks_of_run("any-letters-dqn", published.LETTERS, means={"letters_1 to 5": suites.LETTERS.tasks[:5]}),
    ),
    "any-flatworld": Item(
        "FlatWorld",
        ("any-flat",),
        anytask.tasks_of_run("any-flat", published.FLAT, anytask.FLAT_BARS, {"flat_1 to 5": suites.FLAT.tasks}),
    ),
    "any-waterworld": Item(
        "WaterWorld, random maps",
        ("any-water",),
        anytask.tasks_of_run(
            "any-water", {published.SCRIPT: {"phi_water": published.SCRIPT_WATER}}, anytask.WATER_BARS
        ),
    ),
    "any-strict": Item(
        "Unseen in the strict sense: no row of the tests was drawn in training, under any renaming of propositions",
        tuple(name for pair in anystrict.PAIRS for name in pair),
        anystrict.strict,
        smoke=("any-letters", "any-letters-strict"),
    ),
    "any-codes": Item(
        "Which code generalises: representations and levels, in the open ZoneEnv",
        (*_CODES, *_PRETRAINED),
        anycodes.levels,
        smoke=("any-zones-transformer", "any-zones-names"),
    ),
    "any-memory": Item(
        "Memory: the open ZoneEnv with a lidar of 1.2 m",
        _MEMORIES,
        partial(anymemory.memory, _MEMORIES),
        smoke=("any-memory-gru",),
    ),
    "any-certificates": Item(
        "A certificate for each formula",
        anycertified.RUNS,
        anycertified.certified,
    ),
}
"""By the names that ``--only`` takes."""

AIMS: dict[str, tuple[str, anyaims.Aims]] = {
    "any-open": ("ZoneEnv", anyaims.aims_of_run("any-zones", anytask.ZONE_BARS, anytask.MOST_SECONDS)),
    "any-walled": ("walled ZoneEnv", anyaims.aims_of_run("any-walls", anytask.WALL_BARS)),
    "any-letterworld": ("LetterWorld", anyaims.aims_of_run("any-letters", anytask.LETTER_BARS)),
    "any-flatworld": ("FlatWorld", anyaims.aims_of_run("any-flat", anytask.FLAT_BARS)),
    "any-waterworld": ("WaterWorld", anyaims.aims_of_run("any-water", anytask.WATER_BARS)),
    "any-strict": ("strictly unseen", anystrict.aims),
    "any-codes": ("codes", anyalone.aims),
    "any-certificates": ("certificates", anycertified.in_time),
}
"""By item, in a few words what it is about, and its aims."""
