"""A run that is kept with the parameters of some seeds instead of its checkpoints."""

import shutil
import tracemalloc
import zipfile
from pathlib import Path

import jax
import numpy as np
import pytest

import t2tl_jax
import tests.fake_learner  # noqa: F401
from t2tl_jax import UserError, load
from t2tl_jax.runs import params_file


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A run of seeds 7, 1 and 5, with its checkpoints."""
    folder = tmp_path_factory.mktemp("whole") / "run"
    t2tl_jax.train("fake", seeds=[7, 1, 5], folder=folder)
    return load(folder)


@pytest.fixture
def kept(whole, tmp_path):
    """The folder of a copy with the parameters of seed 1 alone, and these parameters."""
    folder = Path(shutil.copytree(whole.folder, tmp_path / "kept", ignore=shutil.ignore_patterns("checkpoints")))
    of_one = {which: jax.tree.map(lambda leaf: leaf[1:2], params) for which, params in whole.params.items()}
    of_one["best"] = jax.tree.map(lambda leaf: leaf + 1, of_one["best"])
    params_file.write(folder / "params.npz", of_one, [1], whole.iteration)
    return folder, of_one


def test_it_loads_as_a_run_of_the_seeds_that_it_holds(kept, whole):
    folder, of_one = kept
    result = load(folder)
    assert result.seeds == (1,) and (result.iteration, result.ended) == (whole.iteration, whole.ended)
    for which in ("final", "best"):
        jax.tree.map(np.testing.assert_array_equal, result.params[which], of_one[which])
    assert set(result.metrics) == set(whole.metrics)
    for name, values in whole.metrics.items():
        np.testing.assert_array_equal(result.metrics[name], values[1:2])
    with pytest.raises(UserError, match="no seed 7; its seeds: 1"):
        result.policy(7)


@pytest.mark.slow
def test_its_evaluation_is_shown_and_not_mixed_with_those_of_all_seeds(kept, evaluate_run, capsys):
    folder = kept[0]
    (folder / "evaluation.json").write_text('{"evaluations": []}')
    assert evaluate_run(folder, "--episodes", "20") == 0
    assert "not stored: only seed 1 of 1, 5, 7 is kept" in capsys.readouterr().out
    assert (folder / "evaluation.json").read_text() == '{"evaluations": []}'


def test_checkpoints_go_before_it(kept, whole):
    shutil.copytree(whole.folder / "checkpoints", kept[0] / "checkpoints")
    assert load(kept[0]).seeds == (7, 1, 5)


def test_it_is_not_trained_further(kept):
    before = (kept[0] / "metrics.csv").read_bytes()
    with pytest.raises(UserError, match="kept without its checkpoints"):
        t2tl_jax.resume(kept[0])
    assert (kept[0] / "metrics.csv").read_bytes() == before


def with_other(change):
    def damage(file):
        with np.load(file) as content:
            arrays = dict(content)
        change(arrays)
        np.savez(file, **arrays)

    return damage


def first(arrays):
    return next(name for name in arrays if name.startswith("final/"))


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda file: file.write_text("no archive"), "cannot read"),
        (lambda file: file.write_bytes(file.read_bytes()[:200]), "cannot read"),
        (lambda file: np.save(file.open("wb"), np.zeros(3)), "cannot read"),
        (with_other(lambda arrays: arrays.update(seeds=np.array([{}], object))), "seeds holds objects"),
        (with_other(lambda arrays: arrays.pop("seeds")), "does not say of which seeds"),
        (with_other(lambda arrays: arrays.update(seeds=np.array([1.0]))), "does not say of which seeds"),
        (
            with_other(lambda arrays: arrays.update(seeds=np.array([99]))),
            r"is of seeds \[99\], and the seeds of its run are \[7, 1",
        ),
        (with_other(lambda arrays: arrays.pop("iteration")), "iteration: a whole number expected"),
        (with_other(lambda arrays: arrays.pop(first(arrays))), "nothing in the file, float32"),
        (
            with_other(lambda arrays: arrays.update({first(arrays): np.zeros((1, 77), "f4")})),
            r"float32\[1, 77\] in the",
        ),
        (with_other(lambda arrays: arrays.update({first(arrays): np.zeros(1, "f8")})), r"float64\[1\] in the file"),
        (with_other(lambda arrays: arrays.update(more=np.zeros(1))), "more: not expected"),
    ],
)
def test_a_file_that_does_not_fit_is_refused(kept, damage, said):
    damage(kept[0] / "params.npz")
    with pytest.raises(UserError, match=said):
        load(kept[0])


@pytest.fixture
def small(tmp_path):
    """A file of one seed with two numbers of either kind, and the shapes to read it with."""
    params = {"kernel": np.zeros((1, 2), "f4")}
    params_file.write(tmp_path / "params.npz", {"final": params, "best": params}, [3], 5)
    return tmp_path / "params.npz", params


@pytest.mark.parametrize("name", ["seeds", "final/kernel", "more"])
def test_a_small_file_that_expands_is_not_read(small, name):
    file, like = small
    with np.load(file) as content:
        arrays = dict(content)
    np.savez_compressed(file, **arrays | {name: np.zeros(2**22, np.int64)})
    assert file.stat().st_size < 2**16
    tracemalloc.start()
    with pytest.raises(params_file.CheckpointError, match=f"{name}: |of which seeds"):
        params_file.seeds(file) if name == "seeds" else params_file.read(file, like)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2**22, "of 2^25 bytes"


def npy(shape, version=(1, 0)):
    """A file of NumPy's format that holds nothing but what it says of itself."""
    said = f"{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}}}\n".encode()
    return b"\x93NUMPY" + bytes(version) + len(said).to_bytes(2 if version == (1, 0) else 4, "little") + said


@pytest.mark.parametrize(
    ("members", "said"),
    [
        ({"final/kernel.npy": npy("(1, 2)")}, "final/kernel has .* bytes, and its header says"),
        ({"final/kernel.npy": npy("(1099511627776,)")}, "bytes, and its header says"),
        ({"a.npy": npy("(0,)", (2, 0))}, r"a is in version \(2, 0\)"),
        ({"a.npy": npy("(0,)"), "a": npy("(0,)")}, "holds a twice"),
        ({str(number): b"" for number in range(11)}, "it holds 11 arrays; the limit is 10"),
    ],
)
def test_what_a_file_says_of_itself_is_checked(small, members, said, monkeypatch):
    monkeypatch.setattr(params_file, "MAX_ARRAYS", 10)
    file, like = small
    with zipfile.ZipFile(file, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    with pytest.raises(params_file.CheckpointError, match=said):
        params_file.read(file, like)


def test_best_parameters_that_are_the_final_ones_are_stored_once(small, tmp_path):
    file, like = small
    with np.load(file) as content:
        assert set(content) == {"final/kernel", "seeds", "iteration"}
    iteration, found = params_file.read(file, like)
    assert iteration == 5 and set(found) == {"final", "best"}
    np.testing.assert_array_equal(found["best"]["kernel"], like["kernel"])
    other = {"kernel": like["kernel"] + 1}
    params_file.write(tmp_path / "two.npz", {"final": like, "best": other}, [3], 5)
    with np.load(tmp_path / "two.npz") as content:
        assert {"final/kernel", "best/kernel"} <= set(content)
    np.testing.assert_array_equal(params_file.read(tmp_path / "two.npz", like)[1]["best"]["kernel"], other["kernel"])


def test_the_final_ones_alone_are_no_best_ones(kept, whole):
    folder, of_one = kept
    params_file.write(folder / "params.npz", {"final": of_one["final"]}, [1], whole.iteration)
    result = load(folder)
    assert set(result.params) == {"final"}
    jax.tree.map(np.testing.assert_array_equal, result.params["final"], of_one["final"])
    result.policy()
    with pytest.raises(UserError, match=r"of .*kept the final parameters alone are kept, not the best"):
        result.policy(which="best")


@pytest.mark.slow
def test_the_final_ones_alone_are_evaluated_by_themselves(kept, whole, evaluate_run, capsys):
    folder, of_one = kept
    params_file.write(folder / "params.npz", {"final": of_one["final"]}, [1], whole.iteration)
    assert evaluate_run(folder, "--episodes", "20") == 0
    said = capsys.readouterr().out
    assert "final sampled" in said and "best sampled" not in said
    assert evaluate_run(folder, "--episodes", "20", "--which", "best") == 2


def test_half_precision_is_read_as_single(small):
    file, like = small
    params = {"kernel": np.array([[0.1, -3.0]], "f4")}
    params_file.write(file, {"final": params}, [3], 5, half=True)
    with np.load(file) as content:
        assert content["final/kernel"].dtype == np.float16
    found = params_file.read(file, like)[1]["final"]["kernel"]
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, params["kernel"], rtol=2**-11)
    with pytest.raises(params_file.CheckpointError, match=r"float16\[1, 2\] in the file, int32"):
        params_file.read(file, {"kernel": np.zeros((1, 2), "i4")})
    with pytest.raises(ValueError, match="final/kernel holds numbers up to 70000, and half precision ends at 65504"):
        params_file.write(file, {"final": {"kernel": np.array([[7e4, 0]], "f4")}}, [3], 5, half=True)
