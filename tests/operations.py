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


def handled(function, *given):
    """How many numbers its operations give and are given, once each; of what is looked into, only what is taken."""

    def count(jaxpr):
        total = 0
        for equation in jaxpr.eqns:
            parts = jax.tree.leaves(equation.params, is_leaf=lambda x: hasattr(x, "jaxpr"))
            parts = [part.jaxpr for part in parts if hasattr(part, "jaxpr")]
            total += sum(map(count, parts))
            if not parts:
                table = equation.primitive.name in ("gather", "dynamic_slice")
                total += sum(x.aval.size for x in (*equation.outvars, *equation.invars[table:]))
        return total

    return count(jax.make_jaxpr(function)(*given).jaxpr)
