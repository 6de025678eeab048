"""The operations of a traced function: what it costs, counted without compiling it."""

from collections import Counter

import jax


def operations(function, *given):
    """How many there are of each by name, those inside of loops and calls included, once each."""
    return sum(in_loops(function, *given).values(), Counter())


def in_loops(function, *given):
    """The same by the number of loops around them: counters by depth."""
    found: dict[int, Counter] = {}

    def collect(jaxpr, depth):
        for equation in jaxpr.eqns:
            parts = jax.tree.leaves(equation.params, is_leaf=lambda x: hasattr(x, "jaxpr"))
            parts = [part.jaxpr for part in parts if hasattr(part, "jaxpr")]
            found.setdefault(depth, Counter())[equation.primitive.name] += not parts
            for part in parts:
                collect(part, depth + (equation.primitive.name in ("scan", "while")))

    collect(jax.make_jaxpr(function)(*given).jaxpr, 0)
    return found
