"""Where an iteration's time goes, and the least it could take: ``python -m experiments.benchmarks.profiles``.

The whole compiled iteration of a training runs under JAX's profiler, once it is warm. Each operation's time belongs to
the part whose named scope it was written in. Beside it stand the arithmetic and the bytes of that part, counted in the
traced program, and what these would take at the speeds of large products and copies on the same device.

On a GPU it runs under the profiler without command buffers, whose kernels do not say which operation they belong to.
The iterations that are timed have them, as a run has.
"""

import re
import statistics
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from experiments.benchmarks import json_file
from experiments.cli.errors import guarded
from t2tl_jax import checks
from t2tl_jax.errors import UserError, explained
from t2tl_jax.flags import parse
from t2tl_jax.quiet import quiet_imports

LOOPS = frozenset(("while", "call", "conditional"))
"""Operations of a compiled program that hold others, whose time counts."""

HANDED_ON = frozenset(("parameter", "get-tuple-element", "tuple", "constant"))
"""Operations that compute nothing, and say nothing about what is computed from them."""

INSTRUCTION = re.compile(r"%?([\w.-]+) = .*?[\])}] ([\w-]+)\(([^)]*)\)")
OPERAND = re.compile(r"%([\w.-]+)")
NOT_IN_KERNELS = re.compile(r"[.-]")
"""Characters of an operation's name that are underscores in the name of its kernel."""

ROUNDS = 8
"""Products and copies of one call that is timed, so that starting it does not count."""

ONE_BY_ONE = {"xla_gpu_enable_command_buffer": ""}
"""Options of a compiler for GPUs: every kernel is launched by itself."""

SCOPES = re.compile(r'op_name="([^"]*)"')


@dataclass(frozen=True)
class Arguments:
    """Profile one iteration of trainings, part by part."""

    trainings: tuple[str, ...] = (
        "zone_ppo:t1tl",
        "zone_ppo:t2tl",
        "zone_ppo:t1tl:closed_form",
        "waterworld_dqn:t1tl",
        "waterworld_dqn:t2tl",
    )
    """Trainings as CONFIG, CONFIG:METHOD, CONFIG:METHOD:PHYSICS or CONFIG:METHOD:PHYSICS:ENVIRONMENTS."""
    seeds: int = 1
    """How many seeds at once."""
    unroll_length: int | None = None
    """Steps of an iteration, for a learner whose own would take the profiler too long; minibatches keep their size, so
    that there are proportionally fewer of them."""
    repeats: int = 5
    """Iterations that are timed without the profiler; and as many with it, of which the median shares count."""
    json: Path | None = None
    """Also write the results to this file."""

    def __post_init__(self) -> None:
        checks.counts(self, "seeds", "repeats")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0 done, 2 for input that cannot be used."""
    return guarded(lambda: _main(sys.argv[1:] if arguments is None else list(arguments)))


def _main(texts: list[str]) -> int:
    arguments = parse(Arguments, texts, prog="python -m experiments.benchmarks.profiles", description=__doc__)
    json_file.check(arguments.json)
    with quiet_imports(), explained():
        configs = {text: _config(text, arguments) for text in arguments.trainings}
    peaks = speeds(arguments.repeats)
    print(f"large products: {peaks['gigaflops']:,.0f} GFLOP/s, copies: {peaks['gigabytes']:,.0f} GB/s", flush=True)
    found = {}
    for text, config in configs.items():
        found[text] = profile(config, arguments.repeats)
        print(f"\n{text}: {1e3 * found[text]['seconds']:.1f} ms, {found[text]['frames']:,} frames")
        for name, part in found[text]["parts"].items():
            print(
                f"  {name}: {part['share']:.1%}, {part['gigaflop']:.3f} GFLOP, {part['gigabytes']:.3f} GB", flush=True
            )
        json_file.store_so_far(arguments, "experiments.benchmarks.profiles", texts, peaks=peaks, profiles=found)
    json_file.store(arguments, "experiments.benchmarks.profiles", texts, peaks=peaks, profiles=found)
    return 0


def _config(text: str, arguments: Arguments) -> Any:
    from experiments.benchmarks.trainings import training

    config = replace(training(text), seeds=str(arguments.seeds))
    if arguments.unroll_length is None:
        return config
    if arguments.unroll_length > (most := config.learner.unroll_length):
        raise UserError(
            f"{text}: unroll_length may make iterations shorter, of {most} steps at most, got {arguments.unroll_length}"
        )
    try:
        return replace(config, learner=replace(config.learner, unroll_length=arguments.unroll_length))
    except ValueError as error:
        raise UserError(f"{text}: {error}") from error


def speeds(repeats: int) -> dict[str, float]:
    """What the device does best: single-precision products of 2,048 x 2,048, and sums with one number of 256 MiB."""
    import jax
    import jax.numpy as jnp

    from experiments.benchmarks.timing import rate

    square = jax.random.normal(jax.random.key(0), (2048, 2048)) / 2048**0.5  # whose products neither grow nor vanish
    long = jnp.ones(2**26, jnp.float32)
    product = jax.jit(lambda x, y: jax.lax.fori_loop(0, ROUNDS, lambda _, y: x @ y, y))
    copy = jax.jit(lambda x: jax.lax.fori_loop(0, ROUNDS, lambda _, x: x + 1.0, x))
    return {
        "gigaflops": rate(lambda: product(square, square), ROUNDS * 2 * 2048**3 / 1e9, repeats).fastest,
        "gigabytes": rate(lambda: copy(long), ROUNDS * 2 * long.nbytes / 1e9, repeats).fastest,
    }


def profile(config: Any, repeats: int) -> dict[str, Any]:
    """Seconds of an iteration of all seeds, and of each part its share of the time and its least work."""
    import jax

    from experiments.benchmarks.parts import NAMES, part_of
    from t2tl_jax.runs.experiment import build

    experiment = build(config)
    program = experiment.program
    iterate = program.lowered_iterate.compile()
    state = program.lowered_init.compile()(program.keys, program.env_params)

    def once() -> float:
        nonlocal state
        started = time.perf_counter()
        state, metrics = iterate(state, program.env_params)
        jax.block_until_ready((state, metrics))
        return time.perf_counter() - started

    for _ in range(_until_learning(config)):
        once()
    seconds = [once() for _ in range(repeats)]
    if jax.default_backend() == "gpu":
        iterate = program.lowered_iterate.compile(compiler_options=ONE_BY_ONE)
        once()
    spent = [traced(once) for _ in range(repeats)]
    text = iterate.as_text()
    shares = [shared_out(one.operations, text, part_of) for one in spent]
    work, seeds = least_work(experiment, part_of), len(experiment.seeds)
    named = [name for name in NAMES if name in work or any(name in one for one in shares)]
    return {
        "seconds": statistics.median(seconds),
        "fastest": min(seconds),
        "slowest": max(seconds),
        "frames": experiment.agent.frames_per_iteration * seeds,
        "seeds": seeds,
        "kernels": None if spent[0].kernels is None else statistics.median([one.kernels or 0.0 for one in spent]),
        "without_a_part": statistics.median([unknown(one, text) for one in spent]),
        "parts": {
            name: {
                "share": statistics.median([one.get(name, 0.0) for one in shares]),
                "gigaflop": seeds * work[name].flop / 1e9 if name in work else 0.0,
                "gigabytes": seeds * work[name].bytes / 1e9 if name in work else 0.0,
            }
            for name in named
        },
    }


def _until_learning(config: Any) -> int:
    """Iterations after which every further one learns: a replay has to hold enough first."""
    starts, each = getattr(config.learner, "learning_starts", 0), config.learner.frames_per_iteration
    return 1 + -(-starts // each)


@dataclass(frozen=True)
class Spent:
    """What one call of a compiled program spent."""

    operations: Mapping[str, float]
    """Seconds of every operation, or of a kernel that names none, summed over threads or streams. On a CPU other events
    of the host are among them."""
    kernels: float | None
    """Seconds of all kernels; None on a CPU."""


def traced(call: Callable[[], Any]) -> Spent:
    """What one call spent, by JAX's profiler."""
    import jax

    with tempfile.TemporaryDirectory() as folder:
        with jax.profiler.trace(folder):
            call()
        files = list(Path(folder).rglob("*.xplane.pb"))
        if not files:
            raise UserError("JAX's profiler wrote nothing; is another profiler running?")
        planes = list(jax.profiler.ProfileData.from_file(str(files[0])).planes)
    devices = [plane for plane in planes if plane.name.startswith("/device:GPU")]
    spent: Counter[str] = Counter()
    for plane in devices or planes:
        for line in plane.lines:
            for event in line.events:
                operation = dict(event.stats).get("hlo_op") if devices else None
                spent[str(operation or event.name)] += event.duration_ns / 1e9
    return Spent(spent, sum(spent.values()) if devices else None)


def shared_out(spent: Mapping[str, float], text: str, part_of: Callable[[str], str]) -> dict[str, float]:
    """The share of every part in the time of all operations of a compiled program, whose text is given."""
    by_part: dict[str, float] = {}
    for name, path in leaves(text).items():
        by_part[part_of(path)] = by_part.get(part_of(path), 0.0) + _seconds(spent, name)
    total = sum(by_part.values())
    return {name: seconds / total for name, seconds in by_part.items() if seconds} if total else {}


def unknown(spent: Spent, text: str) -> float:
    """The share of the kernels' time that belongs to no operation of the compiled program; 0 on a CPU."""
    known = sum(_seconds(spent.operations, name) for name in leaves(text))
    return 1 - known / spent.kernels if spent.kernels else 0.0


def _seconds(spent: Mapping[str, float], name: str) -> float:
    """Of an operation, by its own name or by its kernel's."""
    kernel = NOT_IN_KERNELS.sub("_", name)
    return spent.get(name, 0.0) + (spent.get(kernel, 0.0) if kernel != name else 0.0)


def leaves(text: str) -> dict[str, str]:
    """Operations of a compiled program that hold no others, and the scopes that each was written in.

    The compiler forgets the scopes of some, products among them: they get those of what they read, else of what reads
    them.
    """
    scopes: dict[str, str] = {}
    reads: dict[str, list[str]] = {}
    holds_none = []
    for line in text.splitlines():
        matched = INSTRUCTION.search(line)
        if not matched:
            continue
        name, kind, given = matched.groups()
        reads[name] = OPERAND.findall(given)
        written = SCOPES.search(line)
        known = [scopes[x] for x in reads[name] if scopes.get(x)]
        scopes[name] = written[1] if written else "" if kind in HANDED_ON or not known else known[0]
        if kind not in LOOPS:
            holds_none.append(name)
    for name in reversed(reads):
        for x in reads[name]:
            if not scopes.get(x) and scopes[name]:
                scopes[x] = scopes[name]
    return {name: scopes[name] for name in holds_none}


def least_work(experiment: Any, part_of: Callable[[str], str]) -> dict[str, Any]:
    """The least arithmetic and bytes of an iteration of one seed, by part."""
    import jax

    from experiments.benchmarks.operations import count

    given = experiment.task_env.make_params(experiment.seeds[0])
    state = jax.eval_shape(experiment.agent.init, jax.random.key(0), given)
    return count(jax.make_jaxpr(experiment.agent.iterate)(state, given), part_of)


if __name__ == "__main__":
    sys.exit(main())
