"""Pre-training by command line, and runs that go on with its task encoder."""

import dataclasses
import json
from pathlib import Path

import jax
import numpy as np
import pytest
from t2tl_jax.runs.build import build

from envs.single_state import SingleStateConfig
from experiments import methods, pretrain, run
from experiments.configs import CONFIGS, PRETRAINING, Config
from t2tl_jax.errors import UserError
from t2tl_jax.networks.actor_critic import NetworkConfig
from t2tl_jax.networks.gru import GRUConfig
from t2tl_jax.networks.transformer import TransformerConfig
from t2tl_jax.runs import folder as run_folder
from t2tl_jax.runs import pretraining, stored_params, training_run
from t2tl_jax.runs.convergence import ConvergenceConfig
from t2tl_jax.runs.metrics_file import FIXED_COLUMNS

ENCODER = ("--network.task-encoder", "gru", "--network.gru.width", "8", "--network.gru.output", "4")
QUIET = ("--run.progress", "False", "--run.gif", "False")
SMALL = (
    *(*ENCODER, *QUIET, "--run.evaluation-episodes", "0"),
    *("--ppo.num-envs", "8", "--ppo.rollout-steps", "16", "--ppo.minibatch-size", "64", "--ppo.epochs", "1"),
    *("--pool.size", "4", "--pool.rows", "32", "--pool.length", "14", "--pool.period", "2"),
    *("--convergence.window", "0", "--episode-length", "20"),
)


@pytest.fixture
def command(tmp_path):
    """Runs `experiments.pretrain --config zone` with small sizes and returns the new folder."""
    known: set[Path] = set()

    def train(*flags: str) -> Path:
        assert pretrain.main(["--config", "zone", *SMALL, "--run.folder", str(tmp_path / "runs"), *flags]) == 0
        (new,) = set((tmp_path / "runs" / "pretrain_zone").iterdir()) - known
        known.add(new)
        return new

    return train


UNMASKED = NetworkConfig(transformer=TransformerConfig(masked=False))
"""The Transformer reads padding as well."""


def encoder_of(folder: Path, which="best"):
    opened, config = run_folder.open_existing(folder)
    return stored_params.restore(opened, config, build(config), which)[1]["params"]["task_encoder"]


@pytest.mark.slow
def test_pools_change_and_a_resumed_run_meets_the_same_ones(command, capsys):
    """Stopped in the middle of a pool's time, and at its end."""
    long = command(
        "--task", "Until_1_2_1_1", "--frames", "768", "--run.evaluation-episodes", "4"
    )  # six iterations, three pools
    assert "4 random formulas for 2 iterations" in capsys.readouterr().out
    short = command("--task", "Until_1_2_1_1", "--frames", "384")
    for frames in ("512", "768"):
        assert run.main(["--resume", str(short), "--frames", frames]) == 0
    assert (long / "metrics.csv").read_bytes() == (short / "metrics.csv").read_bytes()
    jax.tree.map(np.testing.assert_array_equal, encoder_of(long, "latest"), encoder_of(short, "latest"))


@pytest.mark.slow
def test_a_run_pretrains_for_itself_once_and_starts_with_that_encoder(command, monkeypatch, capsys, tmp_path):
    ppo = dataclasses.replace(PRETRAINING.ppo, num_envs=8, rollout_steps=16, minibatch_size=64, epochs=1)
    small = dataclasses.replace(PRETRAINING, ppo=ppo, frames=384, convergence=ConvergenceConfig())
    monkeypatch.setattr(pretraining, "PRETRAINING", small)
    flags = ("--task", "F(Red & F Black)", "--pretrained", "auto:F(Red & F White)", "--seeds", "2")
    freeze = ("--network.freeze-task-encoder", "True")
    folder = command(*flags, *freeze, "--frames", "256")
    said = capsys.readouterr().out
    assert "before pre-training on F(Red & F White), at most 384 frames per seed" in said
    assert "pre-training before that: 384 frames per seed on F(Red & F White)" in said
    inner = folder / "pretraining"
    jax.tree.map(np.testing.assert_array_equal, encoder_of(folder, "latest"), encoder_of(inner))  # frozen since
    status = json.loads((folder / "status.json").read_text())
    assert status["frames_per_seed"] == 256 and status["pretraining"]["frames_per_seed"] == 384
    assert status["pretraining"]["training_seconds"] > 0 and len(status["pretraining"]["length"]) == 2

    before = (inner / "metrics.csv").stat().st_mtime_ns
    assert run.main(["--resume", str(folder), "--frames", "384"]) == 0
    assert (inner / "metrics.csv").stat().st_mtime_ns == before
    assert json.loads((folder / "status.json").read_text())["pretraining"] == status["pretraining"]

    # The same by naming that run, each seed with the encoder of that seed.
    named = command(
        "--task", "F(Red & F Black)", "--pretrained", str(inner), "--seeds", "1,0", *freeze, "--frames", "256"
    )
    own, source = encoder_of(named, "latest"), encoder_of(inner)
    jax.tree.map(lambda a, b: np.testing.assert_array_equal(a, b[::-1]), own, source)


@pytest.fixture
def stored(tmp_path):
    """The folder of a pre-training run, of which only the configuration is there."""

    def store(**changes) -> str:
        config = dataclasses.replace(PRETRAINING, **changes)
        return str(run_folder.create(tmp_path, "pretrain_zone", config, {}).path)

    return store


@pytest.mark.parametrize(
    ("pretrained", "later", "said"),
    [
        (
            {"network": NetworkConfig(task_encoder="gru")},
            {},
            "of kind gru, and this run has transformer; set",
        ),
        ({}, {}, "holds no complete checkpoint"),
        ({}, {"network": NetworkConfig(transformer=TransformerConfig(layers=2))}, "network.transformer.layers=2"),
        ({"env": SingleStateConfig(("a", "b"))}, {}, "over a, b, in this order; this environment has Black, White"),
        ({"seeds": "2"}, {"seeds": "3"}, "holds seeds 0, 1 and not 2"),
        ({"network": UNMASKED}, {"network": UNMASKED}, r"40 in .*pretrain_zone.*, 8 in this run; set --task-length 40"),
        ({"network": UNMASKED}, {"network": UNMASKED, "task_length": 40}, "no complete checkpoint"),
        ({"network": UNMASKED}, {"network": UNMASKED, "task": "Sequence_2_3"}, "48 in this run; set --pool.length 40"),
    ],
)
def test_encoders_that_do_not_fit_are_refused_before_anything_is_traced(stored, pretrained, later, said):
    config = dataclasses.replace(Config(), pretrained=stored(**pretrained), **later)

    def no_build(config):
        raise AssertionError("too late")

    with pytest.raises(UserError, match=said):
        training_run._prepare(config, no_build)


def test_a_folder_that_is_no_run_and_a_code_without_parameters_are_refused(tmp_path):
    with pytest.raises(UserError, match="there is no folder"):
        pretraining.open_fitting(dataclasses.replace(Config(), pretrained=str(tmp_path / "nothing")))
    with pytest.raises(ValueError, match="a one-hot code has no parameters to pre-train"):
        Config(network=NetworkConfig(task_encoder="one_hot"), pretrained="auto")


@pytest.mark.parametrize("name", ["zone_ppo", "waterworld_dqn"])
def test_the_matching_pretraining_has_the_same_encoder_and_propositions(name):
    later = dataclasses.replace(CONFIGS[name][0], pretrained="auto", seeds="3,4")
    first = pretraining.matching(later)
    assert first.task == "Eventually_1_5_1_4" and first.seeds == "3,4"
    assert first.network.task_encoder == later.network.task_encoder
    assert (first.network.transformer, first.network.rgcn) == (later.network.transformer, later.network.rgcn)
    assert pretraining._propositions(first) == pretraining._propositions(later)
    assert pretraining.matching(dataclasses.replace(later, pretrained="auto:phi_zone")).task == "phi_zone"
    assert pretraining.matching(dataclasses.replace(later, pretrained="auto:own", task="F Red")).task == "F Red"
    assert not first.network.freeze_task_encoder  # whatever `later` does with what comes of it


def test_an_encoder_that_reads_padding_is_pretrained_on_as_much_of_it():
    published = CONFIGS["zone_ppo_published"][0]
    assert published.task_length == 25
    first = pretraining.matching(published)
    assert (first.task, first.task_length, first.pool) == ("phi_zone", 25, PRETRAINING.pool)
    on_a_family = pretraining.matching(dataclasses.replace(published, pretrained="auto"))
    assert (on_a_family.task_length, on_a_family.pool.length) == (0, 25)
    for config in (published, dataclasses.replace(published, task="Sequence_2_3", task_length=0)):
        pretraining.check_padding(pretraining.matching(config), config, "its pre-training")
    masked = dataclasses.replace(published, network=NetworkConfig())
    assert pretraining.matching(masked).task_length == 0  # the length matters to nobody, and may be too small there


def test_a_pretraining_of_its_own_with_other_padding_is_refused():
    config = Config(network=UNMASKED, pretrained="auto")
    with pytest.raises(UserError, match="40 in the pre-training on Eventually_1_5_1_4, 8 in this run"):
        training_run._prepare(config, lambda config: None)


def test_a_frozen_encoder_has_to_be_pretrained():
    with pytest.raises(ValueError, match="never learns anything"):
        dataclasses.replace(CONFIGS["waterworld_dqn"][0], pretrained="")
    assert methods.apply(CONFIGS["waterworld_dqn"][0], "rm").pretrained == ""  # one-hot codes have nothing to learn


@pytest.mark.parametrize(
    ("name", "changes", "said"),
    [
        (
            "zone_ppo_closed_form",
            {"network": NetworkConfig(task_encoder="one_hot"), "pretrained": ""},
            "one-hot code says nothing",
        ),
        ("zone_ppo_closed_form", {"task_length": 10}, "leave task_length at 0"),
        ("zone_ppo_closed_form", {"task": "Until_1_3_1_2"}, "needs at least 12 propositions"),
        ("zone_ppo_closed_form", {"task": "Untl_1_2_1_1"}, "did you mean"),
        ("waterworld_dqn", {}, "train families with ppo"),
    ],
)
def test_families_that_cannot_be_trained_are_explained(name, changes, said):
    config = dataclasses.replace(CONFIGS[name][0], **{"task": "Until_1_2_1_1", **changes})
    with pytest.raises(UserError, match=said):
        training_run._prepare(config, build)


@pytest.mark.parametrize(
    ("metrics", "returns", "words"),
    [
        (None, [None, None], "discounted return -, length -"),
        ("1,10,0,1,1,0,0,0.5,5,5\n1,10,1,0,,,,,,\n", [0.5, None], "discounted return 0.500, length 5.00"),
    ],
)
def test_how_a_pretraining_ended_need_not_be_known(stored, metrics, returns, words):
    folder, config = run_folder.open_existing(Path(stored(seeds="2")))
    if metrics is not None:
        folder.metrics.write_text(",".join(FIXED_COLUMNS) + "\n" + metrics)
    summary = pretraining.summary(folder, config)
    run_folder.write_json(folder.status, summary)
    assert json.loads(folder.status.read_text())["discounted_return"] == returns
    assert pretraining.in_words(summary).endswith(words)


def test_names_without_their_prefix(capsys):
    assert pretrain.main(["--list"]) == 0
    assert capsys.readouterr().out.split()[0] == "zone"
    assert pretrain.main(["--config", "zon"]) == 2
    assert "did you mean 'zone'" in capsys.readouterr().err


def test_published_encoder_sizes_are_those_of_pretraining():
    assert CONFIGS["pretrain_water"][0].network.transformer == CONFIGS["waterworld_dqn"][0].network.transformer
    assert GRUConfig() == PRETRAINING.network.gru
