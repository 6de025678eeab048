"""Methods by name: what they switch, and that nothing else changes."""

import pytest

from experiments import methods
from experiments.cli import request as command_line
from experiments.compare import differences
from experiments.configs import CONFIGS
from t2tl_jax.errors import UserError
from t2tl_jax.networks.context import ContextConfig

NETWORK = ("network.task_encoder", "network.freeze_task_encoder", "network.context")
SWITCHES = (*NETWORK, "pretrained", "simultaneous", "dqn.simultaneous")


@pytest.mark.parametrize("name", list(methods.METHODS))
@pytest.mark.parametrize("base", ["zone_ppo", "waterworld_dqn"])
def test_a_method_changes_its_switches_only(base, name):
    before, method = CONFIGS[base][0], methods.METHODS[name]
    after = methods.apply(before, name)
    assert after.network.task_encoder == method.task_encoder
    assert (after.network.context is not None) == method.context
    assert all(change.partition("=")[0].startswith(SWITCHES) for change in differences(before, after))
    if after.dqn is not None:
        assert after.dqn.simultaneous == method.simultaneous
    if method.task_encoder == "one_hot":
        assert after.pretrained == "" and not after.network.freeze_task_encoder
    else:
        assert after.pretrained == before.pretrained


def test_named_configurations_are_the_methods_they_say():
    assert methods.apply(CONFIGS["zone_ppo"][0], "t2tl") == CONFIGS["zone_ppo"][0]
    assert methods.apply(CONFIGS["waterworld_dqn"][0], "t1tl") == CONFIGS["waterworld_dqn"][0]
    published = CONFIGS["zone_ppo_published"][0]
    assert methods.apply(published, "t2tl") == published  # with its own context, not the default one
    assert methods.apply(CONFIGS["waterworld_dqn"][0], "t2tl").network.context == ContextConfig(length=12)


def test_pretraining_has_no_context():
    assert methods.apply(CONFIGS["pretrain_zone"][0], "t2tl").network.context is None
    assert methods.apply(CONFIGS["pretrain_zone"][0], "gnn").network.task_encoder == "rgcn"


def test_methods_on_the_command_line():
    assert command_line.read_request(["--config", "zone_ppo", "--method", "dfa_cont"]).method == "dfa_cont"
    with pytest.raises(UserError, match="did you mean 't1tl'"):
        command_line.read_request(["--config", "zone_ppo", "--method", "t1t"])
    with pytest.raises(UserError, match="leave --config and --method out"):
        command_line.read_request(["--resume", "runs/x", "--method", "dfa"])
