import dataclasses
import json
from pathlib import Path

import fake_learner
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from envs.waterworld import WaterWorldConfig
from envs.zones import ZoneConfig
from experiments import run
from experiments.cli import request as command_line
from experiments.configs import CONFIGS, Config
from t2tl_jax.agents.dqn import DQNConfig
from t2tl_jax.errors import UserError
from t2tl_jax.networks.context import ContextConfig
from t2tl_jax.networks.q_network import QNetworkConfig
from t2tl_jax.runs import config_files


@pytest.mark.parametrize("name", CONFIGS)
def test_configs_survive_json(name):
    config, summary = CONFIGS[name]
    assert config_files.from_json(config_files.to_json(config), name) == config
    assert summary


@settings(max_examples=20, deadline=None)
@given(st.floats(0, 1), st.integers(1, 10**9), st.text())
def test_any_values_survive_json(share, frames, task):
    config = dataclasses.replace(Config(), simultaneous=share, frames=frames, task=task)
    assert config_files.from_json(config_files.to_json(config), "test") == config


def test_published_schedule():
    ppo = CONFIGS["zone_ppo_published"][0].ppo
    assert (ppo.num_envs, ppo.rollout_steps, ppo.epochs, ppo.num_minibatches) == (16, 4096, 10, 64)
    assert -(-CONFIGS["zone_ppo_published"][0].frames // ppo.batch_size) == 153


def test_overrides_of_any_depth():
    flags = ["--ppo.learning-rate", "1e-4", "--frames", "2e5", "--task", "F(Red & F White)"]
    config = command_line.override(Config(), [*flags, "--network.transformer.layers", "2"])
    assert config.ppo.learning_rate == 1e-4
    assert config.frames == 200_000
    assert config.task == "F(Red & F White)"
    assert config.network.transformer.layers == 2
    assert config.ppo.clip == Config().ppo.clip


def test_overrides_of_the_other_learner_and_environment():
    flags = ["--dqn.learning-rate", "1e-4", "--dqn.simultaneous", "False", "--env.layout", "random"]
    config = command_line.override(CONFIGS["waterworld_dqn"][0], [*flags, "--network.state-layers", "32"])
    assert config.dqn == DQNConfig(learning_rate=1e-4, simultaneous=False) and config.ppo is None
    assert config.env == WaterWorldConfig(layout="random")
    assert config.network == dataclasses.replace(CONFIGS["waterworld_dqn"][0].network, state_layers=(32,))
    assert config_files.from_json(config_files.to_json(config), "test") == config


def test_a_part_can_be_changed_or_left_out():
    context = CONFIGS["zone_ppo"][0]
    longer = command_line.override(context, ["--network.context.length", "12", "--network.context.reset", "False"])
    assert longer.network.context == ContextConfig(length=12, reset=False)
    assert config_files.from_json(config_files.to_json(longer), "test") == longer
    for flags in (["--network.context", "None"], ["--network.context=None"]):
        without = command_line.override(context, ["--frames", "2e5", *flags])
        network = dataclasses.replace(context.network, context=None)
        assert without == dataclasses.replace(context, frames=200_000, network=network)
    with pytest.raises(UserError, match="got neither"):
        command_line.override(context, ["--ppo", "None"])
    with pytest.raises(UserError, match=r"unknown option '--network\.transformer'"):
        command_line.override(context, ["--network.transformer", "None"])  # not an optional part


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"dqn": DQNConfig()}, "got both"),
        ({"ppo": None}, "got neither"),
        ({"network": QNetworkConfig()}, "ppo needs network=NetworkConfig"),
        ({"ppo": None, "dqn": DQNConfig()}, "dqn needs network=QNetworkConfig"),
    ],
)
def test_one_learner_with_its_networks(changes, said):
    with pytest.raises(ValueError, match=said):
        dataclasses.replace(Config(), **changes)


@pytest.mark.parametrize(
    ("name", "changes", "counted"),
    [
        ("zone_ppo", {}, 1),  # iterations
        ("zone_ppo", {"anneal_learning_rate": True}, 4 * 16),  # gradient steps
        ("waterworld_dqn", {}, 500 * 16),  # steps of all environments
        ("waterworld_dqn", {"updates_per_step": 20}, 500 * 20),  # gradient steps
    ],
)
def test_the_longest_run_is_as_long_as_32_bits_can_count(name, changes, counted):
    config = CONFIGS[name][0]
    learner = dataclasses.replace(config.learner, **changes)
    frames = (2**31 - 1) // counted * learner.frames_per_iteration
    config = dataclasses.replace(config, frames=frames, **{"ppo" if config.dqn is None else "dqn": learner})
    with pytest.raises(ValueError, match=f"frames must be at most {frames:,} with these settings"):
        dataclasses.replace(config, frames=frames + 1)


def test_files_from_before_there_were_several_kinds():
    config = config_files.load(Path(__file__).parents[2] / "results" / "zone_ppo_h200" / "config.json")
    assert config.env == ZoneConfig() and config.ppo == Config().ppo and config.dqn is None


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (["--config", "zone_pp"], "did you mean 'zone_ppo'"),
        (["--config", "zone_ppo", "--dqn.learning-rate", "1"], "did you mean '--ppo.learning-rate'"),
        (["--config", "waterworld_dqn", "--ppo.learning-rate", "1"], "did you mean '--dqn.learning-rate'"),
        (["--config", "waterworld_dqn", "--env.physics", "mjx"], "unknown option '--env.physics'"),
        (
            ["--config", "zone_ppo", "--ppo.learning-rate", "fast"],
            "Error parsing --ppo.learning-rate: could not convert",
        ),
        (["--config", "zone_ppo", "--ppo.clip", "0.1", "0.2"], "Unrecognized options: 0.2"),
        (["--config", "waterworld_dqn", "--dqn.buffer-size", "1"], "buffer_size must hold"),
        (["--config", "zone_ppo", "--frames", "2.5"], "whole number"),
        (["--config", "zone_ppo", "--frames", "0"], "error: frames must be at least 1, got 0"),
        (["--config", "zone_ppo", "--frames", "1e15"], "error: frames must be at most 281,474,976,579,584 with these"),
        (["--config", "waterworld_dqn", "--frames", "1e11"], "error: frames must be at most 2,147,480,000 with these"),
        (["--config", "zone_ppo", "--episode-length", "1e10"], "episode_length must be at most 2,147,483,646, since"),
        (["--config", "zone_ppo", "--ppo.num-envs", "0"], "error: ppo: num_envs must be at least 1, got 0"),
        (["--config", "zone_ppo", "--ppo.learning-rate", "nan"], "error: ppo: learning_rate must be a finite number"),
        (["--config", "zone_ppo", "--network.env-layers", "0"], "network: env_layers are sizes of layers"),
        (["--config", "zone_ppo", "--run.checkpoint-period", "nan"], "checkpoint_period is in seconds"),
        (["--config", "zone_ppo", "--seeds", "a"], "seeds are a count"),
        (["--config", "zone_ppo", "--seeds", "1,1"], "once"),
        (["--config", "zone_ppo", "--ppo.minibatch-size", "1000"], "error: ppo: minibatch_size must divide"),
        (["--config"], "expected one argument"),
        ([], "choose a configuration"),
        (["--config", "zone_ppo", "--resume", "x"], "leave --config and --method out"),
        (["--resume", "no/such/run"], "there is no folder"),
    ],
)
def test_mistakes_are_explained_before_anything_is_written(flags, said, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert (
        run.main([*flags, *([] if "--resume" in flags else ["--run.compilation-cache", ""])], fake_learner.build) == 2
    )
    message = capsys.readouterr().err
    assert said in " ".join(message.split())
    assert message.count("\n") < 25
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (
            ["--network.context.lenght", "3"],
            "unknown option '--network.context.lenght'; did you mean '--network.context.length'?",
        ),
        (["--ppo.learnin_rate=1"], "unknown option '--ppo.learnin_rate'; did you mean '--ppo.learning-rate'?"),
        (["--metod", "t1tl"], "unknown option '--metod'; did you mean '--method'?"),
        # Both at once: that values do not fit together may come of the misspelt option.
        (["--ppo.clp", "3", "--ppo.minibatch-size", "7"], "unknown option '--ppo.clp'; did you mean '--ppo.clip'?"),
        (["--env.physics", "mj"], "unknown --env.physics 'mj'; did you mean 'mjx'?"),
        (["--network.transformer.norm", "pots"], "unknown --network.transformer.norm 'pots'; did you mean 'post'?"),
    ],
)
def test_misspelt_options_and_choices_are_answered_in_the_first_of_two_lines(flags, said, capsys):
    assert run.main(["--config", "zone_ppo", *flags, "--run.compilation-cache", ""], fake_learner.build) == 2
    first, second = capsys.readouterr().err.splitlines()
    assert first == f"error: {said}"
    assert second.startswith(("All options: python -m experiments.run", "Known: "))


def test_every_misspelt_option_is_answered(capsys):
    assert run.main(["--config", "zone_ppo", "--ppo.clp", "3", "--frame", "3", "--seeds", "1"], fake_learner.build) == 2
    assert [line.split("'")[1::2] for line in capsys.readouterr().err.splitlines()[:2]] == [
        ["--ppo.clp", "--ppo.clip"],
        ["--frame", "--frames"],
    ]


def test_unknown_tasks_are_refused_with_the_nearest(capsys, tmp_path):
    flags = ["--config", "zone_ppo_closed_form", "--run.folder", str(tmp_path / "runs"), "--run.compilation-cache", ""]
    assert run.main([*flags, "--task", "phi_zon"]) == 2
    assert "phi_zone" in capsys.readouterr().err
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize(("name", "absent"), [("zone_ppo", "--dqn"), ("waterworld_dqn", "--ppo")])
def test_help_documents_every_field(name, absent, capsys):
    chosen = CONFIGS[name][0]
    with pytest.raises(SystemExit) as stop:
        command_line.override(chosen, ["--help"])
    assert stop.value.code == 0
    text = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert "--resume RUN" in text

    def check(config: object, prefix: str = "--") -> None:
        for field in dataclasses.fields(config):  # type: ignore[arg-type]
            value = getattr(config, field.name)
            name = prefix + field.name.replace("_", "-")
            if dataclasses.is_dataclass(value):
                check(value, name + ".")
            elif value is not None:
                assert name in text, name

    check(chosen)
    assert absent not in text.partition("The defaults shown")[2]


def test_list_names_every_config(capsys):
    assert run.main(["--list"]) == 0
    output = capsys.readouterr().out
    assert all(name in output for name in CONFIGS)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda data: data["ppo"].update(learning_rte=1), "nearest known 'learning_rate'"),
        (lambda data: data.update(fames=1), "nearest known 'frames'"),
        (lambda data: data.update(frames="many"), "expected int, got 'many'"),
        (lambda data: data["run"].update(gif="False"), "expected bool"),
        (lambda data: data["ppo"].update(discount=2.0), "discount must lie"),
        (lambda data: data["env"].update(physics="mj"), "physics"),
        (lambda data: data["env"].update(pool=3), "config.env: unknown field 'pool', nearest known 'pool_size'"),
        (lambda data: data["env"].update(kind="water"), "unknown kind 'water', known: zones, waterworld"),
        (lambda data: data["env"].update(kind="waterworld"), "config.env: unknown field"),
        (lambda data: data.update(env=None), "config.env"),
        (lambda data: data.update(dqn={}), "got both"),
    ],
)
def test_files_of_other_versions_are_refused(change, said):
    data = json.loads(config_files.to_json(Config()))
    change(data)
    with pytest.raises(UserError, match=said):
        config_files.from_json(json.dumps(data), "config.json")


@pytest.mark.slow
def test_runs_never_share_a_folder(train):
    folders = {train("--frames", "100", "--run.evaluation-episodes", "0") for _ in range(2)}
    assert len(folders) == 2


def test_unwritable_folder(capsys, tmp_path):
    (tmp_path / "file").write_text("")
    flags = ["--config", "zone_ppo", "--run.folder", str(tmp_path / "file"), "--run.compilation-cache", ""]
    assert run.main([*flags, "--pretrained", ""], fake_learner.build) == 2
    assert "cannot create a run" in capsys.readouterr().err
    assert Path(tmp_path / "file").read_text() == ""


def test_a_run_from_before_segments_goes_on_with_single_steps():
    data = json.loads(config_files.to_json(CONFIGS["zone_ppo"][0]))
    del data["network"]["context"]["segment_length"]
    data["network"]["context"]["aligned"] = False  # which segments of several steps refuse
    assert config_files.from_json(json.dumps(data), "config.json").network.context.segment_length == 1
