"""Methods by name: what they switch, and that nothing else changes."""

from dataclasses import replace

import pytest

from experiments import methods
from experiments.cli import request as command_line
from experiments.fairness import sizes
from t2tl_jax.agents.dqn_config import DQNConfig
from t2tl_jax.errors import UserError
from t2tl_jax.networks.context_config import ContextConfig
from t2tl_jax.networks.rgcn import RGCNConfig
from t2tl_jax.networks.task_encoders import OneHotConfig
from t2tl_jax.registry import named_config
from t2tl_jax.runs.differences import differences
from t2tl_jax.runs.experiment import build
from tests.fake_learner import CONFIG

NETWORK = ("task_encoder", "freeze_task_encoder", "context")
SWITCHES = (
    *(f"learner.network.{name}" for name in NETWORK),
    *("pretrained", "learner.counterfactual"),
)


@pytest.mark.parametrize("name", list(methods.METHODS))
@pytest.mark.parametrize("base", ["zone_ppo", "waterworld_dqn", "waterworld_dqn_paper"])
def test_a_method_changes_its_switches_only(base, name):
    before, method = named_config(base), methods.METHODS[name]
    after = methods.apply(before, name)
    network = after.learner.network
    assert type(network.task_encoder) is method.task_encoder
    assert (network.context is not None) == method.context
    assert all(change.partition("=")[0].startswith(SWITCHES) for change in differences(before, after))
    if isinstance(after.learner, DQNConfig):
        assert after.learner.counterfactual == method.counterfactual
    assert after.random_starts == before.random_starts
    if method.task_encoder is OneHotConfig:
        assert after.pretrained == "" and not network.freeze_task_encoder
    else:
        assert after.pretrained == before.pretrained


def test_named_configurations_are_the_methods_they_say():
    assert methods.apply(named_config("zone_ppo"), "t2tl") == named_config("zone_ppo")
    assert methods.apply(named_config("waterworld_dqn"), "t1tl") == named_config("waterworld_dqn")
    published = named_config("zone_ppo_published")
    assert methods.apply(published, "t2tl") == published  # with its own context, not the default one
    assert methods.apply(named_config("waterworld_dqn"), "t2tl").learner.network.context == ContextConfig(length=12)


def test_codes_have_the_published_sizes():
    for name, size in (("dfa_number", 1), ("rm_6", 6), ("rm", 16), ("dfa", 16)):
        assert methods.apply(named_config("waterworld_dqn"), name).learner.task_encoder.code_size == size


@pytest.mark.parametrize("size", [8, 16, 32])
@pytest.mark.parametrize(("method", "flag"), [("t1tl", "output"), ("gnn", "output"), ("rm", "size"), ("dfa", "size")])
@pytest.mark.parametrize("base", ["zone_ppo", "waterworld_dqn"])
def test_every_code_s_width_is_a_flag(base, method, flag, size):
    flags = [f"--learner.network.task-encoder.{flag}", str(size)]
    config, _ = command_line.configuration(command_line.read(["--config", base, "--method", method, *flags]), "", "run")
    assert config.learner.task_encoder.code_size == size


def test_the_paper_s_form_is_trained_on_and_concatenated():
    default, paper = named_config("waterworld_dqn"), named_config("waterworld_dqn_paper")
    assert paper.learner.network.head == "concat" and not paper.learner.freezes_task_encoder
    assert paper.pretrained == "auto:own"
    places = {change.partition("=")[0] for change in differences(default, paper)}
    assert places == {"learner.network.head", "learner.network.freeze_task_encoder"}


def test_the_published_form_of_the_benchmark_is_a_matter_of_switches():
    ours, published = named_config("rm_water_crm"), named_config("rm_water_crm_published")
    assert set(differences(ours, published)) == {
        "learner.gradient_clipping=each",
        "learner.learning_rate=1e-05",
        "learner.anneal_learning_rate=False",
        "learner.network.head=concat",
        "learner.network.head_layers=(256,)",
        "learner.network.state_layers=(1024, 1024)",
        "learner.network.task_layer=1024",
    }
    learner = published.learner
    assert learner.network.dueling and learner.double and learner.max_gradient_norm == 10.0
    assert (learner.target_period, learner.batch_size, learner.buffer_size) == (100, 32, 50_000)
    assert sizes(published).others == 2_758_662  # as counted of the published network


def test_pretraining_has_no_context():
    assert methods.apply(named_config("pretrain_zone"), "t2tl").learner.network.context is None
    assert methods.apply(named_config("pretrain_zone"), "gnn").learner.network.task_encoder == RGCNConfig()


def test_methods_on_the_command_line():
    assert command_line.read(["--config", "zone_ppo", "--method", "dfa_cont"]).method == "dfa_cont"
    with pytest.raises(UserError, match="did you mean 't1tl'"):
        command_line.read(["--config", "zone_ppo", "--method", "t1t"])
    with pytest.raises(UserError, match="leave --config and --method out"):
        command_line.read(["--resume", "runs/x", "--method", "dfa"])


def test_other_learners_have_no_methods():
    with pytest.raises(UserError, match="those of the paper's learners, PPO and DQN; this one is FakeConfig"):
        methods.apply(CONFIG, "t2tl")


@pytest.mark.slow
@pytest.mark.parametrize("name", list(methods.METHODS))
def test_every_method_takes_phi_safe(name):
    """Configuration, table and network fit each other; beyond them phi_safe is phi_zone with two open rows."""
    config = methods.apply(named_config("zone_ppo_safe"), name)
    assert config.task == "phi_safe"
    network = config.learner.network
    if not isinstance(network.task_encoder, OneHotConfig):
        network = replace(network, task_encoder=replace(network.task_encoder, layers=1))
    learner = replace(config.learner, network=network, num_envs=4, unroll_length=8, minibatch_size=16, epochs=1)
    env = replace(config.env, physics="closed_form")
    experiment = build(replace(config, env=env, learner=learner, frames=32, seeds="2"))
    assert experiment.table.num_rows == 4 and experiment.params_shapes["params"]
