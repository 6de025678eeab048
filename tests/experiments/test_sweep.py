"""Sweeps: which points a grid has, what shares a program, what is refused, and what the command leaves."""

import json
import shutil
from pathlib import Path

import pytest

import tests.fake_learner  # noqa: F401, the configuration `fake`
from experiments import compare, evaluate, sweep
from experiments.cli import grid, request
from experiments.cli.grid import Point
from experiments.sweeps import plan, work
from t2tl_jax.errors import UserError
from t2tl_jax.runs import folder as run_folder
from t2tl_jax.runs.group import CONTENT, group_folder
from t2tl_jax.runs.interrupts import NeverStop
from tests.fake_runs import full_disk


def points(config, *texts):
    return grid.points(grid.read_axes(texts), request.read(["--config", config]), "sweep")


# ----- the points of a grid -----


def test_a_grid_is_the_product_of_its_axes():
    found = points("zone_ppo", "--learner.learning-rate=1e-4,3e-4", "method=t1tl,gnn")
    assert [point.label for point in found] == [
        f"learning-rate={rate},method={method}" for rate in ("1e-4", "3e-4") for method in ("t1tl", "gnn")
    ]
    assert [point.config.learner.learning_rate for point in found] == [1e-4, 1e-4, 3e-4, 3e-4]
    assert all(point.config.learner.network.context is None for point in found)
    assert [len(group) for group in work.programs({Path(p.folder): p.config for p in found})] == [2, 2]


def test_values_are_those_of_the_flags():
    sizes = [p.config.learner.network.actor_layers for p in points("zone_ppo", "learner.network.actor_layers=64 32,8")]
    assert sizes == [(64, 32), (8,)]
    (window, none) = points("zone_ppo", "learner.network.context.length=4", "task=F Red,F(Red & F White)")
    assert (window.config.task, none.config.task) == ("F Red", "F(Red & F White)")
    assert window.folder == "length=4,task=F_Red-" + window.folder[-6:] and window.folder != none.folder


def test_a_learner_goes_by_its_own_name_too():
    found = points("zone_ppo", "ppo.learning-rate=1e-4,3e-4", "method=t1tl,gnn")
    assert [point.label for point in found][:2] == ["learning-rate=1e-4,method=t1tl", "learning-rate=1e-4,method=gnn"]
    assert [point.config for point in found] == [
        point.config for point in points("zone_ppo", "learner.learning-rate=1e-4,3e-4", "method=t1tl,gnn")
    ]
    assert found[0].words == ("--method", "t1tl", "--learner.learning-rate", "1e-4")
    with pytest.raises(UserError, match=r"dqn.batch-size: .*no such field"):
        points("zone_ppo", "dqn.batch-size=32,64")


@pytest.mark.parametrize(
    ("field", "numbers"),
    [
        ("learner.discount", True),
        ("ppo.discount", True),
        ("learner.noise_time", True),
        ("learner.epochs", False),
        ("random_starts", False),  # there are none in this configuration
        ("method", False),
        ("task", False),
    ],
)
def test_which_fields_are_numbers(field, numbers):
    (point,) = points("zone_ppo", "learner.clip-eps=0.1")
    assert grid.is_number(point.config, field) == numbers


@pytest.mark.parametrize(
    ("texts", "said"),
    [
        (["learner.learning-rat=1,2"], "learning-rat: .*no such field; the nearest .* is learner.learning-rate"),
        (["learner.network.context.lenght=2"], "no such field; the nearest .* learner.network.context.length"),
        (["run.gif=True,False"], "run.gif: it cannot be swept: .*changes nothing in it; one that can is"),
        (["seeds=1,2"], "seeds: it cannot be swept: every point .* --seeds names; one that can is"),
        (["=0.9"], "--grid takes FIELD=VALUE,VALUE, such as"),
        (["learner.discount"], "--grid takes FIELD=VALUE,VALUE, such as"),
        (["learner.discount=0.9,"], "--grid takes FIELD=VALUE,VALUE, such as"),
        (["learner.discount=0.9", "learner.discount=0.8"], "may be given once"),
        (["learner.discount=0.9,0.90"], "discount=0.90 is the same configuration as discount=0.9"),
        (["learner.discount=0.9,1.9"], "discount must lie between 0 and 1, got 1.9"),
        (["learner.epochs=many"], "learner.epochs takes a whole number"),
        (["method=t3tl"], "unknown method 't3tl'; did you mean 't2tl'"),
    ],
)
def test_what_cannot_be_swept_is_refused(texts, said):
    with pytest.raises(UserError, match=said):
        points("zone_ppo", *texts)


# ----- the command -----


def command(folder, *flags):
    return sweep.main(["--config", "fake", "--folder", str(folder), "--seeds", "2", *flags])


def test_axes_stand_after_one_flag_or_after_several():
    one, two = "learner.rate=1e-2,3e-2", "episode-length=5,6"
    told = (("--grid", one, two), ("--grid", one, "--grid", two))
    read = [plan.read(plan.split(["--config", "fake", *words])) for words in told]
    assert len(read[0].points) == 4 and read[0].points == read[1].points


@pytest.mark.parametrize(
    ("given", "read"),
    [
        (["--grid", "a=1", "b=2", "--seeds", "4"], ["--grid=a=1", "--grid=b=2", "--seeds", "4"]),
        (["--grid=a=1", "b=2"], ["--grid=a=1", "--grid=b=2"]),
        (["--grid=a=64 64,128 128"], ["--grid=a=64 64,128 128"]),
        (["--cluster-option", "x=1", "--task=!Red U Black"], ["--cluster-option=x=1", "--task=!Red U Black"]),
        (["--seeds", "4", "--grid", "a=-1"], ["--seeds", "4", "--grid=a=-1"]),
        (["--grid", "--seeds", "4"], ["--grid", "--seeds", "4"]),
        (["--space", "a=1,2", "--grid"], ["--space=a=1,2", "--grid"]),
    ],
)
def test_several_values_after_one_flag_are_one_each(given, read):
    assert plan.one_each(given) == read


@pytest.mark.slow
def test_a_sweep_leaves_ordinary_runs_a_table_and_a_picture(tmp_path, capsys):
    grids = ("--grid", "learner.rate=1e-2,3e-2", "--grid", "episode-length=5,6")
    assert command(tmp_path / "sweep", *grids) == 0
    said = capsys.readouterr().out
    assert "learner.rate: a number that only enters arithmetic" in said
    assert "episode-length: more than a number in the arithmetic" in said
    assert said.count("compiled in") == 2 and "program 2 of 2, 2 points" in said
    names = [f"rate={rate},episode-length={length}" for rate in ("1e-2", "3e-2") for length in (5, 6)]
    assert {path.name for path in (tmp_path / "sweep").iterdir()} == {*names, "curves.png"}
    for name in names:
        (line,) = (line for line in said.splitlines() if line.endswith(f"      1  {name}"))
        assert line.split()[0] == "0/2"
        config = run_folder.open_existing(tmp_path / "sweep" / name)[1]
        assert (
            f"rate={config.learner.rate:.0e},".replace("e-0", "e-") + f"episode-length={config.episode_length}" == name
        )

    runs = [str(tmp_path / "sweep" / name) for name in names[:3]]
    assert compare.main(runs) == 0 and "learner.rate=0.03" in capsys.readouterr().out
    assert evaluate.main([runs[2], "--episodes", "2"]) == 0

    shutil.rmtree(tmp_path / "sweep" / names[0])  # the same command does what is missing, and no more
    assert command(tmp_path / "sweep", *grids) == 0
    assert capsys.readouterr().out.count("compiled in") == 1
    assert command(tmp_path / "sweep", *grids, "--frames", "300") == 2
    assert "holds a run of other settings or seeds" in capsys.readouterr().err


@pytest.mark.slow
def test_a_group_of_which_some_runs_are_there_goes_on(tmp_path, capsys):
    """Stopped while its runs were written, it is not trained again."""
    grid = ("--grid", "learner.rate=1e-2,3e-2")
    with full_disk(), pytest.raises(OSError, match="the disk is full"):
        command(tmp_path, *grid)
    (left,) = tmp_path.glob("group-*")
    capsys.readouterr()
    assert command(tmp_path, *grid) == 0
    said = capsys.readouterr().out
    assert f"group  {left}" in said and "2 points side by side" in said and "note:" not in said
    assert {path.name for path in tmp_path.iterdir()} == {"rate=1e-2", "rate=3e-2", "curves.png"}

    points = {path: Point("", run_folder.open_existing(path)[1]) for path in tmp_path.glob("rate=*")}
    kept = group_folder({path: point.config for path, point in points.items()}, tmp_path)
    kept.mkdir()
    (kept / CONTENT).write_text(json.dumps([{"name": path.name} for path in points]))
    assert work.Work(tmp_path, NeverStop(), (), 0.0)._groups(points) == ([], [])
    assert "left of a group whose runs are all there" in capsys.readouterr().out


def test_a_sweep_needs_a_configuration_and_a_grid(tmp_path, capsys):
    assert sweep.main(["--help"]) == 0 and "--grid FIELD=VALUE" in capsys.readouterr().out
    for flags, said in (
        ((), "a sweep takes --config NAME and at least one --grid"),
        (("--grid", "learner.rate=1", "--list"), "a sweep has no --list: python -m experiments.run --list shows"),
    ):
        assert command(tmp_path, *flags) == 2
        assert said in capsys.readouterr().err
    assert sweep.main(["--resume", str(tmp_path), "--grid", "learner.rate=1"]) == 2
    assert "a sweep has no --resume: give the same command again" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
