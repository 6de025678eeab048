"""Formulas that others test agents with which were not trained on them, by name.

The sources are DeepLTL (`z*`, `long`, `letters_*`, `flat_*`), GenZ-LTL (`g*`, `six_*`), Jaxolotl (`j*`) and StructLTL
(`s*`). Chains whose exact form is published nowhere are of this project, by the rule that stands beside them.
"""

COLOURS = ("Blue", "Green", "Magenta", "Yellow")
"""What the tasks of the arena with four colours speak of."""


def reach(goals: tuple[str, ...]) -> str:
    """Return the text of "reach the goals in order": nested eventuallys."""
    text = f"F {goals[-1]}"
    for goal in reversed(goals[:-1]):
        text = f"F({goal} & {text})"
    return text


def avoid_in_turn(links: tuple[tuple[str, str], ...]) -> str:
    """Return the text of "touch no a before b", then the next (a, b): nested untils."""
    text = "!{} U {}".format(*links[-1])
    for avoided, goal in reversed(links[:-1]):
        text = f"!{avoided} U ({goal} & ({text}))"
    return text


def _turns(names: tuple[str, ...], count: int) -> tuple[str, ...]:
    return tuple(names[i % len(names)] for i in range(count))


def _six(p: str, q: str, r: str, s: str, t: str, u: str, v: str, w: str, x: str) -> str:
    return f"!({p} | {q}) U ({r} & (!({s} | {t}) U ({u} & (!({v} | {w}) U {x}))))"


_ZONES = {
    "z1": "F(Green & (!Blue U Yellow)) & F Magenta",
    "z2": "F Blue & (!Blue U (Green & F Yellow))",
    "z3": "F(Blue | Green) & F Yellow & F Magenta",
    "z4": "!(Magenta | Yellow) U (Blue & F Green)",
    "z5": "!Green U ((Blue | Magenta) & (!Green U Yellow))",
    "z6": "((Green | Blue) -> (!Yellow U Magenta)) U Yellow",
    "g1": "F(Green & (!(Blue | Yellow) U (Magenta & (!Yellow U Blue)))) & F(!Green U Yellow)",
    "g2": "F((Blue | Green) & (!Yellow U (Blue & (!Green U Magenta)))) & F(Yellow & (!Blue U Green))",
    "g3": "!(Magenta | Yellow) U (Blue & (!Green U (Yellow & F(Green & (!Blue U Magenta)))))",
    "g4": "F(Blue & (!Yellow U (Green & F(Yellow & (!(Magenta | Green) U Blue)))))",
    "long": "(Green -> F(Yellow & F(Magenta & F Blue))) U ((Blue & F Magenta) & (!Yellow U Green))",
    "j8": "!(Green | Magenta | Yellow) U (Blue & F(Yellow & (!Blue U Green)))",
    "j10": (
        "F((Blue | Green) & ((Blue -> (!Yellow U (Magenta & F Green))) & (Green -> (!Magenta U (Yellow & F Blue)))))"
    ),
    "s7": "F(Yellow | Magenta | Blue) & (!Yellow U Green)",
    "s8": "F Magenta & F Green & F Yellow & F Blue",
    # Which chains were used is not published; ours go round three colours, and round all four.
    **{f"reach_{n}": reach(_turns(("Blue", "Green", "Yellow"), n)) for n in (2, 4, 8, 12)},
    **{f"avoid_{n}": avoid_in_turn(tuple(zip(_turns(COLOURS[1:] + COLOURS[:1], n), _turns(COLOURS, n), strict=True)))
       for n in (3, 4, 5, 6)},
}  # fmt: skip

_SIX_COLOURS = {
    "six_1": _six("Red", "Cyan", "Blue", "Yellow", "Green", "Magenta", "Cyan", "Yellow", "Green"),
    "six_2": _six("Green", "Red", "Cyan", "Blue", "Magenta", "Yellow", "Cyan", "Red", "Blue"),
    "six_3": _six("Yellow", "Cyan", "Red", "Green", "Blue", "Magenta", "Red", "Yellow", "Green"),
}

_LETTERS = {
    "letters_1": "F(a & (!b U c)) & F d",
    "letters_2": "F d & (!f U (d & F b))",
    "letters_3": "F((a | c | j) & F b) & F(c & F d) & F k",
    "letters_4": "!a U (b & (!c U (d & (!e U f))))",
    "letters_5": "((a | b | c | d) -> F(e & F(f & F g))) U (h & F i)",
    # Read off their names, RA-6 and R-12; which letters they have is not published.
    "letters_avoid_6": avoid_in_turn(tuple(zip("acegik", "bdfhjl", strict=True))),
    "letters_reach_12": reach(tuple("abcdefghijkl")),
}

_FLAT = {
    "flat_1": "F((Red & Magenta) & F((Blue & Green) & F Yellow))",
    "flat_2": "F(Orange & (!Red U Magenta))",
    "flat_3": "(!Red U (Green & Blue & Aqua)) & F(Orange & F(Red & Magenta))",
    "flat_4": "((!Yellow & !Orange) U (Green & Blue)) & (!Green U Magenta)",
    "flat_5": "(Blue -> F Magenta) U (Yellow | ((Green & Blue) & F Orange))",
}

BENCHMARK_TASKS: dict[str, str] = _ZONES | _SIX_COLOURS | _LETTERS | _FLAT
"""Formula texts. `z*`, `g*`, `long`, `j*`, `s*`, `reach_*` and `avoid_*` speak of `COLOURS`; `six_*` of six colours,
`letters_*` of the letters a to l, `flat_*` of the regions of a plane, some of which overlap."""
