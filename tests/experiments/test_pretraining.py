"""Pre-training by command line, and runs that go on with its task encoder."""

import dataclasses
import json
from pathlib import Path

import jax
import numpy as np
import pytest

import t2tl_jax
from experiments import methods, pretrain, run
from t2tl_jax.errors import UserError
from t2tl_jax.networks.gru import GRUConfig
from t2tl_jax.networks.task_encoders import OneHotConfig
from t2tl_jax.networks.transformer import TransformerConfig
from t2tl_jax.registry import make_env, named_config
from t2tl_jax.runs import experiment as experiments_of
from t2tl_jax.runs import folder as run_folder
from t2tl_jax.runs import pretraining
from t2tl_jax.runs.config import SelectionConfig
from t2tl_jax.runs.convergence import ConvergenceConfig
from t2tl_jax.runs.metrics_file import FIXED_COLUMNS, history
from t2tl_jax.single_state import SingleStateConfig

ENCODER = (
    *("--learner.network.task-encoder", "gru"),
    *("--learner.network.task-encoder.width", "8", "--learner.network.task-encoder.output", "4"),
)
QUIET = ("--run.progress", "False", "--run.gif", "False")
SIZES = {"num_envs": 8, "unroll_length": 16, "minibatch_size": 64, "epochs": 1}
SMALL = (
    *(*ENCODER, *QUIET, "--run.evaluation-episodes", "0"),
    *(word for name, size in SIZES.items() for word in (f"--learner.{name}", str(size))),
    *("--pool.size", "4", "--pool.rows", "32", "--pool.length", "14", "--pool.period", "2"),
    *("--convergence.window", "0", "--episode-length", "20"),
)
ZONE, SCHEDULE = named_config("zone_ppo"), named_config("pretrain_zone")


def changed(config, **network):
    """The configuration with other fields of its network."""
    learner = dataclasses.replace(config.learner, network=dataclasses.replace(config.learner.network, **network))
    return dataclasses.replace(config, learner=learner)


@pytest.fixture
def command(tmp_path, begins_quickly):
    """Runs `experiments.pretrain --config zone` with small sizes and returns the new folder."""
    known: set[Path] = set()

    def train(*flags: str) -> Path:
        assert pretrain.main(["--config", "zone", *SMALL, "--run.folder", str(tmp_path / "runs"), *flags]) == 0
        (new,) = set((tmp_path / "runs" / "pretrain_zone").iterdir()) - known
        known.add(new)
        return new

    return train


def test_the_published_run_has_the_published_pretraining():
    """The figures are those of the log and the configuration beside the authors' weights."""
    config = named_config("zone_ppo_published")
    before = pretraining.matching(config, make_env(config.env))
    learner, encoder = before.learner, before.learner.task_encoder
    assert (before.frames, before.iterations, before.episode_length) == (2_000_000, 245, 76)
    assert (learner.num_envs, learner.unroll_length, learner.epochs, learner.minibatch_size) == (16, 512, 2, 1024)
    assert (learner.discount, learner.gae_lambda, learner.learning_rate, learner.adam_epsilon) == (0.9, 0.5, 1e-3, 1e-8)
    assert (learner.clip_eps, learner.entropy_coefficient, learner.value_coefficient) == (0.1, 0.01, 0.5)
    assert learner.max_gradient_norm == 0.5 and before.convergence == ConvergenceConfig()
    assert before.task == "phi_zone" and before.task_length == 25 and encoder == config.learner.task_encoder
    named = named_config("pretrain_zone_published")
    assert before == dataclasses.replace(named, run=before.run, seeds=config.seeds)
    for name in ("zone_ppo", "zone_ppo_long", "waterworld_dqn"):
        assert named_config(name).pretraining_schedule == "short"


UNMASKED = {"task_encoder": TransformerConfig(masked=False)}
"""The Transformer reads padding as well."""


def encoder_of(folder: Path, which="best"):
    return t2tl_jax.load(folder).params[which]["params"]["task_encoder"]


@pytest.mark.slow
def test_pools_change_and_a_resumed_run_meets_the_same_ones(command, capsys):
    """Stopped in the middle of a pool's time, and at its end. One selects among its parameters: it changes nothing."""
    long = command(
        "--task", "Until_1_2_1_1", "--frames", "768", "--run.evaluation-episodes", "4"
    )  # six iterations, three pools
    assert "4 random formulas for 2 iterations" in capsys.readouterr().out
    short = command("--task", "Until_1_2_1_1", "--frames", "384", "--selection.points", "1")
    for frames in ("512", "768"):
        assert run.main(["--resume", str(short), "--frames", frames]) == 0
    assert (long / "metrics.csv").read_bytes() == (short / "metrics.csv").read_bytes()
    jax.tree.map(np.testing.assert_array_equal, encoder_of(long, "final"), encoder_of(short, "final"))


@pytest.mark.slow
def test_a_run_pretrains_for_itself_once_and_starts_with_that_encoder(command, monkeypatch, capsys, tmp_path):
    learner = dataclasses.replace(SCHEDULE.learner, **SIZES)
    none = SelectionConfig(points=0)
    small = dataclasses.replace(SCHEDULE, learner=learner, frames=384, convergence=ConvergenceConfig(), selection=none)
    monkeypatch.setattr(pretraining, "SCHEDULE", small)
    flags = ("--task", "F(Red & F Black)", "--selection.points", "0", "--frames", "256")
    freeze = ("--learner.network.freeze-task-encoder", "True")
    folder = command(*flags, *freeze, "--pretrained", "auto:F(Red & F White)", "--seeds", "2")
    said = capsys.readouterr().out
    assert "before pre-training of the task encoder, which is counted separately" in said
    assert "task   F(Red & F White)\nplan   384 frames per seed" in said
    assert "pre-trained: 384 frames per seed on F(Red & F White)" in said
    inner = folder / "pretraining"
    jax.tree.map(np.testing.assert_array_equal, encoder_of(folder, "final"), encoder_of(inner))  # frozen since
    status = json.loads((folder / "status.json").read_text())
    assert status["frames_per_seed"] == 256 and status["pretraining"]["frames_per_seed"] == 384
    assert status["pretraining"]["training_seconds"] > 0 and len(status["pretraining"]["length"]) == 2

    before = (inner / "metrics.csv").stat().st_mtime_ns
    assert run.main(["--resume", str(folder), "--frames", "384"]) == 0
    assert (inner / "metrics.csv").stat().st_mtime_ns == before
    assert json.loads((folder / "status.json").read_text())["pretraining"] == status["pretraining"]

    # The same by naming that run, each seed with the encoder of that seed.
    named = command(*flags, *freeze, "--pretrained", str(inner), "--seeds", "1,0")
    own, source = encoder_of(named, "final"), encoder_of(inner)
    jax.tree.map(lambda a, b: np.testing.assert_array_equal(a, b[::-1]), own, source)


@pytest.fixture
def stored(tmp_path):
    """The folder of a pre-training run, of which only the configuration is there."""

    def store(network=None, **changes) -> str:
        config = dataclasses.replace(changed(SCHEDULE, **(network or {})), **changes)
        return str(run_folder.create(tmp_path / "pretrain_zone", config, {}).path)

    return store


@pytest.fixture
def no_trace(monkeypatch):
    """Whatever is traced comes too late."""

    def trace(*_, **__):
        raise AssertionError("too late")

    monkeypatch.setattr(experiments_of, "trace", trace)


READER = "learner.network.task_encoder"


@pytest.mark.parametrize(
    ("pretrained", "network", "later", "said"),
    [
        (
            {"network": {"task_encoder": GRUConfig()}},
            {},
            {},
            f"of kind gru, and this run has transformer; set {READER} to a GRUConfig",
        ),
        ({}, {}, {}, "holds no complete checkpoint"),
        ({}, {"task_encoder": TransformerConfig(layers=2)}, {}, f"{READER}.layers=2"),
        ({"env": SingleStateConfig(("a", "b")), "task": "F a"}, {}, {}, "over a, b, in this order; this environment"),
        ({"seeds": "2"}, {}, {"seeds": "3"}, "holds seeds 0, 1 and not 2"),
        ({"network": UNMASKED}, UNMASKED, {}, r"40 in .*pretrain_zone.*, 8 in this run; set task_length=40"),
        ({"network": UNMASKED}, UNMASKED, {"task_length": 40}, "no complete checkpoint"),
        ({"network": UNMASKED}, UNMASKED, {"task": "Sequence_2_3"}, "48 in this run; set pool.length=40"),
    ],
)
def test_encoders_that_do_not_fit_are_refused_before_anything_is_traced(
    stored, no_trace, tmp_path, pretrained, network, later, said
):
    config = dataclasses.replace(changed(ZONE, **network), pretrained=stored(**pretrained), **later)
    with pytest.raises(UserError, match=said):
        t2tl_jax.train(config, folder=tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_a_folder_that_is_no_run_and_a_code_without_parameters_are_refused(tmp_path):
    with pytest.raises(UserError, match="there is no folder"):
        t2tl_jax.train("zone_ppo", pretrained=tmp_path / "nothing")
    with pytest.raises(ValueError, match="a code without parameters cannot be pre-trained"):
        changed(ZONE, task_encoder=OneHotConfig())


def matching(config):
    return pretraining.matching(config, make_env(config.env))


@pytest.mark.parametrize("name", ["zone_ppo", "waterworld_dqn"])
def test_the_matching_pretraining_has_the_same_encoder_and_propositions(name):
    later = dataclasses.replace(named_config(name), pretrained="auto", seeds="3,4")
    first = matching(later)
    assert first.task == "Eventually_1_5_1_4" and first.seeds == "3,4"
    assert first.learner.task_encoder == later.learner.task_encoder
    assert make_env(first.env).propositions == make_env(later.env).propositions
    assert matching(dataclasses.replace(later, pretrained="auto:phi_zone")).task == "phi_zone"
    assert matching(dataclasses.replace(later, pretrained="auto:own", task="F Red")).task == "F Red"
    assert not first.learner.freezes_task_encoder  # whatever `later` does with what comes of it


def test_an_encoder_that_reads_padding_is_pretrained_on_as_much_of_it():
    published = named_config("zone_ppo_published")
    assert published.task_length == 25
    first = matching(published)
    assert (first.task, first.task_length, first.pool) == ("phi_zone", 25, SCHEDULE.pool)
    on_a_family = matching(dataclasses.replace(published, pretrained="auto"))
    assert (on_a_family.task_length, on_a_family.pool.length) == (0, 25)
    for config in (published, dataclasses.replace(published, task="Sequence_2_3", task_length=0)):
        pretraining.check(experiments_of.build(config), None)
    masked = changed(published, task_encoder=TransformerConfig())
    assert matching(masked).task_length == 0  # the length matters to nobody, and may be too small there


def test_a_pretraining_of_its_own_with_other_padding_is_refused(no_trace):
    config = dataclasses.replace(changed(ZONE, **UNMASKED), pretrained="auto")
    with pytest.raises(UserError, match="40 in the pre-training on Eventually_1_5_1_4, 8 in this run"):
        t2tl_jax.train(config)


def test_a_frozen_encoder_has_to_be_pretrained():
    with pytest.raises(ValueError, match="never learns anything"):
        dataclasses.replace(named_config("waterworld_dqn"), pretrained="")
    assert methods.apply(named_config("waterworld_dqn"), "rm").pretrained == ""  # one-hot codes have nothing to learn


@pytest.mark.parametrize(
    ("name", "changes", "said"),
    [
        ("zone_ppo_closed_form", {"task_encoder": OneHotConfig()}, "one-hot code says nothing"),
        ("zone_ppo_closed_form", {"task_length": 10}, "leave task_length at 0"),
        ("zone_ppo_closed_form", {"task": "Until_1_3_1_2"}, "needs at least 12 propositions"),
        ("zone_ppo_closed_form", {"task": "Untl_1_2_1_1"}, "did you mean"),
    ],
)
def test_families_that_cannot_be_trained_are_explained(no_trace, name, changes, said):
    config = named_config(name)
    if "task_encoder" in changes:
        config = changed(dataclasses.replace(config, pretrained=""), task_encoder=changes["task_encoder"])
        changes = {}
    with pytest.raises(UserError, match=said):
        t2tl_jax.train(config, **{"task": "Until_1_2_1_1", **changes})


@pytest.mark.parametrize(
    ("metrics", "returns", "words"),
    [
        (None, [None, None], "discounted return -, length -"),
        ("1,10,0,1,1,0,0,0,0.5,1,5,5\n1,10,1,0,,,,,,,,\n", [0.5, None], "discounted return 0.500, length 5.00"),
    ],
)
def test_how_a_pretraining_ended_need_not_be_known(stored, metrics, returns, words):
    folder, config = run_folder.open_existing(Path(stored(seeds="2")))
    curves = {}
    if metrics is not None:
        folder.metrics.write_text(",".join(FIXED_COLUMNS) + "\n" + metrics)
        curves = history(folder.metrics)
    result = t2tl_jax.Result(experiments_of.build(config), {}, curves, iteration=1, folder=folder.path)
    summary = pretraining.summary(result)
    run_folder.write_json(folder.status, summary)
    assert json.loads(folder.status.read_text())["discounted_return"] == returns
    assert pretraining.in_words(summary).endswith(words)


def test_names_without_their_prefix(capsys):
    assert pretrain.main(["--list"]) == 0
    assert capsys.readouterr().out.split()[0] == "zone"
    assert pretrain.main(["--config", "zon"]) == 2
    assert "did you mean 'zone'" in capsys.readouterr().err


def test_published_encoder_sizes_are_those_of_pretraining():
    water = named_config("waterworld_dqn").learner.task_encoder
    assert named_config("pretrain_water").learner.task_encoder == water
    assert SCHEDULE.learner.task_encoder == ZONE.learner.task_encoder
