"""From a function of JAX to straight-line arithmetic, and back to a function of JAX."""

from collections.abc import Callable, Sequence
from functools import partial
from itertools import accumulate
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import ClosedJaxpr, Jaxpr, JaxprEqn, Literal

from envs.straight_line import arrays
from envs.straight_line.arrays import Array, each, entries, fold, known, singles
from envs.straight_line.layout import Layout, layout_for, shortened
from envs.straight_line.numbers import KNOWN, Number, Numbers, Operand, size_of

NESTED = {"jit": "jaxpr", "pjit": "jaxpr", "closed_call": "call_jaxpr", "custom_jvp_call": "call_jaxpr"}
"""Operations that call a function, and the parameter that holds it."""

SCATTERS = {"scatter": None, "scatter-add": "add", "scatter-mul": "mul"}
"""Operations that put numbers into an array, and what combines them with those that are there."""

FOLDS = {"reduce_sum": "add", "reduce_max": "max", "reduce_min": "min", "reduce_and": "and", "reduce_or": "or"}
"""Operations along axes, and what combines two numbers."""


def straight_line(function: Callable[..., Any], *examples: Any) -> Callable[..., Any]:
    """The same function, of arguments like `examples` (trees of arrays or of their shapes), in straight-line form.

    It may hold what the rules below know: arithmetic, products and factorisations of matrices, conditions, loops of a
    fixed length, and entries moved to places that are known. Derivatives are not for it.

    Raises:
        NotImplementedError: for anything else.
    """
    numbers = Numbers()
    # A program that is traced meanwhile may be for several devices; single numbers are spread over none.
    with jax.sharding.use_abstract_mesh(jax.sharding.AbstractMesh((), ())):
        closed, shape = jax.make_jaxpr(function, return_shape=True)(*examples)
        given = [_given(numbers, aval) for aval in closed.in_avals]
        try:
            results = [singles(numbers, x) for x in _evaluate(numbers, closed, given)]
        except NotImplementedError:
            raise
        except Exception as error:  # another version of JAX may have other parameters, or arrays of other ranks
            raise NotImplementedError(f"a rule does not fit: {type(error).__name__}: {error}") from error
    steps = _needed(numbers.made, results)
    dtypes, tree = [x.dtype for x in jax.tree.leaves(shape)], jax.tree.structure(shape)

    def run(layout: Layout, *leaves: jax.Array) -> list[jax.Array]:
        """Arrays with any number of axes more behind their own, over which everything is done at once."""
        axis = layout.axis
        values: dict[int, Any] = {}
        for names, x in zip(given, leaves, strict=True):
            for at in np.ndindex(names.shape):
                values[id(names[at])] = x[at]
        batch = next(x.shape[names.ndim :] for names, x in zip(given, leaves, strict=True))
        along_batch = range(1, len(batch) + 1) if axis == 0 else range(len(batch))

        def value(x: Operand, size: int) -> jax.Array:
            """As a row of that size, all along which a single number is the same; as a single number for 0."""
            if not isinstance(x, Number):
                found = jnp.expand_dims(jnp.asarray(x), along_batch) if size_of(x) else jnp.asarray(x)
            else:
                found = jnp.expand_dims(values[id(x)], axis) if size and not x.size else values[id(x)]
            row = (size,) * (size > 0)
            return jnp.broadcast_to(found, row + batch if axis == 0 else batch + row)

        for step in steps:
            sizes = map(size_of, step.of) if step.along else [step.size] * len(step.of)
            operands = [value(x, size) for x, size in zip(step.of, sizes, strict=True)]
            if step.combines_row:
                operands = [shortened(row, step.name, layout) for row in operands]
            values[id(step)] = step.apply(*operands, axis=axis) if step.along else step.apply(*operands)
        out = []
        for names, dtype in zip(results, dtypes, strict=True):
            parts = [value(x, 0).astype(dtype) for x in names.flat]
            whole = jnp.stack(parts) if parts else jnp.zeros((0, *batch), dtype)
            out.append(whole.reshape(*names.shape, *batch))
        return out

    batched = _with_batches_behind(run)
    return lambda *arguments: jax.tree.unflatten(tree, batched(*jax.tree.leaves(arguments)))


def _with_batches_behind(run: Callable[..., list[jax.Array]], depth: int = 0) -> Callable[..., list[jax.Array]]:
    """`run` for `depth` axes behind, to which every `vmap` adds one.

    The last axis of an array lies together in memory. Where that is the batch, an axis of length 1 before it, as of the
    only seed of a training, makes XLA put the rows last on a GPU all the same. So a batch of one adds no axis, and
    neither does one of which every device has one: it is joined to the batch behind it.
    """

    @jax.custom_batching.custom_vmap
    def function(*leaves: jax.Array) -> list[jax.Array]:
        batch = leaves[0].shape[leaves[0].ndim - depth :]
        return run(layout_for(batch), *leaves)

    @function.def_vmap
    def rule(size: int, batched: Sequence[bool], *leaves: jax.Array) -> tuple[list[jax.Array], list[bool]]:
        if size == 1:
            only = [jnp.squeeze(x, 0) if is_batched else x for x, is_batched in zip(leaves, batched, strict=True)]
            results = _with_batches_behind(run, depth)(*only)
            return [jnp.expand_dims(x, 0) for x in results], [True] * len(results)
        moved = [
            jnp.moveaxis(x if is_batched else jnp.broadcast_to(x, (size, *x.shape)), 0, -1 - depth)
            for x, is_batched in zip(leaves, batched, strict=True)
        ]
        if depth and _may_be_one_on_each_device(size):
            joined = [jax.lax.collapse(x, x.ndim - 1 - depth, x.ndim + 1 - depth) for x in moved]
            results = [_split(x, size, x.ndim - depth) for x in _with_batches_behind(run, depth)(*joined)]
        else:
            results = _with_batches_behind(run, depth + 1)(*moved)
        return [jnp.moveaxis(x, -1 - depth, 0) for x in results], [True] * len(results)

    return function


def _may_be_one_on_each_device(size: int) -> bool:
    """Whether a batch is as long as the only axis of devices that a program is traced for, as seeds are of which every
    device has one. Where it is spread otherwise, joining it changes no number."""
    mesh = jax.sharding.get_abstract_mesh()
    return not mesh.empty and size == mesh.size and size in mesh.axis_sizes


def _split(x: jax.Array, size: int, axis: int) -> jax.Array:
    """An axis as two, the first of that size."""
    return x.reshape(*x.shape[:axis], size, -1, *x.shape[axis + 1 :])


def _given(numbers: Numbers, aval: Any) -> Array:
    out = np.empty(aval.shape, object)
    for at in np.ndindex(aval.shape):
        out[at] = numbers.given(aval.dtype)
    return out


def _needed(made: Sequence[Number], results: Sequence[Array]) -> list[Number]:
    """The numbers that have to be computed for the results, in an order in which they can be."""
    needed = {id(x) for result in results for x in result.flat}
    for number in reversed(made):
        if id(number) in needed:
            needed.update(id(x) for x in number.of)
    return [number for number in made if number.name and id(number) in needed]


def _evaluate(numbers: Numbers, closed: ClosedJaxpr | Jaxpr, arguments: Sequence[Array]) -> list[Array]:
    """The results of a traced function."""
    whole: Any = closed
    jaxpr: Jaxpr = getattr(whole, "jaxpr", whole)  # since JAX 0.11 some hold theirs without constants
    values: dict[Any, Array] = dict(zip(jaxpr.constvars, map(entries, getattr(whole, "consts", ())), strict=True))
    values.update(zip(jaxpr.invars, arguments, strict=True))

    def read(variable: Any) -> Array:
        if isinstance(variable, Literal):
            aval: Any = variable.aval
            return entries(np.asarray(variable.val, aval.dtype))  # it may be a number of Python, which has another
        return values[variable]

    for equation in jaxpr.eqns:
        results = _operation(numbers, equation, [read(x) for x in equation.invars])
        values.update(zip(equation.outvars, results, strict=True))
    return [read(x) for x in jaxpr.outvars]


def _operation(numbers: Numbers, equation: JaxprEqn, given: list[Array]) -> list[Array]:
    """What one operation of a traced function makes of arrays."""
    name, params = equation.primitive.name, equation.params
    if name in NESTED:
        return _evaluate(numbers, params[NESTED[name]], given)
    if name == "call_hi_primitive":  # since JAX 0.12: an operation that says itself what it is made of
        own = params["_prim"]
        made_of = jax.make_jaxpr(lambda *leaves: own.expand(*jax.tree.unflatten(own.in_tree, leaves)))
        return _evaluate(numbers, made_of(*(x.aval for x in equation.invars)), given)
    if name == "cond":
        which, *arguments = given
        branches = [_evaluate(numbers, branch, arguments) for branch in params["branches"]]
        return [_chosen(numbers, which, list(cases)) for cases in zip(*branches, strict=True)]
    if name == "scan":
        return _scan(numbers, params, given)
    if name == "sort":
        if len(given[0]) > 1 or given[0].ndim > 1:
            raise NotImplementedError("sort of more than one number")
        return given
    if name == "unstack":
        along = np.moveaxis(given[0], params["axis"], 0)
        return [along[i, ...] for i in range(len(along))]
    return [_one_array(numbers, equation, name, params, given)]


def _chosen(numbers: Numbers, which: Array, cases: list[Array]) -> Array:
    """The case of the index `which`, a single number."""
    chosen = cases[0]
    for index, case in enumerate(cases[1:], 1):
        before = arrays.call(numbers, "lt", which, entries(np.asarray(index, which[()].dtype)))
        chosen = arrays.call(numbers, "select_n", before, case, chosen)
    return chosen


def _scan(numbers: Numbers, params: dict[str, Any], given: list[Array]) -> list[Array]:
    """A loop, written out."""
    constants, carry, over = _loop_arguments(params, given)
    kept = []
    rounds = range(params["length"])
    for i in reversed(rounds) if params["reverse"] else rounds:
        now = _evaluate(numbers, params["jaxpr"], [*constants, *carry, *(x[i, ...] for x in over)])
        carry, rest = now[: len(carry)], now[len(carry) :]
        kept.append(rest)
    stacked = [np.stack(x) for x in zip(*(reversed(kept) if params["reverse"] else kept), strict=True)]
    return [*carry, *stacked]


def _loop_arguments(params: dict[str, Any], given: list[Array]) -> tuple[list[Array], list[Array], list[Array]]:
    """A loop's constants, what its first round begins with, and what it goes along."""
    if "num_consts" in params:
        first, second = params["num_consts"], params["num_consts"] + params["num_carry"]
    elif "ft_in" in params:  # since JAX 0.11, as trees
        first, second, _ = accumulate(len(list(part)) for part in params["ft_in"].update(range(len(given))).unpack())
    else:
        raise NotImplementedError("a loop whose arguments are not told apart in a known way")
    return given[:first], given[first:second], given[second:]


def _one_array(numbers: Numbers, equation: JaxprEqn, name: str, params: dict[str, Any], given: list[Array]) -> Array:
    """The result of an operation that has one."""
    aval: Any = equation.outvars[0].aval
    x = given[0] if given else np.empty(0, object)
    if name in KNOWN:
        apply = partial(equation.primitive.bind, **params)
        return each(numbers, name, apply, aval.dtype, *given)
    if name in FOLDS:
        return fold(numbers, FOLDS[name], x, params["axes"], aval.dtype.type(0))
    if name in SCATTERS:

        def combine(old: Any, new: Any) -> Any:
            with_old = SCATTERS[name]
            return new if with_old is None else numbers.call(with_old, numbers.single(old), numbers.single(new))

        to = params["dimension_numbers"]
        return arrays.scatter(combine, x, known(given[1], int), given[2], to, params["mode"])
    match name:
        case "broadcast_in_dim":
            return arrays.broadcast_in_dim(x, params["shape"], params["broadcast_dimensions"])
        case "reshape" | "squeeze" | "expand_dims":
            return x.reshape(aval.shape)
        case "transpose":
            return x.transpose(params["permutation"])
        case "slice":
            steps = params["strides"] or [1] * x.ndim
            return x[tuple(map(slice, params["start_indices"], params["limit_indices"], steps))]
        case "concatenate":
            return np.concatenate(given, params["dimension"])
        case "stack":
            return np.stack(given, params["axis"])
        case "tile":
            return np.tile(x, params["reps"])
        case "rev":
            return np.flip(x, params["dimensions"])
        case "copy" | "copy_p" | "stop_gradient" | "optimization_barrier":
            return x
        case "empty":
            return entries(np.zeros(aval.shape, aval.dtype))  # whatever they are, they are known
        case "iota":
            along = np.arange(aval.shape[params["dimension"]]).astype(aval.dtype)
            return entries(arrays.broadcast_in_dim(along, aval.shape, (params["dimension"],)))
        case "cumsum":
            if x.ndim > 1 or params["reverse"]:
                raise NotImplementedError("cumsum of more than a vector, or backwards")
            sums = [fold(numbers, "add", x[: i + 1], (0,), aval.dtype.type(0)) for i in range(len(x))]
            return np.stack(sums)
        case "argmin":
            return arrays.argmin(numbers, x, np.dtype(params["index_dtype"]))
        case "dot_general":
            return arrays.dot(numbers, x, given[1], params["dimension_numbers"])
        case "cholesky":
            return arrays.cholesky(numbers, x)
        case "triangular_solve":
            flags = {flag: params[flag] for flag in ("left_side", "lower", "transpose_a", "unit_diagonal")}
            return arrays.triangular_solve(numbers, x, given[1], **flags)
        case "dynamic_slice":
            starts = [numbers.single(start[()]) for start in given[1:]]
            return arrays.dynamic_slice(numbers, x, starts, params["slice_sizes"])
        case "gather":
            sizes, mode = params["slice_sizes"], params["mode"]
            return arrays.gather(x, known(given[1], int), params["dimension_numbers"], sizes, mode)
    raise NotImplementedError(f"there is no rule for {name}")
