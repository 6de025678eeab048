"""Chains over WaterWorld's colours with one ending, so that whoever never meets that end has met no row of them.

They are the first 32 draws of the family of `water_any` that end with one goal and three colours to avoid. Every row of
such a chain becomes that end. A training from which it is kept out, under all names, has drawn no chain that ends so,
and so has met no row of these.
"""

END = "!(Yellow | Purple | Magenta) U Orange"
"""How they end, up to names."""

CHAINS = (
    (
        "!(Yellow | Green) U ((Gray | Pink) & (!(Purple | Orange | Green | Blue) U ((Magenta | Gray) & "
        "(!(Yellow | Purple) U ((Pink | Blue) & (!(Yellow | Purple | Orange) U ((Pink | Green) & (!(Yellow | "
        "Orange | Blue) U Green))))))))"
    ),
    (
        "!Blue U ((Yellow | Gray) & (!(Orange | Pink) U (Green & (!(Yellow | Blue) U ((Gray | Green) & "
        "(!(Yellow | Magenta | Orange) U Gray))))))"
    ),
    (
        "!(Magenta | Gray | Blue) U (Purple & (!(Magenta | Green | Blue) U (Orange & (!(Yellow | Purple | "
        "Pink) U Gray))))"
    ),
    (
        "!(Purple | Magenta | Green | Blue) U (Yellow & (!(Magenta | Green) U ((Yellow | Pink) & (!(Orange | "
        "Gray | Green) U ((Purple | Pink) & (!(Magenta | Orange | Gray | Blue) U (Green & (!(Yellow | Gray | "
        "Blue) U Pink))))))))"
    ),
    (
        "!(Magenta | Orange | Pink) U (Green & (!(Yellow | Orange | Pink) U (Gray & (!(Purple | Magenta | "
        "Pink | Green) U ((Yellow | Orange) & (!(Purple | Gray | Blue) U Yellow))))))"
    ),
    (
        "!(Yellow | Orange | Gray | Green) U (Magenta & (!(Orange | Green | Blue) U (Yellow & (!(Magenta | "
        "Pink) U (Yellow | Blue)))))"
    ),
    "!(Magenta | Gray | Pink | Blue) U ((Orange | Green) & (!(Purple | Magenta | Pink) U Blue))",
    (
        "!(Magenta | Pink) U (Blue & (!Gray U (Blue & (!Yellow U (Pink & (!(Magenta | Orange | Gray) U (Green "
        "& (!Purple U (Pink | Green)))))))))"
    ),
    (
        "!Purple U (Green & (!(Magenta | Orange | Gray | Blue) U ((Yellow | Pink) & (!(Gray | Blue) U (Green "
        "& (!(Yellow | Magenta | Pink) U Gray))))))"
    ),
    "!Pink U (Orange & (!(Magenta | Pink | Green) U (Blue & (!(Purple | Magenta | Gray) U Green))))",
    "!(Orange | Pink | Green | Blue) U ((Purple | Magenta) & (!(Gray | Pink | Green) U Orange))",
    (
        "!(Purple | Orange | Green) U ((Yellow | Gray) & (!(Purple | Magenta | Orange | Green) U ((Pink | "
        "Blue) & (!(Yellow | Magenta | Orange) U Purple))))"
    ),
    (
        "!(Yellow | Pink) U ((Magenta | Gray) & (!Pink U (Purple & (!(Yellow | Gray) U (Magenta & (!(Orange | "
        "Green) U (Pink & (!(Magenta | Orange | Gray) U Purple))))))))"
    ),
    (
        "!(Purple | Magenta | Gray) U ((Green | Blue) & (!(Magenta | Gray) U (Purple & (!(Orange | Pink | "
        "Green) U Yellow))))"
    ),
    (
        "!(Magenta | Blue) U (Yellow & (!(Purple | Magenta | Orange | Pink) U (Green & (!(Yellow | Purple | "
        "Magenta | Blue) U (Orange & (!(Magenta | Gray | Pink | Green) U (Orange & (!(Yellow | Purple | Blue) "
        "U Pink))))))))"
    ),
    (
        "!Purple U (Orange & (!(Yellow | Magenta | Gray | Pink) U (Blue & (!(Yellow | Purple | Pink) U "
        "((Magenta | Green) & (!(Yellow | Pink) U ((Purple | Blue) & (!(Magenta | Orange | Pink) U "
        "Blue))))))))"
    ),
    (
        "!(Yellow | Orange | Pink) U (Purple & (!(Yellow | Magenta | Pink | Green) U ((Gray | Blue) & "
        "(!(Purple | Magenta | Orange) U Pink))))"
    ),
    "!Green U (Yellow & (!(Orange | Green) U (Purple & (!(Yellow | Gray | Blue) U Pink))))",
    (
        "!Magenta U (Purple & (!Orange U (Gray & (!(Pink | Green) U (Magenta & (!(Purple | Orange | Gray) U "
        "((Yellow | Green) & (!(Purple | Gray | Pink) U Blue))))))))"
    ),
    "!(Yellow | Purple | Pink) U ((Magenta | Blue) & (!(Yellow | Orange | Pink) U Green))",
    "!(Orange | Green | Blue) U (Yellow & (!(Magenta | Orange | Gray) U Green))",
    "!(Orange | Green | Blue) U (Yellow & (!(Purple | Magenta | Gray) U Pink))",
    "!(Purple | Orange | Pink | Blue) U ((Gray | Green) & (!(Magenta | Pink | Blue) U Purple))",
    (
        "!(Yellow | Purple | Magenta | Green) U (Gray & (!(Yellow | Purple) U (Orange & (!(Yellow | Magenta | "
        "Pink) U (Blue & (!(Yellow | Purple) U ((Green | Blue) & (!(Yellow | Magenta | Pink) U Green))))))))"
    ),
    (
        "!(Yellow | Orange | Pink | Green) U (Gray & (!Green U (Orange & (!(Yellow | Purple | Magenta | Blue) "
        "U (Orange & (!(Purple | Green) U ((Yellow | Gray) & (!(Purple | Orange | Pink) U Blue))))))))"
    ),
    "!(Orange | Pink | Green) U (Purple & (!(Magenta | Green | Blue) U Orange))",
    (
        "!Pink U ((Purple | Orange) & (!(Magenta | Green) U ((Purple | Blue) & (!(Yellow | Magenta | Orange | "
        "Green) U (Gray & (!Orange U (Blue & (!(Yellow | Magenta | Gray) U Pink))))))))"
    ),
    (
        "!(Magenta | Pink | Blue) U ((Yellow | Orange) & (!(Gray | Pink | Green | Blue) U ((Purple | Magenta) "
        "& (!(Pink | Blue) U ((Yellow | Gray) & (!(Magenta | Orange | Green) U Purple))))))"
    ),
    (
        "!(Yellow | Magenta | Gray | Green) U ((Orange | Pink) & (!(Yellow | Gray | Green) U ((Purple | Blue) "
        "& (!(Yellow | Magenta | Orange) U Green))))"
    ),
    (
        "!(Orange | Blue) U ((Gray | Pink) & (!(Yellow | Purple | Magenta | Green) U (Gray & (!(Yellow | "
        "Magenta | Green) U ((Purple | Blue) & (!(Magenta | Pink | Green) U Blue))))))"
    ),
    "!(Gray | Pink | Green) U (Magenta & (!(Purple | Green | Blue) U Gray))",
    (
        "!(Orange | Gray | Pink | Green) U ((Yellow | Blue) & (!(Purple | Gray | Green) U (Orange & (!Yellow "
        "U ((Orange | Blue) & (!(Yellow | Purple | Magenta) U (Orange | Green)))))))"
    ),
)
