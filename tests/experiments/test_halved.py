"""Why one seed is not twice as fast on two GPUs, its axis, and where compiling goes, by stored measurements."""

import json

import pytest

from experiments.reproduction.compiling import compiling
from experiments.reproduction.few_kernels import few_kernels
from experiments.reproduction.halved import FILE, halved
from experiments.reproduction.only_seed import BEFORE, only_seed
from experiments.reproduction.rows_last import rows_last
from experiments.reproduction.second_gpu import HOST, OPTION, USUAL, second_gpu
from experiments.reproduction.sums_of_rows import sums_of_rows
from t2tl_jax.training.compiler_options import GRAPHS

WHERE = {"git_revision": "a" * 40, "devices": ["GPU"], "packages": {"jax": "1"}, "time": "2026-01-01"}


def profile(seconds, physics, frames):
    parts = {"physics": {"share": physics}, "clipping": {"share": 1 - physics - 0.001}, "resets": {"share": 0.001}}
    return {"seconds": seconds, "parts": parts, "frames": frames}


@pytest.fixture
def stored(tmp_path):
    of = {"x:mjx:8": profile(0.5, 0.8, 400), "x:mjx:4": profile(0.3, 0.5, 200)}
    (tmp_path / FILE).write_text(json.dumps({"where": WHERE, "profiles": of, "note": "Alone."}))
    return tmp_path


def benchmark(folder, name, devices, rate, commit="a"):
    row = {"part": "training", "what": "x:mjx:8", "size": "1 seed", "unit": "frames/s", "rate": rate}
    row |= {"slowest": rate, "fastest": rate, "devices": devices}
    where = WHERE | {"devices": ["GPU"] * devices, "git_revision": commit * 40}
    (folder / f"benchmark_{name}.json").write_text(json.dumps({"version": 1, "where": where, "rows": [row]}))


def test_parts_are_compared_by_their_time_and_small_ones_left_out(stored):
    said = halved(stored)
    assert "| physics | 400 ms | 150 ms | 2.67 |" in said and "| an iteration | 500 ms | 300 ms | 1.67 |" in said
    assert "resets" not in said and "Two GPUs" not in said


def test_what_two_devices_make_is_of_the_same_commit(stored):
    benchmark(stored, "one", 1, 1000.0)
    benchmark(stored, "two", 2, 1500.0)
    benchmark(stored, "other", 2, 1900.0, commit="b")
    said = " ".join(halved(stored).split())
    assert "make 1.50 times the frames/s of one" in said and "1.67 times as many" in said


def test_steps_of_compiling_follow_each_other(tmp_path):
    assert compiling(tmp_path) == halved(tmp_path) == "Not measured yet."
    stored = {"where": WHERE, "training": "x", "seeds": 2, "seconds": 10.0, "without_profiler": 9.0, "note": "Alone."}
    (tmp_path / "trial_compiling.json").write_text(json.dumps(stored | {"steps": [["a", 0.0, 4.0], ["b", 4.0, 10.0]]}))
    assert "| b | 4.0 s | 6.0 s | 60% |" in compiling(tmp_path)


def test_a_batch_is_compared_with_and_without_an_axis_of_seeds(stored):
    assert only_seed(stored) == "Not measured yet."
    took = {(0, 4): 4.0, (1, 4): 6.0, (2, 4): 5.0, (0, 8): 5.0, (1, 8): 6.0}
    rows = [{"seeds": s, "num_envs": n, "milliseconds": ms} for (s, n), ms in took.items()]
    made = {"jax": "1", "what": "a step", "device": "GPU", "environments": 4}
    forms = [{"shape": "one seed", "kernels": 3, "rows_last": 2}]
    trial = {"where": WHERE, "note": "Alone.", "rows": rows, "compiled": made | {"forms": forms}}
    (stored / "trial_only_seed.json").write_text(json.dumps(trial))
    said = " ".join(only_seed(stored).split())
    assert "| 2 x 4 | 8 | 5.00 ms | 625000 ns |" in said and "| one seed | 3 | 2 |" in said
    assert "1.50 times as long with 4 environments and 1.20 times as long with 8 environments" in said
    assert "predicted" not in said
    slow = {"x:mjx:8": profile(1.0, 0.8, 400), "x:mjx:4": profile(0.4, 0.5, 200)}
    (stored / BEFORE).write_text(json.dumps({"where": WHERE | {"git_revision": "b" * 40}, "profiles": slow}))
    said = " ".join(only_seed(stored).split())
    # 50 steps of 1 s and 0.4 s, of which each would be 1 ms and 2 ms shorter; beside physics 0.2 s became 0.1 s, and
    # 0.2 s became 0.15 s
    assert "`x:mjx:8`: predicted 1.05 times as fast, measured 2.00; but parts" in said
    assert "`x:mjx:4`: predicted 1.33 times as fast, measured 1.33; but parts" in said
    assert "were 2.00 times as fast there, and without that it is 1.67." in said
    assert "were 1.33 times as fast there, and without that it is 1.14." in said
    assert "(commit bbbbbbb)" in said and "(commit aaaaaaa," in said


def test_rows_before_the_batch_and_behind_it_are_compared_with_the_rule(tmp_path):
    assert rows_last(tmp_path) == "Not measured yet."

    def told(*gpu):
        rows = [{"seeds": s, "num_envs": n, "rows_first": a, "rows_last": b} for s, n, a, b in gpu]
        on_cpu = {"where": WHERE | {"backend": "cpu", "cpu_count": 3}, "rows": rows[:1]}
        machines = [{"where": WHERE | {"backend": "gpu"}, "rows": rows}, on_cpu]
        made = {"jax": "1", "what": "a step", "device": "GPU", "git_revision": "c" * 40}
        made["kernels"] = [{"num_envs": 8, "rows_first": 5, "rows_last": 4}]
        (tmp_path / "trial_rows_last.json").write_text(
            json.dumps({"note": "Alone.", "machines": machines, "compiled": made})
        )
        return " ".join(rows_last(tmp_path).split())

    said = told((2, 2048, 3.0, 2.0), (0, 8192, 2.0, 3.0))
    assert "| 2 x 2,048 | 4,096 | 3.00 ms | 2.00 ms | 1.50 |" in said and "On a host of 3 cores" in said
    assert "That is the faster form in every row." in said and "| 8 | 5 | 4 |" in said
    assert "at commit ccccccc." in said
    assert "not the faster form of 8,192 environments" in told((2, 2048, 3.0, 2.0), (0, 8192, 3.0, 2.0))


def test_what_is_lost_to_the_second_gpu_is_of_the_newest_commit(tmp_path):
    assert second_gpu(tmp_path) == "Not measured yet."

    usual = GRAPHS[OPTION]
    flags = {HOST: usual.replace("WHILE,", ""), "another": f"{usual},MORE"}

    def machine(commit, *rows):
        made = [
            {"num_envs": n, "devices": on, "form": form, "seconds": s, "fastest": s - 0.001, "slowest": s + 0.001}
            | {"xla_flags": f"--{OPTION}={flags[form]}" if form in flags else ""}
            for n, on, form, s in rows
        ]
        return {"where": WHERE | {"git_revision": commit * 40}, "beside": "Alone.", "rows": made}

    old = machine("a", (8, 1, USUAL, 0.9), (8, 2, USUAL, 0.8), (8, 2, "another", 0.85))
    new = machine("b", (8, 1, USUAL, 0.4), (8, 2, USUAL, 0.25))
    half = machine("b", (4, 1, USUAL, 0.22), (4, 1, HOST, 0.24))
    trial = {"note": "One seed.", "machines": [old, new, half], "failed": "Another form failed."}
    (tmp_path / "trial_second_gpu.json").write_text(json.dumps(trial))
    said = " ".join(second_gpu(tmp_path).split())
    assert "| 8 | 2 | another | aaaaaaa | 850 ms (849, 851) |" in said
    assert "By commit bbbbbbb two GPUs make 1.60 times what one makes" in said
    assert "is done in 220 ms" in said and "would make 1.82 times as much" in said
    assert "20 ms are not shared out" in said and "30 ms come with the second GPU" in said
    assert "20 ms more for half of the environments" in said and said.endswith("Another form failed.")
    assert f"*another* has it with MORE; *{HOST}* has it without WHILE." in said and "Machine 3: Alone." in said


def test_forms_of_sums_are_beside_each_other(tmp_path):
    assert sums_of_rows(tmp_path) == "Not measured yet."

    def row(num_envs, **forms):
        return {"num_envs": num_envs, "forms": {form: [time, time, time] for form, time in forms.items()}}

    runs = [
        {"where": WHERE, "rows": [row(65536, plain=4.5, r3=3.0, r4=3.1)]},
        {"where": WHERE, "rows": [row(4096, last=1.0, plain=1.1), row(8192, plain=1.1, s4=1.0), row(16384, plain=2.0)]},
        {"where": WHERE, "rows": [row(16384, plain=2.2, r3=2.0, r4=1.6)]},
    ]
    made = {"jax": "1", "what": "a step", "device": "GPU", "git_revision": "c" * 40, "on": "a machine"}
    made["forms"] = [
        {"num_envs": 8, "form": "tree", "kernels": 3, "seconds": 4.4},
        {"num_envs": 9, "form": "plain", "kernels": 5, "seconds": 6.4},
    ]
    whole = [
        {"what": "x", "seeds": 12, "parts": parts, "seconds": seconds, "kernels": 9 - parts}
        for parts, seconds in ((1, 7), (3, 8), (1, 9))
    ]
    trial = {"note": "Alone.", "runs": runs, "compiled": made, "iterations": {"where": WHERE, "rows": whole}}
    (tmp_path / "trial_sums_of_rows.json").write_text(json.dumps(trial))
    said = " ".join(sums_of_rows(tmp_path).split())
    assert "| 65,536 | - | 4.50 | 3.00 | 3.10 | - |" in said and "| 8,192 | - | 1.10 | - | - | 1.00 |" in said
    assert "makes a step of these 1.10 to 1.50 times as fast" in said and "with more environments than 65,536" in said
    assert "up to 1.10 times as long as each other for the same form and size" in said
    assert (
        "in 2 of 4 sizes, where the fastest was 4 parts, one by one with 8,192 environments (1.10 times as fast); "
        "4 parts with 16,384 environments (1.25 times as fast)." in said
    )
    assert "| x | 12 | whole | 8 | 7 s, 9 s |" in said and "| x | 12 | 3 parts | 6 | 8 s |" in said
    assert "| halves of halves | 3 (4 s) | - |" in said and "| whole | - | 5 (6 s) |" in said


def test_parts_that_were_not_timed_are_refused(tmp_path):
    trial = {"note": "", "runs": [{"where": WHERE, "rows": [{"num_envs": 65536, "forms": {"plain": [4.5, 4.4, 4.6]}}]}]}
    made = {"jax": "1", "what": "a step", "device": "GPU", "git_revision": "c" * 40, "on": "a machine", "forms": []}
    (tmp_path / "trial_sums_of_rows.json").write_text(json.dumps(trial | {"compiled": made}))
    with pytest.raises(ValueError, match="parts were not timed beside whole ones"):
        sums_of_rows(tmp_path)


def test_kernels_are_counted_before_and_after(tmp_path):
    assert few_kernels(tmp_path) == "Not measured yet."

    def counted(commit, *counts):
        rows = [{"what": "x", "seeds": seeds, "step": step, "all": whole} for seeds, step, whole in counts]
        return {"git_revision": commit * 40, "rows": rows}

    trial = {"jax": "1", "device": "GPU"}
    trial |= {
        "before": counted("a", (1, 400, 1200), (12, 300, 600)),
        "after": counted("b", (1, 200, 500), (12, 280, 539)),
    }
    (tmp_path / "trial_few_kernels.json").write_text(json.dumps(trial))
    said = few_kernels(tmp_path)
    assert "| x | 1 seed | 400 -> 200 | 1,200 -> 500 |" in said and "| x | 12 seeds | 300 -> 280 | 600 -> 539 |" in said
