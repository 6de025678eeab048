"""Where an iteration's time goes: by parts of the source, beside the work that these have to do at the least."""

import dataclasses
import json

import jax
import jax.numpy as jnp
import pytest

from envs.straight_line import layout
from experiments.benchmarks import gains as gains_benchmark
from experiments.benchmarks import json_file
from experiments.benchmarks import profiles as benchmark
from experiments.benchmarks.operations import count
from experiments.benchmarks.parts import NAMES, REST, part_of
from experiments.benchmarks.trainings import training
from experiments.reproduction import profiles
from experiments.reproduction.stored import REPOSITORY
from t2tl_jax.errors import UserError
from t2tl_jax.registry import configs
from t2tl_jax.runs.experiment import build
from t2tl_jax.training import program

SHIPPED = [name for name in configs() if "fake" not in name]  # before other tests add theirs

WHERE = {
    "devices": ["cpu"], "cpu": "a processor", "packages": {"jax": "0.9"}, "git_revision": "abcdefg", "time": "2026",
    "command": ["python", "-m", "x"],
}  # fmt: skip


def work_of(function, *given):
    return count(jax.make_jaxpr(function)(*given), lambda path: path.rpartition("/")[2] or "rest")


def test_arithmetic_is_counted_with_all_rounds_of_a_loop():
    matrix = jnp.ones((3, 4))

    def function(x):
        with jax.named_scope("once"):
            y = x @ matrix  # [2, 4]
        with jax.named_scope("looped"):
            y, _ = jax.lax.scan(lambda y, _: (jax.jit(jnp.sin)(y), None), y, length=5)
        return y

    work = work_of(function, jnp.ones((2, 3)))
    assert work["once"].flop == 2 * 2 * 3 * 4 and work["looped"].flop == 5 * 8


def test_bytes_are_those_that_go_from_part_to_part():
    def function(x):
        with jax.named_scope("first"):
            y = jnp.cos(jnp.sin(x))  # what is between stays inside
        with jax.named_scope("second"):
            return jnp.exp(y)

    work = work_of(function, jnp.ones(10))
    assert work["first"].bytes == 2 * 40 and work["second"].bytes == 2 * 40


def test_of_an_array_that_is_changed_in_its_place_the_places_count():
    def function(x, y):
        with jax.named_scope("write"):
            x = jax.lax.dynamic_update_slice(x, y, (0,))
        return x

    def lookup(x, at):
        with jax.named_scope("read"):
            return x.at[at].get(mode="promise_in_bounds")

    assert work_of(function, jnp.ones(1000), jnp.ones(3))["write"].bytes == 12 + 12
    # Three numbers are read and given, by three places, which may be put in order before.
    assert 3 * 12 <= work_of(lookup, jnp.ones(1000), jnp.arange(3))["read"].bytes < 100


@pytest.mark.parametrize(
    ("path", "part"),
    [
        ("jit(iterate)/vmap(policy)/ActorCritic.policy/actor/dense_0", "acting: state and head"),
        ("minibatches/loss/transpose(jvp(ActorCritic))/context_encoder.segment/encoder", "learning: context"),
        ("minibatches/loss/jvp(codes)/ActorCritic.embed/task_encoder/layer_3", "codes of tasks"),
        ("minibatches/optimiser/mul", "clipping and Adam"),
        ("environment/physics/sqrt", "physics"),
        ("vmap(guard)/select_n", "freezing seeds"),
        ("vmap()/while/body/closed_call", REST),
    ],
)
def test_parts_go_by_the_scopes_of_the_source(path, part):
    assert part_of(path) == part and part in NAMES


def test_what_the_compiler_forgot_belongs_to_what_it_reads_or_is_read_by():
    text = """
      %p = f32[2]{0} parameter(0)
      %a = f32[2]{0} fusion(%p), calls=%c, metadata={op_name="jit(iterate)/policy/mul"}
      %dot.1 = f32[2]{0} dot(%a, %p), lhs_contracting_dims={0}
      %copy.1 = f32[2]{0} copy(%p)
      %b = f32[2]{0} fusion(%copy.1), calls=%c, metadata={op_name="jit(iterate)/optimiser/add"}
      %loop = (f32[2]{0}, s32[]) while(%t), condition=%d, body=%e
    """
    shares = benchmark.shared_out({"a": 1.0, "dot.1": 2.0, "copy.1": 3.0, "b": 2.0, "loop": 99.0}, text, part_of)
    assert shares == {"acting: state and head": 3 / 8, "clipping and Adam": 5 / 8}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["zone_ppo:t2tl", "waterworld_dqn:t1tl"])
def test_nearly_all_arithmetic_of_an_iteration_has_a_part(name):
    experiment = build(dataclasses.replace(training(name), seeds="1"))
    work = benchmark.least_work(experiment, part_of)
    total = sum(one.flop for one in work.values())
    assert work[REST].flop < 0.01 * total
    expected = {"clipping and Adam", "codes of tasks", "learning: state and heads", "acting: state and head"}
    assert expected <= set(work) and all(work[part].flop > 0 for part in expected)
    assert work["freezing seeds"].bytes > 0
    if name.startswith("zone"):  # of 67 MFLOP a step at least, by the sizes of the layers
        assert work["learning: context"].flop > 0.4 * total and work["physics"].flop > 0.01 * total


@pytest.mark.slow
def test_the_command_finds_where_the_time_goes(tmp_path, monkeypatch):
    monkeypatch.setattr(benchmark, "speeds", lambda repeats: {"gigaflops": 100.0, "gigabytes": 10.0})
    file = tmp_path / "profile_cpu.json"
    small = ["--trainings", "zone_ppo:dfa:closed_form:8", "--unroll-length", "64", "--repeats", "1"]
    assert benchmark.main([*small, "--json", str(file)]) == 0
    stored = json.loads(file.read_text())
    (of,) = stored["profiles"].values()
    assert of["frames"] == 8 * 64
    shares = {name: part["share"] for name, part in of["parts"].items()}
    assert sum(shares.values()) == pytest.approx(1, abs=1e-6) and shares[REST] < 0.3
    assert shares["learning: state and heads"] > 0.1
    page = profiles.profiles(tmp_path)
    assert "learning: state and heads" in page and "100 GFLOP/s" in page and "Iterations are of 64 steps" in page


@pytest.mark.parametrize(
    ("steps", "said"),
    [
        ("100", "zone_ppo_published: minibatch_size must divide num_envs x unroll_length"),
        ("8192", "zone_ppo_published: unroll_length may make iterations shorter, of 4096 steps at most, got 8192"),
    ],
)
def test_an_iteration_of_another_length_fits_the_learner(capsys, steps, said):
    assert benchmark.main(["--trainings", "zone_ppo_published", "--unroll-length", steps]) == 2
    assert said in capsys.readouterr().err


def test_the_page_sets_parts_against_their_floor(tmp_path):
    part = {"share": 0.5, "gigaflop": 10.0, "gigabytes": 0.5}
    of = {"seconds": 1.0, "fastest": 0.9, "slowest": 1.2, "frames": 1000, "seeds": 1, "parts": {"physics": part}}
    stored = {"where": WHERE, "settings": {"repeats": 3}, "peaks": {"gigaflops": 100.0, "gigabytes": 10.0},
              "profiles": {"zone_ppo:t1tl": of}}  # fmt: skip
    assert profiles.profiles(tmp_path) == profiles.gains(tmp_path) == "Not measured yet."
    (tmp_path / "profile_cpu.json").write_text(json.dumps(stored))
    assert "| physics | 50.0% | 500 ms | 10.00 | 0.50 | 100 ms | 40.0% |" in profiles.profiles(tmp_path)
    step = {"predicted": 1.4, "measured": 1.45, "least": 1.2, "most": 1.6}
    steps = {"where": WHERE, "settings": {"repeats": 3}, "steps": {"next_state": step}}
    (tmp_path / "gains_cpu.json").write_text(json.dumps(steps))
    assert "| 1.40 | 1.45 (1.20, 1.60) | - |" in profiles.gains(tmp_path)
    steps["steps"]["next_state"] = step | {"low": 1.3, "high": 1.5}
    (tmp_path / "gains_cpu.json").write_text(json.dumps(steps))
    assert "| 1.40 | 1.45 (1.20, 1.60) | [1.300, 1.500] |" in profiles.gains(tmp_path)


def test_every_step_that_is_measured_is_described():
    assert set(gains_benchmark.KNOWN) == set(profiles.STEPS)


def test_steps_on_gpus_are_refused_elsewhere(capsys):
    assert gains_benchmark.main(["--steps", "guard", "graphs_dqn"]) == 2
    assert "graphs_dqn is a step on NVIDIA GPUs, and there is none here" in capsys.readouterr().err


def test_both_forms_of_graphs_are_compiled_with_their_own_options(monkeypatch):
    """The slow one with none, the other with those of the device."""
    given = []
    monkeypatch.setattr(gains_benchmark, "_iteration", lambda config: given.append(program.compiler_options()))
    monkeypatch.setattr(program, "compiler_options", lambda: {"those of": "a GPU"})
    gains_benchmark.ON_GPUS["graphs_dqn"]()
    assert given == [{}, {"those of": "a GPU"}]


def test_rows_are_cut_in_one_of_both_forms(monkeypatch):
    given = []
    monkeypatch.setattr(gains_benchmark, "_iteration", lambda config: given.append(layout.PARTS))
    gains_benchmark.ON_GPUS["cut_t1tl"]()
    assert given == [1, layout.PARTS] and layout.PARTS > 1


def test_every_configuration_is_profiled_or_like_one_that_is():
    there = profiles.profiled(REPOSITORY / "results")
    assert set(profiles.LIKE.values()) <= there and not set(profiles.LIKE) & there
    assert set(SHIPPED) == there | set(profiles.LIKE)


def test_a_gain_is_the_ratio_of_neighbouring_calls():
    forms = (gains_benchmark.Form(lambda: sum(range(200_000)), 3.0), gains_benchmark.Form(lambda: None, 2.0))
    found = gains_benchmark.compare(*forms, repeats=3)
    assert found["predicted"] == 1.5 and found["least"] > 1 and found["least"] <= found["measured"] <= found["most"]
    assert found["low"] is None  # of three calls no interval of 95 % can be had
    called = []
    count = gains_benchmark.Form(lambda: called.append(0), 1.0)
    gains_benchmark.compare(count, count, repeats=2, in_a_row=5)
    assert len(called) == 2 * 5 * (2 + 1)  # of both, of those that warm up too
    found = gains_benchmark.compare(*forms, repeats=9)
    assert found["least"] <= found["low"] < found["measured"] < found["high"] <= found["most"]


def test_what_was_compared_is_kept_when_a_later_step_fails(monkeypatch, tmp_path):
    forms = (gains_benchmark.Form(lambda: None, 1.0), gains_benchmark.Form(lambda: None, 1.0))

    def fails():
        raise UserError("no room")

    monkeypatch.setitem(gains_benchmark.KNOWN, "guard", lambda: forms)
    monkeypatch.setitem(gains_benchmark.KNOWN, "guard_12", fails)
    file = tmp_path / "gains.json"
    assert gains_benchmark.main(["--steps", "guard", "guard_12", "--json", str(file)]) == 2
    assert set(json.loads(json_file.unfinished(file).read_text())["steps"]) == {"guard"} and not file.exists()
    monkeypatch.setitem(gains_benchmark.KNOWN, "guard_12", lambda: forms)
    assert gains_benchmark.main(["--steps", "guard", "guard_12", "--json", str(file)]) == 0
    assert set(json.loads(file.read_text())["steps"]) == {"guard", "guard_12"}
    assert not json_file.unfinished(file).exists()


def test_the_interval_of_a_median_is_that_of_its_ranks(monkeypatch):
    """Of nine values the second and the eighth enclose the median with 96 %, and none nearer with 95 %."""
    ratios = iter([5.0, *range(1, 10)])  # the first warms up
    monkeypatch.setattr(
        gains_benchmark, "_seconds", lambda call, in_a_row: float(next(ratios)) if call == "slow" else 1.0
    )
    slow, fast = gains_benchmark.Form("slow", 1.0), gains_benchmark.Form("fast", 1.0)
    found = gains_benchmark.compare(slow, fast, repeats=9)
    assert (found["low"], found["measured"], found["high"]) == (2.0, 5.0, 8.0)


def test_single_steps_can_be_measured_and_a_misspelt_one_is_answered(capsys):
    assert gains_benchmark.main(["--steps", "gard"]) == 2
    assert "did you mean 'guard'" in capsys.readouterr().err


@pytest.mark.slow
def test_a_gradient_through_the_next_state_would_cost_two_passes_more():
    through, apart = gains_benchmark.next_state()
    assert through.flop / apart.flop == pytest.approx(7 / 5, abs=0.05)


def test_a_kernel_that_names_no_operation_counts_for_the_one_it_is_called_after():
    text = """
      %p = f32[2]{0} parameter(0)
      %loop_fusion.3 = f32[2]{0} fusion(%p), calls=%c, metadata={op_name="jit(iterate)/policy/mul"}
      %b = f32[2]{0} fusion(%p), calls=%c, metadata={op_name="jit(iterate)/optimiser/add"}
    """
    spent = benchmark.Spent({"loop_fusion_3": 1.0, "b": 2.0, "MemcpyD2D": 1.0}, kernels=4.0)
    shares = benchmark.shared_out(spent.operations, text, part_of)
    assert shares == {"acting: state and head": 1 / 3, "clipping and Adam": 2 / 3}
    assert benchmark.unknown(spent, text) == 0.25
    assert benchmark.unknown(benchmark.Spent(spent.operations, None), text) == 0.0


def test_the_page_says_how_long_kernels_were_at_work(tmp_path):
    parts = {"physics": {"share": 1.0, "gigaflop": 1.0, "gigabytes": 1.0}}
    of = {"seconds": 0.2, "fastest": 0.2, "slowest": 0.2, "frames": 100, "seeds": 12, "parts": parts}
    stored = {
        "peaks": {"gigaflops": 100.0, "gigabytes": 10.0}, "settings": {"repeats": 3}, "where": WHERE,
        "profiles": {"a": of | {"kernels": 0.15, "without_a_part": 0.02}, "b": of},
    }  # fmt: skip
    (tmp_path / "profile_gpu.json").write_text(json.dumps(stored))
    page = profiles.profiles(tmp_path)
    assert page.count("are at work for 150 ms, of which 2.0% are of no known operation.") == 1
