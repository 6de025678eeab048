"""The items of the reproduction: tables and figures of the paper, measurements beside them, and the runs of each."""

from experiments.paper import step_tables
from experiments.reproduction import chance as measured
from experiments.reproduction import published_runs, representations
from experiments.reproduction import runs as named
from experiments.reproduction.anytask.items import ANY_ITEMS, GROUP
from experiments.reproduction.plan import Item
from experiments.reproduction.sections import (
    again,
    attention,
    benchmark,
    chance,
    figures,
    published_more,
    safe,
    search,
    settings,
    steps,
    unit_time,
    water_form,
    widths,
)
from experiments.reproduction.sections.ablation import (
    PRINTED_WATER,
    PRINTED_ZONE,
    ablation,
    printed_water,
    printed_zone,
)
from t2tl_jax.evaluation.comparisons import Pairs


def _with_each(first: str, others: tuple[str, ...]) -> Pairs:
    return [(first, other) for other in others]


def _pretrained_first(world: str, kinds: tuple[str, ...] = ("own", "random")) -> Pairs:
    """Pre-training of some kinds against none, for every method; of that on the task the paper claims that it helps."""
    return [
        (f"{world}-{method}-pre-{kind}", f"{world}-{method}-pre-none")
        for method in ("t2tl", "t1tl", "gnn")
        for kind in kinds
    ]


def _names(pattern: str, among: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(pattern.format(one) for one in among)


def _steps_names() -> tuple[str, ...]:
    cells = [(cell, False) for cell in (*step_tables.BY_GOALS, *step_tables.BY_OBSTACLES)]
    cells += [(cell, True) for cell in step_tables.BY_SIZE]
    names = [named.step_name(cell, same, method) for cell, same in cells for method in named.STEP_METHODS]
    return tuple(dict.fromkeys(names))


_READERS = ("transformer", "gnn")

_T1TL_PIECES = _names("water-t1tl-{}", ("own-row", "printed-argmax", "random-starts", "per-16", "every-step"))
_ONE_HOT_PIECES = ("water-dfa", *_names("water-rm-{}", ("printed-argmax", "random-starts", "per-16", "every-step")))
"""What is taken away or changed; without simultaneous learning the one-hot code is dfa."""

PAPER_ITEMS: dict[str, Item] = {
    "fig-zone": Item(
        "ZoneEnv, `phi_zone`: six methods, DFA both ways",
        _names("zone-{}", named.ZONE_METHODS),
        figures.zone_figure,
        smoke=("zone-t2tl", "zone-dfa_number"),
    ),
    "fig-water": Item(
        "WaterWorld, `phi_water`: six methods",
        _names("water-{}", (*named.WATER_METHODS, "rm-6")),
        figures.water_figure,
    ),
    "water-again": Item(
        "WaterWorld, `phi_water`: the same trainings once more",
        again.RUNS,
        again.once_more,
        smoke=("water-rm", named.again_name("water-rm")),
    ),
    "search": Item(
        settings.SEARCH_TITLE,
        search.planned(),
        search.search,
        smoke=("search-zone-dfa_number-high",),
    ),
    "tables-steps": Item("Steps to complete: sub-goals, obstacles, size of the obstacles", _steps_names(), steps.steps),
    "table-unit-time": Item(
        "Reward per unit time",
        (
            *_names("zone-{}", named.ZONE_METHODS),
            *_names("water-{}", (*named.WATER_METHODS, "rm-6")),
            *_names("zone-{}-alone", named.ZONE_METHODS),
            *_names("water-{}-alone", (*named.WATER_METHODS, "rm-6")),
            *_names("zone-pretraining-{}", _READERS),
            *_names("water-pretraining-{}", _READERS),
            *_names("zone-pretraining-{}-alone", _READERS),
            *_names("water-pretraining-{}-alone", _READERS),
        ),
        unit_time.unit_time,
        smoke=("zone-dfa_number", "zone-dfa_number-alone"),
    ),
    "fig-dimensions": Item(
        "Width of the codes",
        (
            "water-t1tl-8",
            "water-t1tl-16",
            "water-t1tl",
            "water-rm-6",
            "water-rm",
            "water-rm-32",
            *_names("zone-t1tl-fresh-{}", ("8", "16", "32")),
            "zone-dfa_number",
            "zone-dfa",
            "zone-dfa-32",
        ),
        widths.dimensions,
    ),
    "water-form": Item(
        "WaterWorld's learners in the paper's form: encoder trained on, code concatenated",
        water_form.RUNS,
        water_form.water_form,
        smoke=("water-t1tl", water_form.SLOW),
    ),
    "simultaneous": Item(
        "Simultaneous learning, piece by piece (`phi_water`, T1TL)",
        ("water-t1tl", *_T1TL_PIECES),
        ablation(
            [*_with_each("water-t1tl", _T1TL_PIECES), ("water-t1tl-per-16", "water-t1tl-every-step")],
            "success_rate",
            claims=[("water-t1tl", "water-t1tl-own-row")],
        ),
    ),
    "simultaneous-one-hot": Item(
        "Simultaneous learning, piece by piece (`phi_water`, one-hot)",
        ("water-rm", *_ONE_HOT_PIECES),
        ablation(
            [*_with_each("water-rm", _ONE_HOT_PIECES), ("water-rm-per-16", "water-rm-every-step")],
            "success_rate",
            claims=[("water-rm", "water-dfa")],
        ),
    ),
    "water-beginning": Item(
        "WaterWorld's first episodes, which score less than the published ones",
        (*named.BEGINNING, *named.SHORTLY.values(), measured.NAME),
        chance.water_beginning,
        beside=tuple(named.SHORTLY),
    ),
    "pretraining-zone": Item(
        "Pre-training in ZoneEnv: none, on the task, on random formulas",
        tuple(f"zone-{method}-pre-{kind}" for method in ("t2tl", "t1tl", "gnn") for kind in ("none", "own", "random")),
        ablation(
            _pretrained_first("zone"), "discounted_return", claims=_pretrained_first("zone", ("own",)), pretraining=True
        ),
    ),
    "pretraining-water": Item(
        "Pre-training in WaterWorld, encoders trained on: none, on the task, on random formulas",
        tuple(f"water-{method}-pre-{kind}" for method in ("t2tl", "t1tl", "gnn") for kind in ("none", "own", "random")),
        ablation(
            _pretrained_first("water"),
            "success_rate",
            claims=_pretrained_first("water", ("own",)),
            codes=True,
            pretraining=True,
        ),
    ),
    "safe": Item("`phi_safe`, the running example", _names("safe-{}", named.ZONE_METHODS), safe.safe),
    "attention": Item(
        "Attention on `phi_zone_prime`, from a fresh and from a pre-trained encoder",
        ("prime-fresh", "prime-own"),
        attention.attention,
    ),
    "printed-zone": Item(
        "Progression and labels as printed, beside the default: ZoneEnv, `phi_zone_prime`, T2TL",
        PRINTED_ZONE,
        printed_zone,
        smoke=("prime-own", "prime-progression-paper"),
    ),
    "printed-water": Item(
        "Labels as printed, beside the default: WaterWorld, `phi_water`, T1TL",
        PRINTED_WATER,
        printed_water,
    ),
    "representations": Item("Representations", (representations.NAME,), representations.section),
    "published": Item("The published program to its end", ("zone-published",), figures.published_program),
    "published-pieces": Item(
        "The published program without pre-training (T1TL, closed form), one choice at a time, and two pairs",
        ("zone-published-t1tl", *figures.PUBLISHED_PIECES),
        figures.published_pieces,
        smoke=("zone-published-t1tl", "zone-published-t1tl-correlated-noise"),
    ),
    "published-more": Item(
        "The published program on more seeds, and the sign of its critic at first",
        (*published_more.MORE, *published_runs.VALUES, published_runs.KEPT),
        published_more.more_seeds,
        smoke=published_more.MORE[1:],
        beside=published_more.BEFORE,
    ),
    "reader": Item(
        "A GRU instead of the context Transformer",
        ("zone-t2tl-pre-own", "zone-gru-reader"),
        ablation([("zone-t2tl-pre-own", "zone-gru-reader")], "discounted_return"),
    ),
    "benchmark": Item(
        "The reward-machine benchmark",
        (
            *(f"rm-{one}{kind}" for one in ("", "single-") for kind in ("crm", "ql", "crm_shaped", "ql_shaped")),
            "rm-ql-published",
            "rm-ql_shaped-published",
            "rm-single-crm-slow",
            "rm-single-crm-published",
        ),
        benchmark.benchmark,
    ),
}
"""By the names that ``--only`` takes."""

ITEMS = PAPER_ITEMS | ANY_ITEMS
"""All of them."""

GROUPS = {"paper": tuple(PAPER_ITEMS), GROUP: tuple(ANY_ITEMS)}
"""Several items by one name."""
